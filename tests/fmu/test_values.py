"""What a value may be: what both FMUs answer to values that no model can work with."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from conftest import Make
from fmpy.fmi1 import FMICallException
from master import ERROR, Fmu, Instance

STEP = 1 / 80


def refused(instance: Instance, call: Callable[[], object], *words: str) -> None:
    """A call is an Error whose message names what is wrong."""
    before = len(instance.messages)
    with pytest.raises(FMICallException) as failure:
        call()
    assert failure.value.status == ERROR
    texts = [m.text for m in instance.messages[before:] if m.status == ERROR]
    assert len(texts) == 1
    for word in words:
        assert word in texts[0], f"{word} is not in: {texts[0]}"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("name", "variable"),
    [
        ("BoostPlant", "engine_speed"),
        ("BoostPlant", "tank.volume"),
        ("BoostController", "boost_reference"),
        ("BoostController", "lambda"),
    ],
)
def test_what_is_no_number_is_refused(
    make: Callable[[Fmu], Instance], fmus: dict[str, Fmu], name: str, variable: str, value: float
) -> None:
    instance = make(fmus[name]).begin()
    before = instance.get(variable)
    refused(instance, lambda: instance.set({variable: value}), variable)
    assert instance.get(variable) == before
    instance.slave.exitInitializationMode()
    instance.slave.doStep(0.0, STEP)


def test_nothing_of_a_refused_call_is_set(plant: Make) -> None:
    instance = plant()
    instance.start()
    references = instance.references(["throttle", "engine_speed"])
    refused(instance, lambda: instance.slave.setReal(references, [0.5, math.nan]), "engine_speed")
    assert instance.get("throttle") == 1.0


@pytest.mark.parametrize(
    ("name", "variable", "value"),
    [
        ("BoostPlant", "tank.volume", 2e4),
        ("BoostPlant", "valve.time_constant", 0.9e-3),
        ("BoostPlant", "supply_sensor.time_constant", 0.0),
        ("BoostPlant", "air.heat_capacity_ratio", 1.0),
        ("BoostPlant", "initialization.mode", 4),
        ("BoostController", "sample_time", 0.9e-3),
        ("BoostController", "lambda", 0.0),
        ("BoostController", "pwm_max", 101.0),
        ("BoostController", "mode", 0),
    ],
)
def test_parameter_outside_its_range_is_refused(
    make: Callable[[Fmu], Instance], fmus: dict[str, Fmu], name: str, variable: str, value: float
) -> None:
    instance = make(fmus[name])
    refused(instance, lambda: instance.set({variable: value}), variable)
    instance.begin()
    start = fmus[name].variables[variable].start
    assert instance.get(variable) == float(start)


def test_largest_tank_is_accepted(plant: Make) -> None:
    """A vessel that nothing empties, for experiments."""
    instance = plant()
    instance.start({"tank.volume": 1e4})
    instance.slave.doStep(0.0, STEP)


@pytest.mark.parametrize(
    ("name", "variable", "outside", "bound"),
    [
        ("BoostPlant", "hp_wastegate_pwm", 104.0, 100.0),
        ("BoostPlant", "engine_speed", -20.0, 0.0),
        ("BoostPlant", "ambient_pressure", 1.2e5, 1.1e5),
        ("BoostController", "engine_speed", 9000.0, 8000.0),
        ("BoostController", "supply_voltage_measured", -0.1, 0.0),
    ],
)
def test_input_outside_its_range_is_taken_as_the_bound(
    make: Callable[[Fmu], Instance],
    fmus: dict[str, Fmu],
    name: str,
    variable: str,
    outside: float,
    bound: float,
) -> None:
    """Sensors and solvers overshoot; one warning per input until it has returned."""
    fmu = fmus[name]
    inside = float(fmu.variables[variable].start)
    outputs = fmu.named("output")

    def run(value: float) -> tuple[Instance, list[float]]:
        instance = make(fmu)
        instance.start()
        results = []
        for index in range(4):
            instance.set({variable: value})
            instance.slave.doStep(index * STEP, STEP)
            results += list(instance.reals(outputs))
        return instance, results

    out, results = run(outside)
    assert results == run(bound)[1]
    assert [variable in text for text in out.warnings()] == [True]
    out.set({variable: inside})
    out.slave.doStep(4 * STEP, STEP)
    assert len(out.warnings()) == 1
    out.set({variable: outside})
    out.slave.doStep(5 * STEP, STEP)
    assert len(out.warnings()) == 2


CONTRADICTIONS = [
    ({"tank_pressure_on": 30000.0}, ["tank_pressure_on", "tank_pressure_off"]),
    ({"pwm_min": 75.0}, ["pwm_min", "pwm_max"]),
    ({"pwm_min": 80.0}, ["pwm_min", "pwm_max"]),
    (
        {"lp_wastegate_close_below": 3600.0},
        ["lp_wastegate_close_below", "lp_wastegate_open_above"],
    ),
    ({"schedule.gain[3,2]": 0.0}, ["schedule.gain[3,2]"]),
]


@pytest.mark.parametrize(("values", "names"), CONTRADICTIONS, ids=lambda v: str(v))
def test_contradictions_are_refused(controller: Make, values: dict[str, float], names: list[str]) -> None:
    """Masters set one at a time: refused at the end of initialization, tunable ones at the next step."""
    instance = controller().begin(values)
    refused(instance, instance.slave.exitInitializationMode, *names)

    instance = controller()
    instance.start()
    good = {name: instance.get(name) for name in values}
    instance.slave.doStep(0.0, STEP)
    instance.set(values)
    refused(instance, lambda: instance.slave.doStep(STEP, STEP), *names)
    # Nothing is broken: with the old values it goes on.
    instance.set(good)
    instance.slave.doStep(STEP, STEP)


@pytest.mark.parametrize("axis", ["engine_speed", "boost_reference"])
def test_grid_that_does_not_increase_is_refused(controller: Make, axis: str) -> None:
    instance = controller()
    same = float(instance.fmu.variables[f"schedule.{axis}[2]"].start)
    instance.begin({f"schedule.{axis}[3]": same})
    refused(instance, instance.slave.exitInitializationMode, f"schedule.{axis}[")


def test_friction_that_is_too_stiff_is_refused(plant: Make) -> None:
    """Above 2000 1/m; the default sits on the limit."""
    names = ["actuator.friction_stiffness", "actuator.coulomb_friction"]
    instance = plant().begin({"actuator.coulomb_friction": 0.19})
    refused(instance, instance.slave.exitInitializationMode, *names)
    softer = plant()
    softer.start({"actuator.coulomb_friction": 0.19, "actuator.friction_stiffness": 380.0})


def test_fixed_parameters_stay(plant: Make, controller: Make) -> None:
    for instance, name in [(plant(), "tank.volume"), (controller(), "sample_time")]:
        instance.start()
        refused(instance, lambda i=instance, n=name: i.set({n: i.get(n)}), name)


def test_outputs_cannot_be_set(plant: Make) -> None:
    instance = plant()
    refused(instance, lambda: instance.set({"boost_pressure": 1e5}), "boost_pressure")


@pytest.mark.parametrize("mode", ["boost", "open_loop", "position"])
@pytest.mark.parametrize("voltage", [0.0, 4.0, 8.0, 32.0])
def test_duty_stays_in_its_range(controller: Make, mode: str, voltage: float) -> None:
    """Compensation at low voltage cannot ask for more than 100 %."""
    instance = controller()
    values = {"mode": mode, "pwm_reference": 100.0, "wastegate_reference": 1.0}
    instance.start({**values, "supply_voltage_measured": voltage})
    duties = [instance.get("hp_wastegate_pwm")]
    for index in range(40):
        # Far too much boost: the wastegate is asked to open.
        instance.set({"boost_pressure": 200e3})
        instance.slave.doStep(index * STEP, STEP)
        duties.append(instance.get("hp_wastegate_pwm"))
    assert min(duties) >= 0.0
    assert max(duties) <= 100.0
    if voltage < 8.0:
        # In mode boost 75 % at 6 V (less is not believed) would be 150 %.
        assert max(duties) == 100.0


def test_derivatives_of_inputs(controller: Make, plant: Make) -> None:
    """Of continuous inputs only; zero is accepted for discrete ones."""
    instance = plant()
    instance.start()
    slave = instance.slave
    (duty,), (speed,) = instance.references(["hp_wastegate_pwm"]), instance.references(["engine_speed"])
    slave.setRealInputDerivatives([speed], [1], [100.0])
    slave.setRealInputDerivatives([duty], [1], [0.0])
    refused(instance, lambda: slave.setRealInputDerivatives([duty], [1], [1.0]), "hp_wastegate_pwm")
    refused(instance, lambda: slave.setRealInputDerivatives([speed], [0], [1.0]), "engine_speed")
    refused(instance, lambda: slave.setRealInputDerivatives([speed], [1], [math.nan]), "engine_speed")
    (output,) = instance.references(["boost_pressure"])
    refused(instance, lambda: slave.setRealInputDerivatives([output], [1], [1.0]), "boost_pressure")


def test_unknown_value_reference_is_refused(plant: Make) -> None:
    instance = plant()
    instance.start()
    refused(instance, lambda: instance.slave.getReal([10**6]), "1000000")
    integer = instance.references(["initialization.mode"])
    refused(instance, lambda: instance.slave.getReal(integer), "initialization.mode")
