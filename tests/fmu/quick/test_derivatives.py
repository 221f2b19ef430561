"""fmi2GetDirectionalDerivative and fmi2GetRealOutputDerivatives, against what the FMU itself does when inputs
and parameters are moved a little, and when a little time passes (FMI 2.0.5, sections 2.1.9 and 4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from ctypes import c_double, c_int, c_uint

import numpy as np
import pytest
from c_interface import Library, Status
from master import Fmu
from named import Named

STEP = 1 / 80

INPUTS = {"engine_speed": 1800.0, "throttle": 0.6, "supply_voltage": 11.5, "ambient_temperature": 290.0}
"""Somewhere that is not at rest."""


@pytest.fixture
def plant(fmus: dict[str, Fmu], libraries: dict[str, Library]) -> Iterator[Callable[..., Named]]:
    """Makes plants whose variables go by their names, and frees them in the end."""
    made: list[Named] = []

    def make(name: str = "BoostPlant") -> Named:
        made.append(Named(libraries[name], fmus[name].description))
        return made[-1]

    yield make
    for caller in made:
        caller.free()


def in_transient(plant: Named, **inputs: float) -> Named:
    """A plant half a second after its inputs have jumped."""
    plant.initialize()
    for index in range(40):
        values = INPUTS | inputs
        assert plant.set_reals(plant.references(*values), values.values()) == Status.OK
        assert plant.step(index * STEP, STEP) == Status.OK
    return plant


def directional(plant: Named, unknowns: list[str], seeds: dict[str, float]) -> np.ndarray:
    """`fmi2GetDirectionalDerivative`."""
    rows, columns = plant.references(*unknowns), plant.references(*seeds)
    result = (c_double * len(rows))()
    arguments = ((c_uint * len(rows))(*rows), len(rows), (c_uint * len(columns))(*columns), len(columns))
    seed = (c_double * len(columns))(*seeds.values())
    assert plant.call("fmi2GetDirectionalDerivative", *arguments, seed, result) == Status.OK
    return np.array(result)


def output_derivatives(plant: Named, outputs: list[str]) -> np.ndarray:
    """`fmi2GetRealOutputDerivatives` of first order."""
    references = plant.references(*outputs)
    count = len(references)
    result = (c_double * count)()
    orders = (c_int * count)(*([1] * count))
    status = plant.call("fmi2GetRealOutputDerivatives", (c_uint * count)(*references), count, orders, result)
    assert status == Status.OK
    return np.array(result)


def names(plant: Named, condition: Callable) -> list[str]:
    """The Real variables that a condition holds for."""
    return [name for name, v in plant.variables.items() if v.type == "Real" and condition(v)]


def quotients(plant: Named, unknowns: list[str], known: str) -> tuple[np.ndarray, float]:
    """Central differences of the unknowns over one known that can be set, and the known's change."""
    reference, rows = plant.references(known), plant.references(*unknowns)
    (value,) = plant.get_reals(reference)
    change = 1e-5 * max(abs(value), 1e-3)
    ends = []
    for there in (value + change, value - change):
        assert plant.set_reals(reference, [there]) == Status.OK
        ends.append(np.array(plant.get_reals(rows)))
    assert plant.set_reals(reference, [value]) == Status.OK
    return (ends[0] - ends[1]) / (2 * change), change


def compare(plant: Named, unknowns: list[str], knowns: list[str]) -> None:
    """Derivatives against differences, whose rounding is that of the unknowns over the change."""
    values = np.abs(plant.get_reals(plant.references(*unknowns)))
    for known in knowns:
        expected, change = quotients(plant, unknowns, known)
        found = directional(plant, unknowns, {known: 1.0})
        # Rounding of values that are themselves differences of larger ones, and the third derivative.
        tolerance = 1e-4 * np.abs(expected) + 1e-9 * np.maximum(values, 1e-6) / change
        wrong = np.abs(found - expected) > tolerance
        assert not wrong.any(), (
            f"{known}: {[u for u, is_wrong in zip(unknowns, wrong, strict=True) if is_wrong]}"
        )


def test_between_steps(plant: Callable[..., Named]) -> None:
    caller = in_transient(plant(), hp_bypass=0.2, surge_valve=0.1, lp_wastegate=0.3, vacuum_pump=0.5)
    unknowns = names(caller, lambda v: v.causality == "output" or v.name.startswith("der("))
    # Those that are at a bound: there is no moving them to both sides.
    knowns = names(caller, lambda v: v.causality == "input")
    compare(caller, unknowns, knowns)


@pytest.mark.parametrize("mode", [1, 2])
def test_in_initialization(plant: Callable[..., Named], mode: int) -> None:
    caller = plant()
    one = (c_uint * 1)(*caller.references("initialization.mode"))
    assert caller.call("fmi2SetInteger", one, 1, (c_int * 1)(mode)) == Status.OK
    assert caller.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == Status.OK
    assert caller.call("fmi2EnterInitializationMode") == Status.OK
    assert caller.set_reals(caller.references(*INPUTS), INPUTS.values()) == Status.OK
    unknowns = names(caller, lambda v: v.causality == "output")
    knowns = [
        *INPUTS,
        "tank.pressure",
        "cylinders.displacement",
        "hp_turbine.flow_capacity",
        "air.gas_constant",
    ]
    compare(caller, unknowns, knowns)


def test_directions_add(plant: Callable[..., Named]) -> None:
    caller = in_transient(plant())
    unknowns = names(caller, lambda v: v.causality == "output" or v.name.startswith("der("))
    seeds = {
        "engine_speed": 3.0,
        "throttle": -0.1,
        "intercooler.outlet_pressure": 200.0,
        "hp_shaft.speed": 5.0,
    }
    parts = [directional(caller, unknowns, {name: seed}) for name, seed in seeds.items()]
    together = directional(caller, unknowns, seeds)
    assert together == pytest.approx(sum(parts), rel=1e-12, abs=1e-12 * np.max(np.abs(parts)))
    assert (directional(caller, unknowns, {}) == 0.0).all()
    # Nothing was moved by it.
    other = in_transient(plant())
    assert caller.get_reals(caller.output_references()) == other.get_reals(other.output_references())


def test_an_input_at_its_bound_does_not_change(plant: Callable[..., Named]) -> None:
    """The nearest bound is used for what lies beyond: there a change of the input changes nothing."""
    caller = in_transient(plant())
    assert caller.set_reals(caller.references("throttle"), [1.5]) == Status.WARNING
    assert directional(
        caller, ["engine_torque", "der(intake_manifold.pressure)"], {"throttle": 1.0}
    ).tolist() == [0, 0]


@pytest.mark.parametrize("slope", [0.0, 400.0])
def test_outputs_over_time(plant: Callable[..., Named], slope: float) -> None:
    """With inputs that hold, and with one that rises: what passes in the last and the next small step."""
    width = 2e-4
    caller = in_transient(plant())
    outputs = names(caller, lambda v: v.causality == "output")
    reference = (c_uint * 1)(*caller.references("engine_speed"))
    references = caller.references(*outputs)
    values = []
    for index in range(3):
        speed = INPUTS["engine_speed"] + slope * width * index
        assert caller.set_reals(reference, [speed]) == Status.OK
        arguments = (reference, 1, (c_int * 1)(1), (c_double * 1)(slope))
        assert caller.call("fmi2SetRealInputDerivatives", *arguments) == Status.OK
        assert caller.step(0.5 + width * index, width) == Status.OK
        values.append(np.array(caller.get_reals(references)))
        if index == 1:
            found = output_derivatives(caller, outputs)
    expected = (values[2] - values[0]) / (2 * width)
    # The solver's tolerance within a step, and the third derivative, of the fastest modes (1e3 1/s).
    scale = np.abs(expected) + 1e-5 * np.abs(values[1]) / width
    assert np.max(np.abs(found - expected) / scale) < 1e-2
    assert abs(found[outputs.index("engine_torque")]) > 0


def test_what_has_no_derivative_is_refused(plant: Callable[..., Named]) -> None:
    caller = in_transient(plant())
    one, two = (c_double * 1)(1.0), (c_double * 2)(1.0, 1.0)

    def refused(unknown: str, known: str) -> str:
        vectors = [(c_uint * 1)(*caller.references(name)) for name in (unknown, known)]
        (text,) = caller.errors_of("fmi2GetDirectionalDerivative", vectors[0], 1, vectors[1], 1, one, one)
        return text

    assert "throttle" in refused("throttle", "engine_speed")
    assert "tank.volume" in refused("engine_torque", "tank.volume")
    assert "air_mass_flow" in refused("engine_torque", "air_mass_flow")
    assert "time" in refused("engine_torque", "time")
    assert "tank.frozen" in refused("engine_torque", "tank.frozen")
    twice = (c_uint * 2)(*caller.references("throttle", "throttle"))
    torque = (c_uint * 1)(*caller.references("engine_torque"))
    (text,) = caller.errors_of("fmi2GetDirectionalDerivative", torque, 1, twice, 2, two, one)
    assert "throttle is twice" in text
    nan = (c_double * 1)(float("nan"))
    (text,) = caller.errors_of("fmi2GetDirectionalDerivative", torque, 1, twice, 1, nan, one)
    assert "throttle" in text
    for order in (0, 2):
        (text,) = caller.errors_of("fmi2GetRealOutputDerivatives", torque, 1, (c_int * 1)(order), one)
        assert f"order {order}" in text
        assert "engine_torque" in text
    (text,) = caller.errors_of("fmi2GetRealOutputDerivatives", twice, 1, (c_int * 1)(1), one)
    assert "throttle" in text


def test_what_is_declared(fmus: dict[str, Fmu], plant: Callable[..., Named]) -> None:
    declared = {name: fmu.description.coSimulation for name, fmu in fmus.items()}
    assert declared["BoostPlant"].providesDirectionalDerivative
    assert declared["BoostPlant"].maxOutputDerivativeOrder == 1
    assert not declared["BoostController"].providesDirectionalDerivative
    assert declared["BoostController"].maxOutputDerivativeOrder == 0
    # The controller's outputs change at samples only.
    controller = plant("BoostController").initialize()
    output = (c_uint * 1)(*controller.references("hp_wastegate_pwm"))
    (text,) = controller.errors_of(
        "fmi2GetRealOutputDerivatives", output, 1, (c_int * 1)(1), (c_double * 1)()
    )
    assert "maxOutputDerivativeOrder is 0" in text
