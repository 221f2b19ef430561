"""The laboratory: `boost-lab` with the exported FMUs, against the master of these tests on FMPy."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from fmu import ROOT, Run
from fmu.broken import copy_with
from fmu.experiments import (
    BOOST_STEPS,
    BOOST_STEPS_END,
    SAMPLE_TIME,
    SCENARIOS,
    Steps,
    couple_running,
    deviation,
    run_in,
    scenario,
    staircase,
)
from fmu.master import Fmu, Make, Master
from fmu.report import Report


@pytest.fixture(scope="module")
def values(reproduction: Path) -> dict[int, dict[str, float]]:
    """The numbers of report.json by figure and name."""
    report = json.loads((reproduction / "report.json").read_text())
    return {
        figure["figure"]: {claim["name"]: claim["value"] for claim in figure["claims"]}
        for figure in report["figures"]
    }


DIFFERENCES = {"torque_gained_open_above_2000_rpm", "paper_structure_overshoot_down", "least_duty"}
"""The claims of the paper that are known not to be reproduced."""


def test_every_other_claim_of_the_paper_holds(reproduction: Path) -> None:
    report = json.loads((reproduction / "report.json").read_text())
    assert (report["all_claims_hold"], report["no_claim_fails"]) == (False, True)
    assert [figure["figure"] for figure in report["figures"]] == [1, 6, 7, 8, 9, 10, 11, 12, 13, 14]
    for figure in report["figures"]:
        assert figure["claims"]
        for claim in figure["claims"]:
            differs = claim["name"] in DIFFERENCES
            assert (claim["holds"], claim["known_difference"] is not None) == (not differs, differs)
            # Each can fail, and has the origin of its number.
            assert claim["least"] is not None or claim["most"] is not None
            assert claim["how"]
            assert claim["basis"] in {"calibration", "prediction", "construction"}


def test_report_has_all_figures(reproduction: Path) -> None:
    report = Report(reproduction / "report.html")
    assert report.text.count("<h2 ") == 10
    # Each figure but the structure has one panel at least.
    assert len(report.plots) >= 10
    # Those of the paper.
    for scenario_file in SCENARIOS.glob("figure_*"):
        assert f"The scenario {scenario_file.name}<" in report.text


def test_figures_of_the_dip_are_those_of_fmpy(values: dict, plant: Make) -> None:
    """Fig. 1, with independent measures."""
    inputs = scenario("figure_1")["inputs"]
    voltage = staircase(*inputs["supply_voltage"]["steps"])
    instance = plant()
    run_in(instance, {"hp_wastegate_pwm": inputs["hp_wastegate_pwm"], "supply_voltage": voltage(0.0)})
    record = Master([instance], SAMPLE_TIME, inputs={"supply_voltage": voltage}).run(8.0)
    before, after = record.at(2.0), record.at(6.0)
    found = values[1]
    assert found["actuator_pressure_change"] == after["actuator_pressure"] - before["actuator_pressure"]
    change = 100 * (before["hp_wastegate_position"] - after["hp_wastegate_position"])
    # The product is rounded in another order.
    assert found["position_change"] == pytest.approx(change, rel=1e-14)


def test_figures_of_the_steps_are_those_of_fmpy(values: dict, plant: Make, controller: Make) -> None:
    """Fig. 13, with both structures."""
    inputs = {"boost_reference": staircase(*BOOST_STEPS)}

    def steps(start: dict) -> Steps:
        record = couple_running(plant(), controller(), start, inputs=inputs).run(BOOST_STEPS_END)
        return Steps(record, BOOST_STEPS, BOOST_STEPS_END)

    model, paper = steps({}), steps({"structure": "paper"})
    assert values[13]["overshoot_up"] == max(model.up)
    assert values[13]["overshoot_down"] == max(model.down)
    assert values[13]["rise_time"] == max(model.rise)
    assert values[13]["end_error"] == max(model.end_error)
    assert values[13]["paper_structure_overshoot_up"] == max(paper.up)


def test_figures_of_the_voltage_steps_are_those_of_fmpy(values: dict, plant: Make, controller: Make) -> None:
    """Fig. 14, with compensation and without."""
    inputs = {"supply_voltage": staircase(*scenario("figure_14")["inputs"]["supply_voltage"]["steps"])}

    def largest(start: dict) -> float:
        record = couple_running(plant(), controller(), start, inputs=inputs).run(42.0)
        return deviation(record, 125e3, 3.0)

    assert values[14]["deviation"] == largest({})
    ratio = largest({"compensate_voltage": False}) / largest({})
    assert values[14]["rejection"] == ratio


def test_an_experiment_that_cannot_be_run_is_reported(lab: Run, exported: Path, tmp_path: Path) -> None:
    """A plant without a position of its wastegate."""
    fmus = tmp_path / "fmus"
    fmus.mkdir()
    copy_with(exported / "BoostPlant.fmu", fmus / "BoostPlant.fmu", "hp_wastegate_position", "other")
    done = lab("reproduce", "1", "--fmus", fmus, "--out", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: Fig. 1: figure_1.toml, line ")
    assert "has a variable hp_wastegate_position" in done.stderr


def test_a_failed_claim_sets_the_exit_status(
    lab: Run, exported: Path, plant_fmu: Fmu, tmp_path: Path
) -> None:
    """A plant with another pressure under the actuator's name."""
    fmus = tmp_path / "fmus"
    fmus.mkdir()
    other = plant_fmu.variables["intake_manifold_pressure"].valueReference
    pattern = r'(name="actuator_pressure" valueReference=)"\d+"'
    copy_with(exported / "BoostPlant.fmu", fmus / "BoostPlant.fmu", pattern, rf'\g<1>"{other}"')
    done = lab("reproduce", "1", "--fmus", fmus, "--out", tmp_path)
    assert done.returncode == 1, done.stderr
    assert done.stdout.count("  fails    ") == 1
    assert "\n1 of 2 claims hold\n" in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["all_claims_hold"], report["no_claim_fails"]) == (False, False)
    assert [claim["holds"] for claim in report["figures"][0]["claims"]] == [False, True]
    assert "1 of 2 claims hold" in (tmp_path / "report.html").read_text()


def test_claims_are_printed_with_the_accepted_range_and_the_papers_number(
    lab: Run, exported: Path, tmp_path: Path
) -> None:
    done = lab("reproduce", "1", "13", "--fmus", exported, "--out", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads((tmp_path / "report.json").read_text())
    claims = [claim for figure in report["figures"] for claim in figure["claims"]]
    by_name = {claim["name"]: claim for claim in claims}
    change, overshoot = by_name["actuator_pressure_change"], by_name["overshoot_up"]
    assert (change["paper_value"], overshoot["paper_value"], by_name["end_error"]["paper_value"]) == (
        2500,
        5000,
        None,
    )
    for expected in [
        f"  holds    actuator_pressure_change          {change['value'] / 1e3:.3g} kPa "
        "(accepted: 2.45 to 2.55 kPa; paper: 2.5 kPa)\n",
        f"  holds    overshoot_up                      {overshoot['value'] / 1e3:.3g} kPa "
        "(accepted: at most 5 kPa; paper: 5 kPa)\n",
        f"\n{len(claims) - 2} of {len(claims)} claims hold; 2 differ for known reasons\n",
    ]:
        assert expected in done.stdout
    # Nothing has more digits than mean something.
    assert not re.search(r"\d\.\d{4}", done.stdout)


def test_unknown_figures_are_refused(lab: Run, exported: Path, tmp_path: Path) -> None:
    done = lab("reproduce", "1", "2", "--fmus", exported, "--out", tmp_path)
    assert done.returncode == 2
    assert done.stderr == ("error: no experiment for Fig. 2: choose from 1, 6, 7, 8, 9, 10, 11, 12, 13, 14\n")


def test_plain_build_leaves_the_laboratory_out() -> None:
    """`cargo run -- export` builds the root package alone."""
    line = ["cargo", "tree", "--locked", "--all-features", "--prefix", "none", "--package", "boost-fmu"]
    tree = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "boost-lab" not in tree
    assert "libloading" not in tree
