"""The study of a controller on random plants and days: `boost-lab study`."""

from __future__ import annotations

import csv
import json
import subprocess
from functools import partial
from pathlib import Path

import pytest

from fmu import Run
from fmu.resuming import resume

SEED = "1"


def study(
    lab: Run, exported: Path, out: Path, *arguments: str, cases: int = 6
) -> subprocess.CompletedProcess[str]:
    fmus = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    return lab("study", *fmus, "--cases", str(cases), "--seed", SEED, "--out", out, *arguments)


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def test_the_controller_beside_its_strategy_by_speed(lab: Run, exported: Path, tmp_path: Path) -> None:
    done = study(lab, exported, tmp_path, "--beside", "by_speed")
    report = json.loads((tmp_path / "report.json").read_text())
    judged = [[criterion["met"] for criterion in found["criteria"]] for found in report["strategies"]]
    assert done.returncode == (0 if all(judged[0]) else 1), done.stdout + done.stderr
    all_rows = rows(tmp_path)
    of = {name: [row for row in all_rows if row["strategy"] == name] for name in ["", "by_speed"]}
    deviations = [[float(row["deviation"]) for row in found] for found in of.values()]
    assert [len(values) for values in deviations] == [6, 6]
    # Each is within what 93 % should be; a strategy that switches stages loses 20 kPa and more.
    assert max(deviations[0]) <= 2e3 < 20e3 < median(deviations[1])
    assert max(float(row["shaft_at_rest"]) for row in of[""]) <= 212e3
    assert {row["fault_code"] for row in of[""]} == {"0.0"}
    assert min(float(row["least_compressor_flow"]) for row in of[""]) > 0.0
    assert "Cases outside the bounds" in (tmp_path / "report.html").read_text()


def test_a_controller_that_fails_sets_the_exit_status_and_is_explained(
    lab: Run, exported: Path, tmp_path: Path
) -> None:
    done = study(lab, exported, tmp_path, "--strategy", "by_speed")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "NOT MET" in done.stdout
    outside = json.loads((tmp_path / "report.json").read_text())["outside"]
    assert {case["case"] for case in outside} == {
        int(row["case"]) for row in rows(tmp_path) if row["verdict"] != "pass"
    }
    for case in outside:
        # The best control that was found is no worse than the one that it began with.
        assert case["optimum"] <= case["measures"]["deviation"]
        assert f"{case['measures']['deviation'] / 1e3:.2f} kPa" in case["cause"]


def test_an_interrupted_study_continues_with_the_same_results(
    lab: Run, exported: Path, tmp_path: Path
) -> None:
    whole, rest = tmp_path / "whole", tmp_path / "rest"
    first = study(lab, exported, whole)
    rest.mkdir()
    done = resume(partial(study, lab, exported, rest), whole, rest, 2, ["results.csv"])
    assert (done.returncode, done.stderr) == (first.returncode, "")
    assert done.stdout.startswith("2 of 6 cases are in the journal")
    refused = study(lab, exported, rest, cases=7)
    assert refused.returncode == 2
    assert "cases was 6, is 7" in refused.stderr


def test_a_set_of_controller_parameters_applies_to_all_cases(
    lab: Run, exported: Path, tmp_path: Path
) -> None:
    paper = Path("parameters/paper_structure.ssv").resolve()
    study(lab, exported, tmp_path / "plain", cases=3)
    done = study(lab, exported, tmp_path / "paper", "--parameters", str(paper), cases=3)
    assert "ignored" not in done.stderr
    plain, other = ([float(row["deviation"]) for row in rows(tmp_path / name)] for name in ("plain", "paper"))
    # On the same plants, the paper's structure overshoots by kilopascals more.
    assert all(one != another for one, another in zip(plain, other, strict=True)), (plain, other)
    both = tmp_path / "both.ssv"
    tank = '<ssv:Parameter name="tank.volume"><ssv:Real value="0.002" unit="m3"/></ssv:Parameter>'
    end = "</ssv:Parameters>"
    both.write_text(paper.read_text().replace(end, tank + end))
    refused = study(lab, exported, tmp_path / "both", "--parameters", str(both), cases=1)
    assert refused.returncode == 2
    assert "has parameters of both plant and controller" in refused.stderr


@pytest.mark.parametrize("situation", ["noisy-ramps", "steps", "tip-in", "rest", "empty-tank", "faults"])
def test_a_case_of_each_situation_is_measured(
    lab: Run, exported: Path, tmp_path: Path, situation: str
) -> None:
    done = study(lab, exported, tmp_path, "--situation", situation, cases=1)
    assert done.returncode in {0, 1}, done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    criteria = {criterion["name"]: criterion["found"] for criterion in report["strategies"][0]["criteria"]}
    assert criteria["cases that ran"] == "1 of 1"
    # The FMUs tell everything that is judged; a bound for other engine speeds or faults has no case.
    (row,) = rows(tmp_path)
    needed = {"rest": ["tank_pressure", "pump_share"], "empty-tank": ["boost_without_vacuum"]}
    needed["faults"] = ["fault", "excess", "excess_without_limp_home", "shaft", "deficit"]
    needed["steps"] = needed["tip-in"] = ["dip", "rise_time"]
    assert all(row[name] for name in needed.get(situation, ["deviation"])), row


@pytest.mark.parametrize(
    ("swapped", "message"),
    [("--plant", "has no input hp_wastegate_pwm"), ("--controller", "boost_reference")],
)
def test_fmus_that_do_not_fit_are_refused(
    lab: Run, exported: Path, tmp_path: Path, swapped: str, message: str
) -> None:
    files = {"--plant": exported / "BoostPlant.fmu", "--controller": exported / "BoostController.fmu"}
    files[swapped] = files["--controller" if swapped == "--plant" else "--plant"]
    done = lab("study", *[part for pair in files.items() for part in pair], "--cases", "1", "--out", tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
