"""The plant's recorded experiment of tests/data/plant_trace.csv in Model Exchange, solved by FMPy's CVode.

    PYTHONPATH=tests python -m fmu.recorded FMU

prints errors and cost, also with the solver stopped at kinks of the equations: docs/integration.md.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmu import ROOT
from fmu.exchange import Exchange
from fmu.master import Fmu, Instance, Reals

STEP = 1 / 80

STATES = {
    "tank.pressure": 3.5e4,
    "actuator.chamber_pressure": 1e5,
    "actuator.position": 1e-2,
    "actuator.velocity": 0.1,
    "actuator.friction_force": 0.2,
    "valve.plunger_duty": 100.0,
    "air_filter.pressure": 1e5,
    "lp_compressor.outlet_pressure": 2e5,
    "hp_compressor.outlet_pressure": 2e5,
    "intercooler.outlet_pressure": 2e5,
    "intake_manifold.pressure": 2e5,
    "exhaust_manifold.pressure": 2e5,
    "interstage_exhaust.pressure": 1.5e5,
    "exhaust.pressure": 1e5,
    "hp_shaft.speed": 2e4,
    "lp_shaft.speed": 1e4,
}
"""The recorded states with their full scales."""

OUTPUTS = {
    "boost_pressure": 2e5,
    "hp_wastegate_position": 1.0,
    "actuator_pressure": 1e5,
    "tank_pressure": 3.5e4,
    "engine_torque": 400.0,
    "air_mass_flow": 0.2,
    "hp_turbo_speed": 2e5,
    "lp_turbo_speed": 1e5,
    "exhaust_manifold_pressure": 2e5,
    "interstage_exhaust_pressure": 1.5e5,
    "exhaust_temperature": 1200.0,
    "charge_temperature": 1200.0,
    "hp_compressor.mass_flow": 0.2,
    "lp_compressor.mass_flow": 0.2,
    "hp_wastegate_port.mass_flow": 0.2,
    "valve.pressure": 1e5,
    "hp_compressor.outlet_temperature": 1200.0,
    "lp_turbine.mass_flow": 0.2,
    "hp_turbine.mass_flow": 0.2,
    "cylinders.volumetric_efficiency": 1.0,
}
"""The recorded outputs and locals with their full scales."""

INPUTS = [
    "hp_wastegate_pwm",
    "supply_voltage",
    "vacuum_pump",
    "engine_speed",
    "throttle",
    "lp_wastegate",
    "hp_bypass",
    "surge_valve",
    "ambient_pressure",
    "ambient_temperature",
]
"""The recorded inputs, which are held over each interval."""


class Recording(NamedTuple):
    """The experiment, a row for each interval."""

    start: np.ndarray
    """The states at time 0."""
    inputs: np.ndarray
    states_and_outputs: np.ndarray
    """At the end of the interval."""

    @classmethod
    def read(cls, file: Path = ROOT / "tests" / "data" / "plant_trace.csv") -> Recording:
        """From the file of the tests."""
        first, _, *lines = file.read_text().splitlines()
        rows = np.array([[float(word) for word in line.split(",")] for line in lines if line])
        inputs, values = rows[:, 1:11], rows[:, 11:]
        # In percent there.
        values[:, len(STATES) + list(OUTPUTS).index("hp_wastegate_position")] /= 100.0
        return cls(np.array(first.split(":")[1].split(), float), inputs, values)

    def begin(self, plant: Instance) -> None:
        """Initializes the plant with the recorded start."""
        start = dict(zip(STATES, self.start, strict=True))
        voltage = {"supply_sensor.voltage": self.inputs[0][INPUTS.index("supply_voltage")]}
        plant.begin({"initialization.mode": "given", **start, **voltage})
        Reals(plant, INPUTS).set(self.inputs[0])
        plant.slave.exitInitializationMode()


class Result(NamedTuple):
    """What a run has shown: the largest errors relative to full scale, and what it took."""

    errors: dict[str, float]
    processor_time: float
    calls: dict[str, int]

    def of_others(self) -> float:
        """The largest error but those of the rod's speed and friction, which are fast and small."""
        return max(
            e
            for name, e in self.errors.items()
            if name not in ("actuator.velocity", "actuator.friction_force")
        )

    def __str__(self) -> str:
        errors = [self.errors["actuator.velocity"], self.errors["actuator.friction_force"], self.of_others()]
        return " | ".join([*(f"{100 * error:.4f}" for error in errors), *map(str, self.calls.values())])


def run(plant: Instance, recording: Recording, advance: Callable[[bool, np.ndarray, float], None]) -> Result:
    """Runs the experiment: `advance` is called with whether inputs have changed, the inputs, and the end of
    the interval."""
    scales = np.array([*STATES.values(), *OUTPUTS.values()])
    values = Reals(plant, [*STATES, *OUTPUTS])
    largest = np.zeros(len(scales))
    begin = time.process_time()
    previous = recording.inputs[0]
    for number, (inputs, expected) in enumerate(
        zip(recording.inputs, recording.states_and_outputs, strict=True), 1
    ):
        advance(bool((inputs != previous).any()), inputs, number * STEP)
        previous = inputs
        largest = np.maximum(largest, np.abs(values.get() - expected) / scales)
    took = time.process_time() - begin
    errors = dict(zip([*STATES, *OUTPUTS], map(float, largest), strict=True))
    return Result(errors, took, dict(getattr(plant, "calls", {})))


def in_model_exchange(plant: Exchange, recording: Recording) -> Result:
    """Solved by CVode, with an event wherever an input changes."""
    recording.begin(plant)
    plant.go()
    inputs = Reals(plant, INPUTS)

    def advance(has_changed: bool, values: np.ndarray, end: float) -> None:
        if has_changed:
            plant.event(lambda: inputs.set(values))
        plant.advance(end)

    return run(plant, recording, advance)


def in_co_simulation(plant: Instance, recording: Recording) -> Result:
    """Solved by the FMU itself."""
    recording.begin(plant)
    inputs = Reals(plant, INPUTS)

    def advance(has_changed: bool, values: np.ndarray, end: float) -> None:
        if has_changed:
            inputs.set(values)
        plant.slave.doStep(end - STEP, STEP)

    return run(plant, recording, advance)


KINKS: dict[str, Callable[[dict[str, float]], list[float]]] = {
    "none": lambda v: [],
    "rod reversal (friction)": lambda v: [v["actuator.velocity"] / 0.1],
    "rod stops": lambda v: [v["actuator.position"] / v["actuator.stroke"] - end for end in (0.0, 1.0)],
    "valve port switching": lambda v: [v["valve.opening"]],
    "all": lambda v: [residual for kink in list(KINKS.values())[1:4] for residual in kink(v)],
}
"""Residuals that change their signs at kinks, by what has them."""


class Stopping(Exchange):
    """A plant whose solver stops at kinks, which the FMU does not declare as events."""

    def __init__(
        self, fmu: Fmu, tolerance: float, residuals: Callable[[dict[str, float]], list[float]]
    ) -> None:
        super().__init__(fmu, tolerance)
        names = ["actuator.velocity", "actuator.position", "actuator.stroke", "valve.opening"]
        read = Reals(self, names)
        self.residuals = lambda: residuals(dict(zip(names, read.get(), strict=True)))

    def go(self) -> Exchange:
        self.indicators = len(self.residuals())
        return super().go()

    def get_indicators(self, values: Any, count: int) -> None:
        for index, residual in enumerate(self.residuals()):
            values[index] = residual


def main() -> None:
    """Prints the table."""
    recording = Recording.read()
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(Path(sys.argv[1]), Path(folder))
        print("| tolerance | stops at | rod speed | friction | all others | derivatives | events | roots |")
        print("|---|---|---|---|---|---|---|---|")
        for tolerance in (1e-6, 1e-8):
            for name, residuals in KINKS.items():
                result = in_model_exchange(Stopping(fmu, tolerance, residuals), recording)
                print(f"| {tolerance:g} | {name} | {result} |")


if __name__ == "__main__":
    main()
