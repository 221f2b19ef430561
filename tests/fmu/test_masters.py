"""Independent masters couple both FMUs as docs/masters.md and examples/masters/ say.

Each has the results of the tests' master with the same order of steps, to the last bit.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from fmu import ROOT, Run, documents
from fmu.documents import run
from fmu.experiments import (
    BOOST_STEPS,
    BOOST_STEPS_END,
    ON_TOLERANCE,
    SAMPLE_TIME,
    Steps,
    couple,
    ssp_of_fmpy,
    staircase,
)
from fmu.master import Instance, Make, Master, Record

PAGE = (ROOT / "docs" / "masters.md").read_text()

LINES = documents.lines(PAGE)

# For Ecos, as the page says: there is no VIRTUAL_ENV where nobody activated it.
LIBRARIES = {"LD_LIBRARY_PATH": f"{sys.prefix}/lib"}

INPUTS = {"boost_reference": staircase(*BOOST_STEPS)}

Start = Callable[[Instance, Instance], Master]


def both_at_once(plant: Instance, controller: Instance) -> Master:
    return couple(plant, controller, inputs=INPUTS, at_once=True)


def both_at_once_in_nanoseconds(plant: Instance, controller: Instance) -> Master:
    """libcosim counts time in integer nanoseconds, so that step sizes differ in their last bits."""
    nanoseconds = round(SAMPLE_TIME * 1e9)
    return couple(
        plant, controller, inputs=INPUTS, at_once=True, clock=lambda count: count * nanoseconds / 1e9
    )


ORDERS: dict[str, tuple[str, Start]] = {
    "with_ecos": ("Ecos", both_at_once),
    "with_fmpy_ssp": ("SSP in FMPy", ssp_of_fmpy),
    "with_libcosim": ("libcosim", both_at_once_in_nanoseconds),
}
"""For each script the master's name on the page, and its start and order of steps."""


def test_equal_numbers_need_equal_tolerances(plant: Make, controller: Make) -> None:
    """As the page says: none, 0 and a tolerance not below the plant's parameter are equivalent; 1e-6 changes
    boost pressure by up to 2 Pa."""

    def boost_pressure(tolerance: float | None) -> np.ndarray:
        instances = [controller().begin(tolerance=tolerance), plant().begin(tolerance=tolerance)]
        master = Master(instances, SAMPLE_TIME, inputs=INPUTS).initialize()
        return master.run(BOOST_STEPS_END)["boost_pressure"]

    without = boost_pressure(None)
    for tolerance in (0.0, 1e-2):
        assert np.array_equal(boost_pressure(tolerance), without)
    shift = np.max(np.abs(boost_pressure(1e-6) - without))
    print(f"boost pressure shifts by {shift:.2f} Pa")
    assert 0 < shift <= 2


RUN = """
import json, os, runpy, sys
script, rows = sys.argv[1:]
sys.path.insert(0, os.path.dirname(script))
with open(rows, "w") as file:
    json.dump(runpy.run_path(script)["rows"], file)
"""
"""Runs a script and writes its `rows`: boost pressure and duty after each step."""


@pytest.fixture
def clone(exported: Path, tmp_path: Path) -> Path:
    return documents.clone(exported, tmp_path)


def test_every_line_is_run() -> None:
    """Here for masters, and in test_readme.py, test_foreign.py and test_optimal_control.py."""
    pinned = (ROOT / "tests" / "fmu" / "requirements.in").read_text()
    scripts = []
    for line in LINES:
        match line.split():
            case ["pip", "install", *packages]:
                assert all(re.search(rf"^{package}(\[|$)", pinned, re.MULTILINE) for package in packages)
            case ["python", script, *_] if script.startswith("examples/optimal_control/"):
                pass
            case ["python", script]:
                scripts.append(Path(script).stem)
            case ["export", variable]:
                assert variable == "LD_LIBRARY_PATH=$VIRTUAL_ENV/lib"
            case ["fmpy" | "pythonfmu" | "cargo", *_]:
                pass
            case _:
                pytest.fail(f"not tried: {line}")
    assert sorted(scripts) == sorted(ORDERS)


def test_shown_code_is_the_scripts() -> None:
    examples = ROOT / "examples"
    scripts = [path.read_text() for path in [*examples.glob("*.py"), *examples.glob("*/*.py")]]
    shown = documents.blocks(PAGE, "python")
    assert len(shown) >= 4
    for block in shown:
        assert any(block in script for script in scripts), block


def test_loop_in_python(clone: Path) -> None:
    """The page's first Python block runs by itself."""
    loop = documents.blocks(PAGE, "python")[0]
    assert "doStep" in loop
    (clone / "loop.py").write_text(loop)
    assert run("python loop.py", clone) == "boost pressure 125.00 kPa, reference 125.00 kPa\n"


@pytest.mark.parametrize("script", ORDERS)
def test_every_number_equals_that_of_the_tests_master(
    clone: Path, plant: Make, controller: Make, script: str
) -> None:
    """Fig. 13: boost pressure and duty after each step, compared as 64-bit patterns."""
    master, start = ORDERS[script]
    (clone / "run.py").write_text(RUN)
    path = f"examples/masters/{script}.py"
    report = run(f"python run.py {path} rows.json", clone, **LIBRARIES).splitlines()[-1]
    table = np.array(json.loads((clone / "rows.json").read_text()))

    record = start(plant(), controller()).run(BOOST_STEPS_END)
    reached = record["time"] > 0
    expected = np.stack([record["boost_pressure"], record["hp_wastegate_pwm"]], axis=1)[reached]
    assert table.shape == expected.shape == (124 * 80, 2)
    different = table.view(np.uint64) != expected.view(np.uint64)
    assert not different.any(), f"first in step {np.argmax(different.any(axis=1))}"

    steps = Steps(
        Record(time=record["time"][reached], boost_pressure=table[:, 0]), BOOST_STEPS, BOOST_STEPS_END
    )
    print(steps.summary())
    # The reference solution's with this order.
    assert max(steps.up) <= 560 + ON_TOLERANCE
    assert max(steps.end_error) <= 2 + ON_TOLERANCE
    # The script's output, also on the page.
    up, down = f"{max(steps.up) / 1e3:.2f}", f"{max(steps.down) / 1e3:.2f}"
    assert report == f"overshoot {up} kPa up, {down} kPa down; at the end 125.00 kPa"
    assert f"python {path}\n```\n\n```text\n{report}\n```" in PAGE
    assert re.search(rf"^\| \[{master}\]\(.*\| {up}, {down} kPa \|$", PAGE, re.MULTILINE)


def test_a_system_of_one_input_needs_no_other_in_fmpy(
    boost_fmu: Run, exported: Path, tmp_path: Path, plant: Make, controller: Make
) -> None:
    """FMPy sets each input that it is shown to zero."""
    fmus = ["--plant", exported / "BoostPlant.fmu", "--controller", exported / "BoostController.fmu"]
    done = boost_fmu("ssp", *fmus, "--inputs", "boost_reference", "--out", "one.ssp", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    end = 40.0
    result = simulate_ssp(str(tmp_path / "one.ssp"), stop_time=end, step_size=SAMPLE_TIME, input=INPUTS)
    record = ssp_of_fmpy(plant(), controller(), only_reference=True).run(end)
    reached = record["time"] > 0
    for name in ("boost_pressure", "hp_wastegate_pwm"):
        assert np.array_equal(result[name].view(np.uint64), record[name][reached].view(np.uint64)), name
    # It is the reference that the plant follows, with the engine running from the first step.
    reference = INPUTS["boost_reference"](end - 2 * SAMPLE_TIME)
    assert abs(result["boost_pressure"][-1] - reference) < 500
