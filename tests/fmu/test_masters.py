"""Masters that nobody here wrote couple both FMUs, as the scripts of examples/masters/ have them do it.

Each gets, to the last bit, what the tests' own master gets that steps in the same order: the FMUs depend on
what is handed over alone.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, Make
from experiments import (
    BOOST_STEPS,
    BOOST_STEPS_END,
    ON_TOLERANCE,
    SAMPLE_TIME,
    Steps,
    couple,
    staircase,
)
from master import Instance, Master, Record

INPUTS = {"boost_reference": staircase(*BOOST_STEPS)}

Start = Callable[[Instance, Instance], Master]


def controller_first(plant: Instance, controller: Instance) -> Master:
    return couple(plant, controller, inputs=INPUTS)


def both_at_once(plant: Instance, controller: Instance) -> Master:
    return couple(plant, controller, inputs=INPUTS, at_once=True)


def both_at_once_in_nanoseconds(plant: Instance, controller: Instance) -> Master:
    """libcosim counts time in whole nanoseconds: sizes of steps differ in their last bits."""
    nanoseconds = round(SAMPLE_TIME * 1e9)
    return couple(
        plant, controller, inputs=INPUTS, at_once=True, clock=lambda count: count * nanoseconds / 1e9
    )


def controller_first_unmeasured(plant: Instance, controller: Instance) -> Master:
    """A container cuts the loop before its first FMU, and initializes this with zeros instead."""
    plant.begin()
    controller.begin()
    master = Master([controller, plant], SAMPLE_TIME, inputs=INPUTS)
    (measured,), (commanded,) = master.wires[controller], master.wires[plant]
    measured.target.set(np.zeros(len(measured.names)))
    commanded.transfer()
    for instance in (controller, plant):
        instance.slave.exitInitializationMode()
    return master


def both_at_once_from_zeros(plant: Instance, controller: Instance) -> Master:
    """FMPy's SSP initializes each FMU alone, and hands over zeros in the first step; what the system takes
    comes a step late."""
    for instance in (controller, plant):
        instance.start()
        inputs = set(instance.fmu.named("input")) - {"ambient_pressure", "ambient_temperature"}
        instance.set(dict.fromkeys(inputs, 0.0))
        instance.slave.doStep(0.0, SAMPLE_TIME)
    inputs = {
        "boost_reference": lambda time: INPUTS["boost_reference"](time - SAMPLE_TIME),
        "engine_speed": lambda time: 1500.0,
        "supply_voltage": lambda time: 12.0,
        "throttle": lambda time: 1.0,
    }
    return Master([controller, plant], SAMPLE_TIME, start_time=SAMPLE_TIME, inputs=inputs, at_once=True)


ORDERS: dict[str, Start] = {
    "with_ecos": both_at_once,
    "with_fmpy_ssp": both_at_once_from_zeros,
    "with_libcosim": both_at_once_in_nanoseconds,
    "with_pathsim": controller_first,
    "in_container": controller_first_unmeasured,
}
"""How each master starts and steps both FMUs, by its script."""

RUN = """
import json, os, runpy, sys
script, rows = sys.argv[1:]
sys.path.insert(0, os.path.dirname(script))
with open(rows, "w") as file:
    json.dump(runpy.run_path(script)["rows"], file)
"""
"""Runs a script and writes its `rows`: boost pressure and duty that each step reached."""


@pytest.fixture
def clone(exported: Path, tmp_path: Path) -> Path:
    """What the scripts meet in the folder of the repository, and a place to write to."""
    fmus = tmp_path / "target" / "fmu"
    fmus.mkdir(parents=True)
    for name in ("BoostController.fmu", "BoostPlant.fmu", "Boost.ssp"):
        (fmus / name).symlink_to(exported / name)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    return tmp_path


def run(command: list[str | Path], folder: Path) -> str:
    # For Ecos, whose library needs that of the package tbb.
    libraries = {"LD_LIBRARY_PATH": f"{sys.prefix}/lib"}
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, **libraries}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build_container(folder: Path) -> None:
    (folder / "target" / "fmu" / "boost.csv").write_bytes((ROOT / "examples/masters/boost.csv").read_bytes())
    fmucontainer = Path(sys.executable).parent / "fmucontainer"
    options = "-container boost.csv:0.0125 -fmu-directory target/fmu -sequential"
    run([fmucontainer, *options.split()], folder)


@pytest.mark.parametrize("script", ORDERS)
def test_every_number_is_the_own_masters(clone: Path, plant: Make, controller: Make, script: str) -> None:
    """Fig. 13: boost pressure and duty after each step, compared as 64-bit patterns."""
    if script == "in_container":
        build_container(clone)
    command = [sys.executable, "-c", RUN, f"examples/masters/{script}.py", "rows.json"]
    report = run(command, clone).splitlines()[-1]
    table = np.array(json.loads((clone / "rows.json").read_text()))

    record = ORDERS[script](plant(), controller()).run(BOOST_STEPS_END)
    reached = record["time"] > 0
    expected = np.stack([record["boost_pressure"], record["hp_wastegate_pwm"]], axis=1)[reached]
    assert table.shape == expected.shape == (124 * 80, 2)
    different = table.view(np.uint64) != expected.view(np.uint64)
    assert not different.any(), f"first in step {np.argmax(different.any(axis=1))}"

    # What the script says of itself: the reference solution's overshoot in this order.
    boost = Record(time=record["time"][reached], boost_pressure=table[:, 0])
    steps = Steps(boost, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    up, down, end = (float(number) for number in re.findall(r"\d+\.\d+", report))
    assert max(steps.up) == pytest.approx(up * 1e3, abs=5)
    assert max(steps.down) == pytest.approx(down * 1e3, abs=5)
    assert end == 125.00
    reference = 560 if "at_once" in ORDERS[script].__name__ else 530
    assert max(steps.up) <= reference + ON_TOLERANCE
    assert max(steps.end_error) <= 2 + ON_TOLERANCE
