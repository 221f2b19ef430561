"""The template of two sampled controllers, each with a clock of its own, in both versions of FMI: against the
same controllers in a loop in Python."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from ctypes import c_double, c_int, c_uint32
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import groupby, pairwise
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi2 import fmi2CoSimulation
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.validation import validate_fmu

from fmu.exchange import Exchange
from fmu.exporter.importer import Instance, Status
from fmu.ladder import FMUS, exported

LOOPS = ["speed_loop", "current_loop"]
"""By priority."""
OUTPUTS = ["current_reference", "voltage"]
STOP = Fraction(3)

Samples = list[tuple[Fraction, list[str]]]


@dataclass
class Cascade:
    """The law, with the model's start values."""

    speed_period: float
    current_period: float
    of_speed: float = 0.0
    of_current: float = 0.0
    current_reference: float = 0.0
    voltage: float = 0.0

    def sample(self, loops: list[str], inputs: dict[str, float]) -> list[float]:
        if "speed_loop" in loops:
            proportional = 0.5 * (inputs["speed_reference"] - inputs["speed"])
            self.current_reference = self.of_speed + proportional
            self.of_speed += proportional * self.speed_period / 0.1
        if "current_loop" in loops:
            proportional = 2.0 * (self.current_reference - inputs["current"])
            self.voltage = self.of_current + proportional
            self.of_current += proportional * self.current_period / 0.01
        return [self.current_reference, self.voltage]


def inputs_at(time: Fraction) -> dict[str, float]:
    speed, current = math.sin(3.0 * time), math.sin(7.0 * time)
    return {"speed_reference": 1.0, "speed": speed, "current": current}


@pytest.fixture(
    params=["0.01 0.001", "0.3 0.1", "0.1 0.3", "0.07 0.03"], ids=lambda text: text.replace(" ", "-")
)
def periods(request: pytest.FixtureRequest) -> dict[str, float]:
    """Multiples, so that all samples of one clock coincide with those of the other, whose times are rounded
    otherwise (3 x 0.1 is not 0.3); the fast one of a lower and of a higher priority; and no multiples."""
    return dict(zip(["speed_period", "current_period"], map(float, request.param.split()), strict=True))


@pytest.fixture
def samples(periods: dict[str, float]) -> Samples:
    """The times, and which clocks tick at each."""
    ticks = []
    for loop, period in zip(LOOPS, periods.values(), strict=True):
        exact = Fraction(str(period))
        ticks += [(number * exact, loop) for number in range(math.ceil(STOP / exact))]
    return [
        (time, [loop for _, loop in at_once])
        for time, at_once in groupby(sorted(ticks, key=lambda tick: tick[0]), key=lambda tick: tick[0])
    ]


@pytest.mark.quick
@pytest.mark.parametrize("step", ["0.01", "0.04", "1"])
def test_co_simulation_of_fmi_2(
    instance: Callable[..., Instance], periods: dict[str, float], samples: Samples, step: str
) -> None:
    """Samples within a step have its inputs; those at its end belong to the next one."""
    fmu, cascade, size = instance("Cascade", fmi2CoSimulation, periods), Cascade(**periods), Fraction(step)
    expected = [0.0, 0.0]
    for number in range(int(STOP / size)):
        start = number * size
        inputs = inputs_at(start)
        for _, loops in (sample for sample in samples if start <= sample[0] < start + size):
            expected = cascade.sample(loops, inputs)
        fmu.ok(*fmu.settings(inputs))
        assert fmu.step(float(start), float(size)) == Status.OK
        assert [fmu.get(name) for name in OUTPUTS] == expected, float(start)


@pytest.mark.quick
def test_model_exchange_of_fmi_2(
    exchange: Callable[..., Exchange], periods: dict[str, float], samples: Samples
) -> None:
    """All samples of one time are one event."""
    fmu, cascade = exchange("Cascade", periods | inputs_at(Fraction(0)), 0.0), Cascade(**periods)
    for (time, loops), (after, _) in pairwise(samples):
        inputs = inputs_at(time)
        if time:
            assert fmu.next_event == pytest.approx(float(time), rel=1e-15)
            fmu.advance(fmu.next_event)
            fmu.event(partial(fmu.set, inputs))
        assert [fmu.get(name) for name in OUTPUTS] == cascade.sample(loops, inputs), float(time)
        assert fmu.next_event == pytest.approx(float(after), rel=1e-15)


@pytest.fixture(params=[FMU3Slave, FMU3Model])
def fmu3(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FMU3Slave | FMU3Model]:
    path = exported("Cascade", FMUS / "fmi3")
    assert validate_fmu(path) == []
    fmu = request.param(
        guid=fmpy.read_model_description(path).guid,
        modelIdentifier="Cascade",
        unzipDirectory=fmpy.extract(path, tmp_path),
    )
    fmu.instantiate(**{"eventModeUsed": True} if request.param is FMU3Slave else {})
    yield fmu
    fmu.freeInstance()


@pytest.mark.fmi3
def test_time_based_clocks_of_fmi_3(
    fmu3: FMU3Slave | FMU3Model, periods: dict[str, float], samples: Samples
) -> None:
    """The importer ticks the clocks at the intervals that they have."""
    description = fmpy.read_model_description(exported("Cascade", FMUS / "fmi3"))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}

    def set_values(values: dict[str, float]) -> None:
        fmu3.setFloat64([references[name] for name in values], list(values.values()))

    cascade = Cascade(**periods)
    fmu3.enterInitializationMode()
    set_values(periods)
    intervals, qualifiers = (c_double * 2)(), (c_int * 2)()
    fmu3.getIntervalDecimal((c_uint32 * 2)(*(references[loop] for loop in LOOPS)), intervals, qualifiers)
    assert list(intervals) == list(periods.values())
    fmu3.exitInitializationMode()
    for (time, loops), (after, _) in pairwise(samples):
        set_values(inputs_at(time))
        fmu3.setClock([references[loop] for loop in loops], [True] * len(loops))
        *_, has_time_event, _ = fmu3.updateDiscreteStates()
        assert not has_time_event
        found = fmu3.getFloat64([references[name] for name in OUTPUTS])
        assert found == cascade.sample(loops, inputs_at(time)), float(time)
        if isinstance(fmu3, FMU3Slave):
            fmu3.enterStepMode()
            has_event, *_ = fmu3.doStep(float(time), float(after - time))
            assert not has_event
        else:
            fmu3.enterContinuousTimeMode()
            fmu3.setTime(float(after))
        fmu3.enterEventMode()
