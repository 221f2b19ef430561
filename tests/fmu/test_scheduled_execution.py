"""The controller in Scheduled Execution of FMI 3.0, by a scheduler after the standard's chapter 5, and the
plant of FMI 2.0: Fig. 13 as in co-simulation."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import c_int, c_uint32, c_uint64
from fractions import Fraction

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3ScheduledExecution
from fmpy.model_description import ModelDescription

from fmu import TARGET
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, ON_TOLERANCE, SAMPLE_TIME, couple, staircase
from fmu.master import Fmu, Instance, Make, Reals, Record

pytestmark = pytest.mark.quick

REFERENCE = staircase(*BOOST_STEPS)

Exported = tuple[ModelDescription, str]


@pytest.fixture(scope="module")
def controller_fmu3(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    """The FMU's description, and its folder."""
    path = TARGET / "scheduled" / "fmi3" / "BoostControllerScheduled.fmu"
    assert path.is_file(), f"{path} is missing: bash tests/run exports it"
    return read_model_description(path), extract(path, tmp_path_factory.mktemp("scheduled"))


class Scheduled:
    """An instance of the controller, whose tasks are its inputs, the model partition and its outputs."""

    def __init__(self, fmu: Exported) -> None:
        description, folder = fmu
        self.fmu = FMU3ScheduledExecution(
            instanceName="controller",
            guid=description.instantiationToken,
            modelIdentifier=description.scheduledExecution.modelIdentifier,
            unzipDirectory=folder,
        )
        self.fmu.instantiate()
        variables = description.modelVariables
        (self.clock,) = [v.valueReference for v in variables if v.type == "Clock"]
        self.references = {v.name: v.valueReference for v in variables if v.type == "Float64"}
        self.outputs = [v.name for v in variables if v.causality == "output" and v.type == "Float64"]
        self.inputs = [v.name for v in variables if v.causality == "input" and v.type == "Float64"]

    def get(self, names: list[str]) -> list[float]:
        """The values of variables."""
        return self.fmu.getFloat64([self.references[name] for name in names])

    def set(self, names: list[str], values: list[float]) -> None:
        """Sets inputs."""
        self.fmu.setFloat64([self.references[name] for name in names], values)

    def interval(self) -> Fraction:
        """The interval of the clock in s: without `intervalDecimal` the importer asks for it."""
        counters, resolutions, qualifiers = (c_uint64 * 1)(), (c_uint64 * 1)(), (c_int * 1)()
        self.fmu.getIntervalFraction((c_uint32 * 1)(self.clock), counters, resolutions, qualifiers)
        return Fraction(counters[0], resolutions[0])

    def activate(self, time: float) -> list[float]:
        """Computes the model partition: the outputs."""
        self.fmu.activateModelPartition(self.clock, time)
        return self.get(self.outputs)


@pytest.fixture
def scheduled(controller_fmu3: Exported) -> Iterator[Scheduled]:
    instance = Scheduled(controller_fmu3)
    yield instance
    instance.fmu.freeInstance()


def run(scheduled: Scheduled, plant: Instance, plant_steps: int) -> tuple[Record, np.ndarray, np.ndarray]:
    """Fig. 13 with the plant in so many steps between two ticks of the clock: the plant at the ticks, and
    inputs and outputs of the controller there."""
    of_plant, of_controller = set(plant.fmu.named("output")), set(plant.fmu.named("input"))
    measured = [name for name in scheduled.inputs if name in of_plant]
    commanded = [name for name in scheduled.outputs if name in of_controller]
    measurements, commands = Reals(plant, measured), Reals(plant, commanded)
    boost = Reals(plant, ["boost_pressure"])
    inputs = ["boost_reference", *measured]

    plant.begin()
    scheduled.fmu.enterInitializationMode(startTime=0.0)
    interval = scheduled.interval()
    assert interval == Fraction(1, 80)
    for _ in range(2):
        commands.set(scheduled.get(commanded))
        scheduled.set(inputs, [REFERENCE(0.0), *measurements.get()])
    scheduled.fmu.exitInitializationMode()
    plant.slave.exitInitializationMode()

    given, found, pressure = [], [], [boost.get()[0]]
    step = interval / plant_steps
    ticks = int(BOOST_STEPS_END / interval)
    for tick in range(ticks):
        time = float(tick * interval)
        given.append([REFERENCE(time), *measurements.get()])
        scheduled.set(inputs, given[-1])
        found.append(scheduled.activate(time))
        commands.set(scheduled.get(commanded))
        for number in range(plant_steps):
            plant.slave.doStep(float(tick * interval + number * step), float(step))
        pressure.append(boost.get()[0])
    times = np.array([float(tick * interval) for tick in range(ticks + 1)])
    return Record(time=times, boost_pressure=np.array(pressure)), np.array(given), np.array(found)


def test_figure_13_is_that_of_co_simulation(scheduled: Scheduled, plant: Make, controller: Make) -> None:
    record, _, _ = run(scheduled, plant(), 1)
    inputs = {"boost_reference": REFERENCE}
    expected = couple(plant(), controller(), inputs=inputs).run(BOOST_STEPS_END)
    assert np.ptp(expected["boost_pressure"]) > 1e4
    # Samples and the plant's steps are at the same times, with the same inputs: the same bits.
    assert np.array_equal(record["boost_pressure"], expected["boost_pressure"])


def test_the_controller_depends_on_its_inputs_at_the_ticks_alone(
    controller_fmu3: Exported, plant: Make, plant_fmu: Fmu
) -> None:
    """Whatever the plant's steps between two ticks are: fed with the same inputs, another instance computes
    the same bits; and the solver, whose error the steps change, leaves boost pressure where it was."""
    pressures = []
    for plant_steps in (1, 5):
        first, again = Scheduled(controller_fmu3), Scheduled(controller_fmu3)
        record, given, found = run(first, plant(), plant_steps)
        pressures.append(record["boost_pressure"])
        inputs = ["boost_reference", *(n for n in again.inputs if n in plant_fmu.named("output"))]
        again.set(inputs, list(given[0]))
        again.fmu.enterInitializationMode(startTime=0.0)
        again.set(inputs, list(given[0]))
        again.fmu.exitInitializationMode()
        for tick, (values, outputs) in enumerate(zip(given, found, strict=True)):
            again.set(inputs, list(values))
            assert again.activate(tick * SAMPLE_TIME) == list(outputs), f"at tick {tick}"
        for instance in (first, again):
            instance.fmu.freeInstance()
    difference = float(np.max(np.abs(pressures[1] - pressures[0])))
    print(f"\nthe plant's steps change boost pressure by at most {difference:.3g} Pa", end="")
    assert 0.0 < difference <= ON_TOLERANCE
