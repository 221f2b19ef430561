"""The experiments of the paper's figures: their starts, inputs and measures."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping

import numpy as np

from fmu import ROOT
from fmu.master import Instance, Master, Record, Signal, Value

SAMPLE_TIME = 1 / 80
"""The controller's (s)."""

ON_TOLERANCE = 20.0
"""The tolerance against the reference solver (Pa): 0.01 % of the full scale of boost pressure."""


SCENARIOS = ROOT / "boost" / "lab" / "scenarios"
"""The paper's experiments as the laboratory runs them, which define the inputs."""


def scenario(name: str) -> dict:
    """A scenario of the laboratory."""
    return tomllib.loads((SCENARIOS / f"{name}.toml").read_text())


def staircase(*points: tuple[float, float]) -> Signal:
    """A signal that holds each value from its time on."""
    times = np.array([time for time, _ in points])
    values = [value for _, value in points]
    # Communication points are computed as i * h, and may be early by rounding.
    return lambda time: values[max(int(np.searchsorted(times, time + 1e-9, "right")) - 1, 0)]


def couple(
    plant: Instance,
    controller: Instance,
    step: float = SAMPLE_TIME,
    *,
    plant_values: Mapping[str, Value] | None = None,
    controller_values: Mapping[str, Value] | None = None,
    **options,
) -> Master:
    """Both from the settled start, the controller first in each step (unless `at_once`)."""
    plant.begin(plant_values)
    controller.begin(controller_values)
    return Master([controller, plant], step, **options).initialize()


def run_in(plant: Instance, inputs: Mapping[str, float], values: Mapping[str, Value] | None = None) -> None:
    """The start of the paper's experiments: an engine that has run for 20 s with a frozen tank.

    The plant is at time 0 then, with its tank released.
    """
    start = {"initialization.mode": "running", "tank.frozen": True, **inputs, **(values or {})}
    plant.start(start, start_time=-20.0)
    Master([plant], SAMPLE_TIME, start_time=-20.0).run(0.0)
    plant.set({"tank.frozen": False})


def couple_running(
    plant: Instance,
    controller: Instance,
    controller_values: Mapping[str, Value] | None = None,
    plant_inputs: Mapping[str, float] | None = None,
    plant_values: Mapping[str, Value] | None = None,
    **options,
) -> Master:
    """Both at time 0, the plant run in with the controller's initial outputs."""
    # The controller's compensation needs the plant's supply, which is known.
    supply = (plant_inputs or {}).get("supply_voltage", 12.0)
    start = {"supply_voltage_measured": supply, **(controller_values or {})}
    controller.start(start)
    inputs = plant.fmu.named("input")
    initial = {name: controller.get(name) for name in controller.fmu.named("output") if name in inputs}
    run_in(plant, {**initial, **(plant_inputs or {})}, plant_values)
    return Master([controller, plant], SAMPLE_TIME, **options)


BOOST_STEPS = [
    (float(time), float(value)) for time, value in scenario("figure_13")["inputs"]["boost_reference"]["steps"]
]
"""The steps of the reference in the experiment of fig. 13."""

BOOST_STEPS_END = float(scenario("figure_13")["stop_time"])


def ssp_of_fmpy(plant: Instance, controller: Instance, *, only_reference: bool = False) -> Master:
    """The same as FMPy's SSP runs it: each FMU is initialized alone, zeros are passed in the first step, both
    step at once, and inputs of the system are a step late. The reference may be its only input."""
    for instance in (controller, plant):
        instance.start()
        hidden = OPERATING_POINT if only_reference else {}
        instance.set({name: 0.0 for name in instance.fmu.named("input") if name not in hidden})
        instance.slave.doStep(0.0, SAMPLE_TIME)
    reference = staircase(*BOOST_STEPS)
    inputs = {"boost_reference": lambda time: reference(time - SAMPLE_TIME)}
    if not only_reference:
        inputs |= constants(OPERATING_POINT)
    return Master([controller, plant], SAMPLE_TIME, start_time=SAMPLE_TIME, inputs=inputs, at_once=True)


OPERATING_POINT = {
    "engine_speed": 1500.0,
    "supply_voltage": 12.0,
    "throttle": 1.0,
    "ambient_pressure": 101325.0,
    "ambient_temperature": 298.0,
}
"""The inputs of a system whose master passes zeros instead of start values."""


def constants(values: Mapping[str, float]) -> dict[str, Signal]:
    """Constant signals."""
    return {name: lambda _, value=value: value for name, value in values.items()}


class Steps:
    """The response of boost pressure to the steps of its reference."""

    def __init__(self, record: Record, steps: list[tuple[float, float]], end: float) -> None:
        self.up: list[float] = []
        self.down: list[float] = []
        self.rise: list[float] = []
        self.end_error: list[float] = []
        ends = [time for time, _ in steps[2:]] + [end]
        for (_, before), (time, after), stop in zip(steps, steps[1:], ends, strict=False):
            part = record.between(time, stop)
            boost = part["boost_pressure"]
            if after > before:
                self.up.append(float(np.max(boost) - after))
            else:
                self.down.append(float(after - np.min(boost)))
            # The first sample within 10 % of the step.
            reached = np.abs(boost - after) <= 0.1 * abs(after - before)
            self.rise.append(float(part["time"][np.argmax(reached)] - time) if reached.any() else np.inf)
            self.end_error.append(float(abs(boost[-1] - after)))

    def summary(self) -> str:
        """For a test's output."""
        return (
            f"overshoot up {max(self.up):.0f} Pa, down {max(self.down):.0f} Pa, "
            f"rise {min(self.rise):.2f} to {max(self.rise):.2f} s, "
            f"error at the end {max(self.end_error):.1f} Pa"
        )


def deviation(record: Record, reference: float, after: float) -> float:
    """The largest deviation of boost pressure (Pa) after a time."""
    time = record["time"]
    return float(np.max(np.abs(record["boost_pressure"][time > after] - reference)))
