"""What is each FMU's own, in FMPy: ranges, late starts, messages and derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double, c_int

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from fmu.master import ERROR, Fmu, Instance, Make, Reals

pytestmark = pytest.mark.quick

STEP = 1 / 80

BOTH = pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])

New = Callable[[Fmu], Instance]


def drive(instance: Instance, begin: int, end: int, start_time: float = 0.0) -> np.ndarray:
    """Steps with changing inputs; all outputs after each step."""
    inputs = Reals(instance, ["engine_speed"])
    outputs = Reals(instance, instance.fmu.named("output"))
    result = []
    for index in range(begin, end):
        inputs.set([1500.0 + 400.0 * math.sin(0.1 * index)])
        instance.slave.doStep(start_time + index * STEP, STEP)
        result.append(outputs.get().copy())
    return np.array(result)


def refusal(instance: Instance, call: Callable, *arguments) -> str:
    """The message of a call that is an Error."""
    before = len(instance.messages)
    with pytest.raises(FMICallException):
        call(*arguments)
    (message,) = instance.messages[before:]
    assert message.status == ERROR
    return message.text


@BOTH
def test_every_parameter_has_a_range(fmus: dict[str, Fmu], name: str) -> None:
    parameters = [v for v in fmus[name].variables.values() if v.causality == "parameter"]
    numbers = [v for v in parameters if v.type not in ("Boolean", "Enumeration")]
    assert {v.type for v in numbers} <= {"Real", "Integer"}
    assert [v.name for v in numbers if None in (v.min, v.max)] == []


@BOTH
@pytest.mark.parametrize("start_time", [1e6, -1e6, 1e9])
def test_a_late_start(make: New, fmus: dict[str, Fmu], name: str, start_time: float) -> None:
    """Neither model depends on time itself. At 1e9 s a step of 1/80 s is 100,000 units in the last place."""
    early, late = make(fmus[name]).start(), make(fmus[name]).start(start_time=start_time)
    assert (drive(late, 0, 20, start_time) == drive(early, 0, 20)).all()


def test_the_plant_reports_what_it_cannot_compute(plant: Make) -> None:
    """A failed step, at a jump of friction with a tolerance that no step meets, names a state and the time;
    impossible start values are reported with the variable that is not finite."""
    instance = plant()
    instance.start({"solver.relative_tolerance": 1e-8, "actuator.friction_exponent": 0.0})
    instance.slave.doStep(0.0, STEP)
    instance.set({"ambient_pressure": 5e4})
    text = refusal(instance, instance.slave.doStep, STEP, STEP)
    assert any(f" {state} " in text for state in instance.fmu.states()), text
    assert "0.01" in text or "0.02" in text, text
    assert "error" in refusal(instance, instance.slave.doStep, STEP, STEP)

    instance = plant()
    instance.begin({"initialization.mode": "given", "hp_shaft.speed": 1e200, "actuator.velocity": 1e200})
    assert "der(lp_compressor.outlet_pressure)" in refusal(instance, instance.slave.exitInitializationMode)
    instance.set({"initialization.mode": "settled"})
    instance.slave.exitInitializationMode()
    # A warning says that the start values are not used.
    assert "actuator.velocity, hp_shaft.speed" in instance.warnings()[-1]


def test_the_largest_tank(plant: Make) -> None:
    plant().start({"tank.volume": 1e4}).slave.doStep(0.0, STEP)


def test_derivatives(plant: Make, controller: Make) -> None:
    """The plant's are those of its outputs over time, with a moving input; the controller, whose outputs
    change at samples, has none."""
    plant, controller = plant().start(), controller().start()
    simulation = {i: i.fmu.description.coSimulation for i in (plant, controller)}
    assert simulation[plant].providesDirectionalDerivative
    assert simulation[plant].maxOutputDerivativeOrder == 1
    assert not simulation[controller].providesDirectionalDerivative
    assert simulation[controller].maxOutputDerivativeOrder == 0

    def derivative(instance: Instance, output: str) -> float:
        result, reference = (c_double * 1)(), instance.fmu.references(output)
        slave = instance.slave
        slave.fmi2GetRealOutputDerivatives(slave.component, reference, 1, (c_int * 1)(1), result)
        return result[0]

    width, speed = 2e-4, Reals(plant, ["engine_speed"])
    values, time = [], 0.0
    for size in [0.5, width, width]:
        speed.set([1500.0 + 400.0 * time])
        speed.set_derivatives([400.0])
        plant.slave.doStep(time, size)
        time += size
        values.append(plant.get("engine_torque"))
        if len(values) == 2:
            found = derivative(plant, "engine_torque")
    # The solver's tolerance within a step, and the third derivative of the fastest modes (1e3 1/s).
    expected = (values[2] - values[0]) / (2 * width)
    assert found == pytest.approx(expected, rel=1e-2, abs=1e-7 * values[1] / width)
    assert expected != 0
    text = refusal(controller, derivative, controller, "hp_wastegate_pwm")
    assert "maxOutputDerivativeOrder is 0" in text
