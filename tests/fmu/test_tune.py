"""The laboratory's tuning: the controller's maps from its plant, and its effect on other plants."""

from __future__ import annotations

import json
import re
import shutil
from functools import partial
from pathlib import Path

import pytest
from dcmReader.dcm_reader import DcmReader
from fmpy.ssp.ssd import ns, read_ssv, validate_tree
from lxml import etree

from fmu import ROOT, Run
from fmu.broken import copy_with
from fmu.conftest import Once
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, ON_TOLERANCE, Steps, couple, staircase
from fmu.master import Fmu, Make, Value
from fmu.report import Report
from fmu.resuming import resume

FITTED_DUTY = (29.0, 72.0)
"""The range of feedforward (%) in which the controller's maps were identified."""

LEAST_GAIN, LEAST_DELAY = 1000.0, 0.05
"""The least values (Pa/%, s), to which the controller's maps were raised where they do not show the plant."""


def values(file: Path) -> dict[str, Value]:
    """The values of a parameter set by name, as the master sets them."""
    return {
        parameter.name: float(parameter.value) if parameter.type == "Real" else parameter.value
        for parameter in read_ssv(file).parameters
    }


def axes(tuned: Path) -> tuple[list[float], list[float]]:
    """The engine speeds (rpm) and boost references (Pa) of a tuned grid."""
    report = json.loads((tuned / "report.json").read_text())
    return report["engine_speeds"], report["boost_references"]


def tune(lab: Run, out: Path, plant: Path, *more: str | Path) -> Path:
    """Tunes, and returns the folder of the results."""
    done = lab("tune", "--plant", plant, "--out", out, *more)
    assert (done.returncode, done.stderr) == (0, "")
    return out


@pytest.fixture(scope="session")
def tuned_by_speed(once: Once, lab: Run, exported: Path) -> Path:
    """The result of tuning to the controller's plant, for the strategy by_speed."""
    plant = exported / "BoostPlant.fmu"
    return once("tuned by speed", lambda folder: tune(lab, folder, plant, "--strategy", "by_speed"))


def test_maps_of_split_range_are_those_of_the_controller(tuned: Path, controller_fmu: Fmu) -> None:
    """As for the other strategy, below, with the same accuracy; 2 % for the sensitivity to engine speed, too.

    The limit at 5500 rpm, where engine speed hardly changes the shaft's, is another: 176.3 kPa, where the
    sweep has 205 krpm; with the controller's 174.1 kPa it runs at 202.7 krpm.
    """
    found = values(tuned / "schedule.ssv")
    start = {name: variable.start for name, variable in controller_fmu.variables.items()}
    assert found["strategy"] == "split_range"
    accuracy = {
        "virtual_duty": (0.3, 0.0),
        "gain": (0.0, 0.02),
        "time_constant": (0.0, 0.02),
        "delay": (0.005, 0.0),
        "speed_sensitivity": (0.0, 0.02),
    }
    report = json.loads((tuned / "report.json").read_text())
    worst = dict.fromkeys(accuracy, 0.0)
    identified = 0
    for cell in report["cells"]:
        place = f"[{cell['row'] + 1},{cell['column'] + 1}]"
        for name, (absolute, relative) in accuracy.items():
            own = float(start[f"range_schedule.{name}{place}"])
            difference = abs(found[f"range_schedule.{name}{place}"] - own)
            assert difference <= absolute + relative * abs(own), (name, place)
            if cell["basis"] == "identified":
                worst[name] = max(worst[name], difference / abs(own))
        identified += cell["basis"] == "identified"
    assert identified == 170
    for column, limit in enumerate(report["boost_limits"], 1):
        own = float(start[f"range_schedule.boost_limit[{column}]"])
        assert found[f"range_schedule.boost_limit[{column}]"] == limit
        assert limit == pytest.approx(own, abs=20 if column < 12 else 2300), column
    print(
        "tuning finds the maps of split_range: "
        + ", ".join(f"{name} within {100 * error:.1e} %" for name, error in worst.items())
    )


def test_numbers_of_the_law_are_those_of_the_controller(tuned: Path, controller_fmu: Fmu) -> None:
    """Within half of the last digit; λ as one of those tried."""
    found = values(tuned / "schedule.ssv")
    numbers = [("actuator_lag", 5e-4), ("speed_feedforward.share", 5e-3), ("feedback_lambda", 1e-9)]
    for name, accuracy in numbers:
        assert found[name] == pytest.approx(float(controller_fmu.variables[name].start), abs=accuracy), name
    root = etree.parse(tuned / "schedule.ssv").getroot()
    (source,) = root.xpath("//ssv:Parameter[@name='feedback_lambda']/@description", namespaces=ns)
    assert source == "the shortest with which the pump sustains noise at rest"


def test_the_loop_before_and_after_is_as_good_on_the_controllers_plant(tuned: Path) -> None:
    """Equal in Fig. 13, where the maps found differ by less than 0.01 %; elsewhere within the bounds that the
    controller is held to: 1.6 kPa on ramps (tests/speed_range), 93 % of the study's cases within 2 kPa."""
    compared = json.loads((tuned / "report.json").read_text())["comparison"]
    measured = {(row["experiment"][:7], row["measure"]): (row["before"], row["after"]) for row in compared}
    assert list(measured) == [
        ("Fig. 13", "largest overshoot up"),
        ("Fig. 13", "largest overshoot down"),
        ("Fig. 13", "slowest 90 %"),
        ("ramps o", "largest deviation"),
        ("20 case", "within 2 kPa"),
        ("20 case", "median deviation"),
        ("20 case", "largest deviation"),
    ]
    for (experiment, measure), (before, after) in measured.items():
        if experiment == "Fig. 13":
            # 0.01 % of 60 kPa, the range of the references, is 0.006 kPa; a rise takes whole samples.
            assert after == pytest.approx(before, abs=0.01), measure
    assert min(measured["Fig. 13", "largest overshoot up"]) > 0.0
    assert 0.0 < max(measured["ramps o", "largest deviation"]) <= 1.6
    assert min(measured["20 case", "within 2 kPa"]) >= 93.0
    assert "Before and after" in (tuned / "report.html").read_text()


def test_calibration_tools_read_the_same_values(tuned: Path) -> None:
    """schedule.dcm by another reader of the format: the numbers of schedule.ssv."""
    reader = DcmReader()
    reader.read(str(tuned / "schedule.dcm"))
    speeds, references = axes(tuned)
    scalars = reader.get_parameters()
    found = {scalar.name: scalar.value if scalar.text is None else scalar.text for scalar in scalars}
    for axis, grid in [("engine_speed", speeds), ("boost_reference", references)]:
        found |= {f"range_schedule.{axis}[{i}]": value for i, value in enumerate(grid, 1)}
    (limit,) = reader.get_characteristic_lines()
    assert (list(limit.values), limit.unit_x, limit.unit_values) == (speeds, "rpm", "Pa")
    found |= {f"{limit.name}[{i}]": value for i, value in enumerate(limit.values.values(), 1)}
    for table in reader.get_characteristic_maps():
        assert (list(table.values), table.unit_x, table.unit_y) == (references, "rpm", "Pa")
        for row, cells in enumerate(table.values.values(), 1):
            assert list(cells) == speeds
            found |= {f"{table.name}[{row},{column}]": cell for column, cell in enumerate(cells.values(), 1)}
    assert found == values(tuned / "schedule.ssv")


def test_maps_are_those_of_the_controller(tuned_by_speed: Path, controller_fmu: Fmu) -> None:
    """The procedure gives the controller's maps, which come from another implementation of plant and fit.

    They may differ by the accuracy of an identification: 0.3 % duty, 2 % of gain and time constant, and 5 ms
    of delay, which is less than half a sample.
    """
    report = json.loads((tuned_by_speed / "report.json").read_text())
    found = values(tuned_by_speed / "schedule.ssv")
    start = {name: variable.start for name, variable in controller_fmu.variables.items()}
    expected_bases, bases = {}, {}
    worst = dict.fromkeys(["feedforward", "gain", "time_constant", "delay"], 0.0)
    counts = dict.fromkeys(worst, 0)
    for cell in report["cells"]:
        place = f"[{cell['row'] + 1},{cell['column'] + 1}]"
        own = {name: float(start[f"schedule.{name}{place}"]) for name in worst}
        least, most = FITTED_DUTY
        if least <= own["feedforward"] <= most:
            expected_bases[place] = "identified"
        else:
            expected_bases[place] = {26.0: "above_reach", 100.0: "below_reach"}[own["feedforward"]]
        bases[place] = cell["basis"]
        differences = {
            "feedforward": abs(found[f"schedule.feedforward{place}"] - own["feedforward"]),
            "gain": abs(found[f"schedule.gain{place}"] / own["gain"] - 1),
            "time_constant": abs(found[f"schedule.time_constant{place}"] / own["time_constant"] - 1),
            "delay": abs(found[f"schedule.delay{place}"] - own["delay"]),
        }
        # Filled and raised values must be the same here.
        assert differences["feedforward"] <= 0.3, place
        assert differences["gain"] <= 0.02, place
        assert differences["time_constant"] <= 0.02, place
        assert differences["delay"] <= 0.005, place
        # But they are no evidence: only values that both identified by a model that explains 99 % of the
        # response.
        if cell["basis"] == "identified":
            assert cell["responses"]["model"]["determination"] > 0.99, place
            evident = {"feedforward", "time_constant"}
            evident |= {"gain"} if own["gain"] < -LEAST_GAIN else set()
            evident |= {"delay"} if own["delay"] > LEAST_DELAY else set()
            for name in evident:
                worst[name] = max(worst[name], differences[name])
                counts[name] += 1
    assert bases == expected_bases
    assert list(bases.values()).count("identified") == counts["feedforward"]
    print(
        "tuning finds the controller's maps: feedforward of {feedforward} points".format(**counts)
        + " within {feedforward:.1e} %, ".format(**worst)
        + f"gain of {counts['gain']} within {100 * worst['gain']:.1e} %, "
        + f"time constant of {counts['time_constant']} within {100 * worst['time_constant']:.1e} %, "
        + f"delay of {counts['delay']} within {1e3 * worst['delay']:.1e} ms",
    )


def test_parameter_set_of_split_range_is_valid(tuned: Path, controller_fmu: Fmu) -> None:
    root = etree.parse(tuned / "schedule.ssv").getroot()
    validate_tree(root, "SystemStructureParameterValues.xsd")
    parameters = root.findall("ssv:Parameters/ssv:Parameter", ns)
    components = ("range_schedule.", "allocation.")
    schedule = {name for name in controller_fmu.variables if name.startswith(components)}
    assert {parameter.get("name") for parameter in parameters} == schedule | {
        "feedback_lambda",
        "pwm_min",
        "strategy",
        "actuator_lag",
        "speed_feedforward.share",
    }
    for parameter in parameters:
        assert parameter[0].get("unit") == controller_fmu.variables[parameter.get("name")].unit


def test_parameter_set_is_valid(tuned_by_speed: Path, controller_fmu: Fmu) -> None:
    root = etree.parse(tuned_by_speed / "schedule.ssv").getroot()
    validate_tree(root, "SystemStructureParameterValues.xsd")
    parameters = root.findall("ssv:Parameters/ssv:Parameter", ns)
    schedule = {name for name in controller_fmu.variables if name.startswith("schedule.")}
    assert {parameter.get("name") for parameter in parameters} == schedule | {"lambda", "pwm_min", "strategy"}
    for parameter in parameters:
        assert parameter[0].get("unit") == controller_fmu.variables[parameter.get("name")].unit
    # At 1000 rpm 133 kPa is the maximum: filled values are marked, with their source.
    (filled,) = (p for p in parameters if p.get("name") == "schedule.gain[16,1]")
    assert filled.get("description") == (
        "filled from 130000 Pa at 1000 rpm: the reference is above the reachable range"
    )
    (found,) = (p for p in parameters if p.get("name") == "schedule.gain[5,3]")
    assert found.get("description").startswith("identified, standard error ")


@pytest.mark.parametrize("name", ["small_wastegate", "weak_turbine"])
def test_loop_is_tuned_to_another_plant(
    name: str, lab: Run, exported: Path, tmp_path: Path, plant: Make, controller: Make
) -> None:
    """The steps of Fig. 13 on a plant that the controller is tuned to.

    The paper has at most 5 kPa up and 1 kPa down; the reference solution on plants that the controller is not
    tuned to at most 0.9 kPa, and 2 Pa in the end.
    """
    set_file = ROOT / "parameters" / f"{name}.ssv"
    out = tune(lab, tmp_path, exported / "BoostPlant.fmu", "--parameters", set_file)
    found = values(out / "schedule.ssv")

    def steps(what: str, controller_values: dict[str, Value]) -> Steps:
        record = couple(
            plant(),
            controller(),
            plant_values=values(set_file),
            controller_values=controller_values,
            inputs={"boost_reference": staircase(*BOOST_STEPS)},
        ).run(BOOST_STEPS_END)
        steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
        print(f"{name}, controller {what}: {steps.summary()}")
        return steps

    steps("as it is", {})
    retuned = steps("tuned", found)
    assert max(retuned.up) <= 900
    assert max(retuned.down) <= 900
    assert max(retuned.end_error) <= 2 + ON_TOLERANCE
    if name == "weak_turbine":
        # Near the highest pressure, the reference model needs the duty of the lift-off: without it boost
        # overshoots by more than the solver's error beyond what it does with it.
        maps = {name: value for name, value in found.items() if name != "pwm_min"}
        ahead = steps("with the maps alone", maps)
        assert max(ahead.up) > max(retuned.up) + ON_TOLERANCE


def test_an_interrupted_tuning_is_resumed(lab: Run, exported: Path, tuned: Path, tmp_path: Path) -> None:
    """After 12 sweeps and some points."""
    both = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    tune = partial(lab, "tune", *both, "--out", tmp_path)
    done = resume(tune, tuned, tmp_path, 12 + 5, ["schedule.ssv"])
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"^resuming with 12 sweeps and 5 points from the journal", done.stdout, re.MULTILINE)


def test_another_journal_is_refused(lab: Run, exported: Path, tuned: Path, tmp_path: Path) -> None:
    shutil.copy(tuned / "journal.jsonl", tmp_path)
    more = [
        "--parameters",
        ROOT / "parameters" / "weak_turbine.ssv",
        "--engine-speeds",
        "1,2,3,4,5,6,7,8,9,10,11,12",
    ]
    done = lab("tune", "--plant", exported / "BoostPlant.fmu", "--out", tmp_path, *more)
    assert done.returncode == 2
    assert "it was written with other settings; choose another folder, or remove it:\n" in done.stderr
    assert "the engine speeds was [1000.0, 1250.0, 1500.0" in done.stderr
    parameters = "the plant's parameters was its start values, is hp_turbine.peak_efficiency = 0.468 1"
    assert parameters in done.stderr
    assert (tmp_path / "journal.jsonl").read_bytes() == (tuned / "journal.jsonl").read_bytes()


def test_lambda_needs_no_new_experiments(lab: Run, exported: Path, tuned: Path, tmp_path: Path) -> None:
    """It affects only the feedback, by eq. (12) of the paper."""
    shutil.copy(tuned / "journal.jsonl", tmp_path)
    tune(lab, tmp_path, exported / "BoostPlant.fmu", "--lambda", "0.5")
    assert (tmp_path / "journal.jsonl").read_bytes() == (tuned / "journal.jsonl").read_bytes()
    before, after = values(tuned / "schedule.ssv"), values(tmp_path / "schedule.ssv")
    assert {name for name in before if before[name] != after[name]} == {"feedback_lambda"}
    assert after["feedback_lambda"] == 0.5
    for cell in json.loads((tmp_path / "report.json").read_text())["cells"]:
        gain, time_constant, delay = cell["gain"], cell["time_constant"], cell["delay"]
        feedback = cell["feedback"]
        assert feedback["gain"] == pytest.approx((delay / 2 + time_constant) / (delay / 2 + 0.5) / gain)
        assert feedback["integral_time"] == pytest.approx(time_constant + delay / 2)
        expected = time_constant * delay / (delay + 2 * time_constant)
        assert feedback["derivative_time"] == pytest.approx(expected)


def test_a_plant_that_cannot_save_its_state(lab: Run, exported: Path, tuned: Path, tmp_path: Path) -> None:
    """It is simulated again for each step, with the same numbers and a note."""
    plant = copy_with(
        exported / "BoostPlant.fmu",
        tmp_path / "plant.fmu",
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"',
        'canGetAndSetFMUstate="false"',
    )
    done = lab("tune", "--plant", plant, "--out", tmp_path)
    assert done.returncode == 0
    assert done.stderr.startswith("note: The plant cannot save its state")
    assert values(tmp_path / "schedule.ssv") == values(tuned / "schedule.ssv")


def test_optional_variables_of_a_plant(lab: Run, exported: Path, tmp_path: Path) -> None:
    """Inputs of other names keep their start values, which are the same, with a note."""
    plant = exported / "BoostPlant.fmu"
    for name in ["surge_valve", "supply_voltage"]:
        plant = copy_with(plant, tmp_path / f"{name}.fmu", f'name="{name}"', f'name="my_{name}"')
    done = lab("tune", "--plant", plant, "--out", tmp_path)
    assert done.returncode == 0
    assert done.stderr == (
        "note: The plant has no input surge_valve, supply_voltage: these quantities were not held constant.\n"
    )
    assert "The plant has no input surge_valve" in (tmp_path / "report.html").read_text()


def test_a_plant_with_less_is_tuned_for_what_is_there(
    lab: Run, exported: Path, tuned: Path, tmp_path: Path
) -> None:
    """Without the other valves the maps are those of the high-pressure wastegate, at any speed."""
    plant = exported / "BoostPlant.fmu"
    for name in ["lp_wastegate", "hp_bypass", "hp_turbo_speed"]:
        plant = copy_with(plant, tmp_path / f"{name}.fmu", f'name="{name}"', f'name="my_{name}"')
    done = lab("tune", "--plant", plant, "--out", tmp_path)
    assert done.returncode == 0
    notes = done.stderr.splitlines()
    assert [note.partition(":")[2].partition(":")[0] for note in notes] == [
        " The plant has no input lp_wastegate",
        " The plant has no input hp_bypass",
        " The plant has no output hp_turbo_speed",
    ]
    found, whole = values(tmp_path / "schedule.ssv"), values(tuned / "schedule.ssv")
    for column in range(1, 13):
        assert found[f"range_schedule.boost_limit[{column}]"] == 240e3
        # Up to 2000 rpm the others are shut; 240 kPa is reached with them shut, from 1750 rpm on.
        name = f"range_schedule.virtual_duty[16,{column}]"
        assert found[name] == pytest.approx(whole[name], abs=0.01), name
        # At 2250 rpm and more 110 kPa need them.
        if column > 5:
            assert found[f"range_schedule.virtual_duty[1,{column}]"] > 102


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        ('name="engine_speed"', 'name="speed"', "has no variable engine_speed"),
        ('name="hp_wastegate_pwm"', 'name="duty"', "has no variable hp_wastegate_pwm"),
        ('name="boost_pressure"', 'name="boost"', "has no variable boost_pressure"),
        (
            '(name="engine_speed".*?)unit="rpm"',
            r'\1unit="rad/s"',
            "engine_speed is in rad/s, expected rpm",
        ),
    ],
)
def test_required_variables_of_a_plant(
    pattern: str, replacement: str, message: str, lab: Run, exported: Path, tmp_path: Path
) -> None:
    plant = tmp_path / "plant.fmu"
    copy_with(exported / "BoostPlant.fmu", plant, f"(?s){pattern}", replacement)
    done = lab("tune", "--plant", plant, "--out", tmp_path)
    assert done.returncode == 2
    assert message in done.stderr


def test_plant_that_does_not_respond_is_refused(lab: Run, exported: Path, tmp_path: Path) -> None:
    """Without an area of its wastegate the plant's boost pressure does not depend on the duty."""
    text = (ROOT / "parameters" / "small_wastegate.ssv").read_text()
    assert text.count('value="0.0003"') == 1
    shut = tmp_path / "shut.ssv"
    shut.write_text(text.replace('value="0.0003"', 'value="0"'))
    done = lab(
        "tune",
        "--plant",
        exported / "BoostPlant.fmu",
        "--parameters",
        shut,
        "--out",
        tmp_path,
        "--strategy",
        "by_speed",
    )
    assert done.returncode == 2
    assert "no grid point could be identified" in done.stderr
    assert not (tmp_path / "schedule.ssv").exists()


def test_report_has_all_maps_and_plots(tuned: Path) -> None:
    report = Report(tuned / "report.html")
    # Feedforward, gain, time constant, delay, sensitivity to speed; gain and times of the feedback; the
    # quality of the fits.
    assert (report.maps, report.cells) == (9, 9 * 16 * 12)
    # The static map, and six responses.
    assert len(report.plots) == 1 + 6
