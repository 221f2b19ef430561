"""examples/optimal_control: the plant in CasADi, as docs/masters.md says.

The optima are applied to the plant's co-simulation FMU by the tests' own master.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fmu import ROOT, TARGET, documents
from fmu.documents import run
from fmu.experiments import ON_TOLERANCE, SAMPLE_TIME, staircase
from fmu.master import Make, Master

PAGE = (ROOT / "docs" / "masters.md").read_text()

SCRIPTS = "examples/optimal_control"

OPTIMA = """
import json, sys
sys.path.insert(0, "examples/optimal_control")
import optimal_control
steps = optimal_control.steps()
points = optimal_control.operating_points()
optimal_control.plot("target/optimal_control.png", steps, points)
speeds = list(optimal_control.ENGINE_SPEEDS)
found = {"limits": optimal_control.SHAFT_LIMITS, "speeds": speeds, "steps": steps, "points": points}
with open("optima.json", "w") as file:
    json.dump(found, file, default=lambda array: array.tolist())
"""
"""Runs the script, and writes what it found."""

VALVES = ["hp_wastegate_pwm", "lp_wastegate", "hp_bypass"]

END = 170e3
"""Of the step of boost (Pa)."""


@pytest.fixture(scope="module")
def folder(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder like the repository's, with the FMUs for Model Exchange."""
    both = TARGET / "both"
    assert (both / "fmi3").is_dir(), f"{both}/fmi3 is missing: bash tests/run rest exports to it"
    clone = documents.clone(exported, tmp_path_factory.mktemp("clone"))
    (clone / "target" / "both").symlink_to(both.resolve())
    return clone


def held(plant: Make, engine_speed: float, valves: list[float]) -> np.ndarray:
    """Boost and exhaust pressure (Pa) of the plant at rest."""
    instance = plant().start({"engine_speed": engine_speed, **dict(zip(VALVES, valves, strict=True))})
    return instance.reals(["boost_pressure", "exhaust_manifold_pressure"])


@pytest.mark.parametrize("fmu", ["BoostPlant.fmu", "fmi3/BoostPlant.fmu"])
def test_first_steps(folder: Path, plant: Make, fmu: str) -> None:
    """Both versions of FMI print what the page shows, within 0.01 % of full scale of the co-simulation; the
    tolerance of CVODES is 1e-6."""
    script = (ROOT / SCRIPTS / "first_steps.py").read_text()
    (folder / "first_steps.py").write_text(script.replace("BoostPlant.fmu", fmu))
    printed = run("python first_steps.py", folder)
    assert f"```text\n{printed}```" in PAGE
    instance = plant().begin({"engine_speed": 2000.0, "hp_wastegate_pwm": 44.0})
    record = Master([instance], SAMPLE_TIME, inputs={"engine_speed": lambda _: 2200.0})
    instance.slave.exitInitializationMode()
    boost = record.run(2.0)["boost_pressure"]
    shown = [1e3 * float(number) for number in re.findall(r"([\d.]+) kPa", printed)]
    assert shown == pytest.approx(boost[[0, 80, 160]], abs=ON_TOLERANCE)


def check_fastest_step(plant: Make, engine_speed: str, found: dict, limit: float) -> None:
    """Its valves, applied by the tests' master, end within 0.5 kPa and keep the limit within 100 rpm."""
    rest, *valves = np.array(found["optimum"][1])
    instance = plant().start({"engine_speed": float(engine_speed), **dict(zip(VALVES, rest, strict=True))})
    signals = {
        name: staircase(*((k * SAMPLE_TIME, value) for k, value in enumerate(column)))
        for name, column in zip(VALVES, np.transpose(valves), strict=True)
    }
    record = Master([instance], SAMPLE_TIME, inputs=signals).run(2.0)
    boost, shaft = record["boost_pressure"], record["hp_turbo_speed"]
    # The valves are those of the loop, which rests with rod friction; a settled start has none.
    assert boost[0] == pytest.approx(125e3, abs=100)
    assert boost[-1] == pytest.approx(END, abs=500)
    # The limit is kept, and matters.
    assert limit - 100 < np.max(shaft) <= limit + 100
    # Better than the controller by the measure that it minimizes.
    controlled = np.array(found["BoostController"][0])[: len(boost), 0]
    assert np.sum((boost - END) ** 2) < np.sum((controlled - END) ** 2)
    duty = np.array(valves)[:, 0]
    assert np.min(duty) >= 25
    assert np.max(duty) <= 75


def check_operating_points(plant: Make, optima: dict) -> None:
    """The plant settles at the boost asked for, with no more exhaust pressure than BoostController's, and
    with more where another valve opens by 2 % and the duty restores boost."""

    def exhaust_pressure(engine_speed: float, boost: float, others: list[float]) -> float:
        """With the duty that gives a boost, by bisection; boost falls with duty."""
        low, high = 25.0, 75.0
        for _ in range(30):
            duty = (low + high) / 2
            reached, exhaust = held(plant, engine_speed, [duty, *others])
            low, high = (duty, high) if reached > boost else (low, duty)
        assert reached == pytest.approx(boost, abs=ON_TOLERANCE)
        return exhaust

    for boost, found in optima["points"].items():
        asked = 1e3 * float(boost)
        (_, optimum), (controlled, _) = found["optimum"], found["BoostController"]
        for engine_speed, valves, beside in zip(optima["speeds"], optimum, controlled, strict=True):
            reached, exhaust = held(plant, engine_speed, valves)
            assert reached == pytest.approx(asked, abs=ON_TOLERANCE)
            assert exhaust < beside[2] + ON_TOLERANCE
        row = optima["speeds"].index(2000)
        _, least = held(plant, 2000, optimum[row])
        for others in ([0.02, 0.0], [0.0, 0.02]):
            assert exhaust_pressure(2000, asked, others) > least + ON_TOLERANCE


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"\d+\.?\d*", text)]


def check_page(printed: str) -> None:
    """It has what the script prints, except for the last digits, which may differ between machines."""
    shown = "".join(documents.blocks(PAGE, "text")).splitlines()
    for line in printed.splitlines():
        words = re.split(r"\d+\.?\d*", line)
        beside = [numbers(each) for each in shown if re.split(r"\d+\.?\d*", each) == words]
        assert any(each == pytest.approx(numbers(line), abs=0.11) for each in beside), line


def test_the_optima(folder: Path, plant: Make) -> None:
    """They converge, hold in co-simulation, and are on the page: one test, as they take half a minute."""
    (folder / "optima.py").write_text(OPTIMA)
    printed = run("python optima.py", folder)
    optima = json.loads((folder / "optima.json").read_text())
    assert set(optima["steps"]) == {"1500", "2500"}
    for engine_speed, found in optima["steps"].items():
        check_fastest_step(plant, engine_speed, found, 1e3 * optima["limits"][engine_speed])
    check_operating_points(plant, optima)
    *results, wrote = printed.splitlines(keepends=True)
    assert wrote == "wrote target/optimal_control.png\n"
    check_page("".join(results))


def test_gradient_cost(folder: Path) -> None:
    """The gradients agree; the times are for the page, which has the same rows."""
    exported = (TARGET / "ladder" / "fmu" / "fmi3" / "VanDerPol.fmu").resolve()
    assert exported.is_file(), f"{exported} is missing: bash tests/run rest exports it"
    printed = run(f"python {SCRIPTS}/gradient_cost.py {exported}", folder)
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in printed.splitlines() if line]
    errors = {name: float(cells[-1]) for name, *cells in rows if re.match(r"\d", cells[-1])}
    assert errors.pop("adjoint") < 1e-12
    # Of forward differences: the step is 1e-6; along the trajectory they cross kinks.
    assert errors.pop("finite differences") < 1e-2
    assert errors.pop("Jacobians, with those of the shaft") == 0
    assert len(errors) == 3
    assert all(error < 1e-5 for error in errors.values())
    for name, *_ in rows:
        assert f"\n| {name} |" in PAGE or name == "---"
