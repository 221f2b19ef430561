"""One of both FMUs is replaced by one of PythonFMU, from a source in examples/foreign/: both directions."""

from __future__ import annotations

from collections.abc import Callable
from math import exp
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, Make
from experiments import BOOST_STEPS, BOOST_STEPS_END, SAMPLE_TIME, Steps, couple, staircase
from master import Fmu, Instance, Record
from pythonfmu.builder import FmuBuilder

SOURCES = ROOT / "examples" / "foreign"

REFERENCE = staircase(*BOOST_STEPS)

LARGEST_STEP, SHORTEST_STEP = 20e3, 10.0
"""Of the reference (Pa), and how long it holds (s)."""

FIT = 6e3
"""How well the surrogate's static map fits the controller's (Pa)."""

COMMANDS = [("hp_wastegate_pwm", "wg_duty", 0.01), ("vacuum_pump", "pump_on", 1.0)]
MEASUREMENTS = [
    ("p_boost", "boost_pressure", 1e5),
    ("p_tank", "tank_pressure", 1e5),
    ("u_measured", "supply_voltage_measured", 1.0),
]
"""What goes where between our controller and the surrogate of a plant, and what it is times in between."""


@pytest.fixture
def foreign(tmp_path: Path, make: Callable[[Fmu], Instance]) -> Callable[[str, str], Instance]:
    """Builds an FMU from a source and makes an instance of it."""

    def build(source: str, name: str) -> Instance:
        built = FmuBuilder.build_FMU(SOURCES / source, dest=tmp_path, project_files=[SOURCES / "quantity.py"])
        assert Path(built).stem == name
        return make(Fmu(tmp_path / f"{name}.fmu", tmp_path / name))

    return build


def transfer(source: Instance, target: Instance, wires: list[tuple[str, str, float]]) -> None:
    """Carries values over, in the target's names and units."""
    target.set({to: source.get(name) * factor for name, to, factor in wires})


def test_controller_of_another_make_controls_our_plant(
    plant: Make, foreign: Callable[[str, str], Instance]
) -> None:
    """It has the plant's names and units: nothing but the file changes."""
    controller = foreign("pi_controller.py", "PiController")
    record = couple(plant(), controller, inputs={"boost_reference": REFERENCE}).run(BOOST_STEPS_END)
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    # The closed loop is slowest at 125 kPa, where a time constant of 1.04 s and a gain of -3210 Pa/% leave
    # it a pole at 0.42 1/s.
    assert max(steps.end_error) <= LARGEST_STEP * exp(-0.42 * SHORTEST_STEP)
    # What the paper reaches.
    assert max(steps.up) <= 5e3
    assert max(steps.down) <= 1e3
    # A pump that never runs loses the vacuum that moves the wastegate.
    assert set(record["vacuum_pump"]) == {0.0, 1.0}


def test_our_controller_controls_a_plant_of_another_make(
    controller: Make, foreign: Callable[[str, str], Instance]
) -> None:
    """It has other names, and bar and 1 for Pa and %."""
    ours, surrogate = controller().begin(), foreign("surrogate_plant.py", "SurrogatePlant").begin()
    transfer(ours, surrogate, COMMANDS)
    for instance in (ours, surrogate):
        instance.slave.exitInitializationMode()

    rows = [[0.0, surrogate.get("p_boost"), surrogate.get("p_tank")]]
    for step in range(round(BOOST_STEPS_END / SAMPLE_TIME)):
        time = step * SAMPLE_TIME
        ours.set({"boost_reference": REFERENCE(time)})
        transfer(surrogate, ours, MEASUREMENTS)
        ours.slave.doStep(time, SAMPLE_TIME)
        transfer(ours, surrogate, COMMANDS)
        surrogate.slave.doStep(time, SAMPLE_TIME)
        rows.append([time + SAMPLE_TIME, surrogate.get("p_boost"), surrogate.get("p_tank")])
    time, boost, tank = np.array(rows).T

    steps = Steps(Record(time=time, boost_pressure=boost * 1e5), BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    # Of a lag that the controller takes for another there remains what fades with the integral time: at most
    # 1.9 s, the largest time constant of the schedule up to 190 kPa.
    assert max(steps.end_error) <= LARGEST_STEP * exp(-SHORTEST_STEP / 1.9)
    # The feedforward goes first, and misses by what the surrogate's static map is off.
    assert max(steps.up + steps.down) <= FIT
    # The relay of the tank: as in its limits, passed by no more than in one step.
    assert tank.min() >= 0.3 - 0.0058 * SAMPLE_TIME
    assert tank.max() <= 0.35 + 0.001 * SAMPLE_TIME + 1e-9


def test_surrogate_is_fitted_to_the_maps(
    controller_fmu: Fmu, foreign: Callable[[str, str], Instance]
) -> None:
    """Where its static map is in use, at 1500 rpm: the third column."""

    def start(name: str, row: int) -> float:
        place = f"[{row}]" if name == "boost_reference" else f"[{row},3]"
        return float(controller_fmu.variables[f"schedule.{name}{place}"].start)

    surrogate = foreign("surrogate_plant.py", "SurrogatePlant")
    rows = [row for row in range(1, 17) if 125e3 <= start("boost_reference", row) <= 220e3]
    for row in rows:
        surrogate.start({"wg_duty": start("feedforward", row) / 100})
        assert surrogate.get("p_boost") * 1e5 == pytest.approx(start("boost_reference", row), abs=FIT)
        surrogate.slave.reset()
    time_constants = [start("time_constant", row) for row in rows]
    assert min(time_constants) < 1.5 < max(time_constants)
