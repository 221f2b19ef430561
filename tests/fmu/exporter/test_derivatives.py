"""fmi2GetDirectionalDerivative and fmi2GetRealOutputDerivatives, against differences of the FMU for small
changes of inputs and parameters, and for small steps (FMI 2.0.5, sections 2.1.9 and 4.2.1)."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from fmpy.model_description import ScalarVariable

from fmu.exporter.importer import STEP, Instance, Status, integers, reals

pytestmark = [pytest.mark.quick, pytest.mark.compiled]

Make = Callable[..., Instance]

DIRECTIONAL = "fmi2GetDirectionalDerivative"
OVER_TIME = "fmi2GetRealOutputDerivatives"
PARAMETERS = {"tank.gain": 2.0, "settings.doubled": 1, "motion.start": 2, "motion.position": 0.5}


def directional(instance: Instance, unknowns: list[str], seeds: dict[str, float]) -> list[float]:
    """`fmi2GetDirectionalDerivative`."""
    result = reals(*[0.0] * len(unknowns))
    rows, columns = instance.fmu.references(*unknowns), instance.fmu.references(*seeds)
    instance.ok(DIRECTIONAL, rows, len(rows), columns, len(columns), reals(*seeds.values()), result)
    return list(result)


def unknowns(instance: Instance, initializing: bool = False) -> list[str]:
    """The Real outputs and, after initialization, derivatives."""

    def is_unknown(v: ScalarVariable) -> bool:
        return v.type == "Real" and (v.causality == "output" or (not initializing and "der(" in v.name))

    return [name for name, variable in instance.fmu.variables.items() if is_unknown(variable)]


def in_motion(make: Make) -> Instance:
    """An instance after some steps."""
    instance = make()
    assert instance.set(PARAMETERS) == Status.OK
    instance.initialize()
    assert instance.set({"rate": 1.5, "drive": 0.5}) == Status.OK
    instance.run(3)
    return instance


def check_against_differences(instance: Instance, rows: list[str], columns: list[str]) -> None:
    """The model is at most quadratic, so that central differences are exact up to rounding."""
    for known in columns:
        value, change, ends = instance.get(known), 1e-3, []
        for there in (value + change, value - change):
            assert instance.set({known: there}) == Status.OK
            ends.append([instance.get(unknown) for unknown in rows])
        assert instance.set({known: value}) == Status.OK
        expected = [(above - below) / (2 * change) for above, below in zip(*ends, strict=True)]
        assert any(expected), known
        assert directional(instance, rows, {known: 1.0}) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_between_steps(make: Make) -> None:
    instance = in_motion(make)
    assert instance.set({"pulse": 0.5}) == Status.OK
    check_against_differences(instance, unknowns(instance), ["rate", "drive", "pulse"])
    # States cannot be set between steps.
    assert directional(instance, unknowns(instance), {"motion.position": 1.0}) == [
        0.0,
        1.0,
        0.0,
        -2.0 * instance.get("motion.position"),
    ]


def test_in_initialization(make: Make) -> None:
    instance = make()
    instance.enter()
    check_against_differences(
        instance, unknowns(instance, initializing=True), ["rate", "tank.level", "tank.gain"]
    )


def test_directions_add(make: Make) -> None:
    instance, other = in_motion(make), in_motion(make)
    seeds = {"rate": 3.0, "drive": -0.5, "tank.level": 2.0, "motion.position": 0.25}
    rows = unknowns(instance)
    parts = [directional(instance, rows, {name: seed}) for name, seed in seeds.items()]
    assert directional(instance, rows, seeds) == pytest.approx(
        [sum(part) for part in zip(*parts, strict=True)]
    )
    assert directional(instance, rows, {}) == [0.0] * len(rows)
    # The call changes nothing.
    assert instance.snapshot() == other.snapshot()


def test_an_input_at_its_bound_does_not_change(make: Make) -> None:
    """Values beyond a bound are limited to it, so that a change of the input has no effect."""
    instance = in_motion(make)
    assert instance.set({"rate": 11.0}) == Status.WARNING
    assert directional(instance, ["output", "der(tank.level)"], {"rate": 1.0}) == [0.0, 0.0]


@pytest.mark.parametrize("slope", [0.0, 4.0])
def test_outputs_over_time(make: Make, slope: float) -> None:
    """With constant inputs, and with a rising one: between the last and the next small step."""
    instance, width, values = in_motion(make), 1e-4, []
    outputs = ["output", "position"]
    found = reals(0.0, 0.0)
    for index in range(3):
        assert instance.set({"rate": 1.5 + slope * width * index}) == Status.OK
        assert instance.set_derivative("rate", 1, slope) == Status.OK
        assert instance.step(3 * STEP + index * width, width) == Status.OK
        values.append([instance.get(name) for name in outputs])
        if index == 1:
            instance.ok(OVER_TIME, instance.fmu.references(*outputs), 2, integers(1, 1), found)
    expected = [(after - before) / (2 * width) for before, after in zip(values[0], values[2], strict=True)]
    assert all(expected)
    # Of the order of the width: the model's midpoint steps, and the curvature.
    assert list(found) == pytest.approx(expected, rel=10 * width)


def test_what_is_refused(make: Make) -> None:
    instance = in_motion(make)
    refs = instance.fmu.references
    for unknown, known, named in [
        ("rate", "drive", "rate"),
        ("output", "tank.gain", "tank.gain"),
        ("output", "position", "position"),
        ("output", "time", "time"),
        ("output", "settings.doubled", "settings.doubled"),
        ("steps", "rate", "steps"),
    ]:
        arguments = [refs(unknown), 1, refs(known), 1, reals(1.0), reals(0.0)]
        instance.refuses(DIRECTIONAL, *arguments, names=[named])
    output, twice = refs("output"), refs("rate", "rate")
    arguments = [output, 1, twice, 2, reals(1.0, 1.0), reals(0.0)]
    assert "rate occurs twice" in instance.refuses(DIRECTIONAL, *arguments)
    for order in (0, 2):
        text = instance.refuses(OVER_TIME, output, 1, integers(order), reals(0.0), names=["output"])
        assert f"order {order}" in text
    instance.refuses(OVER_TIME, twice, 1, integers(1), reals(0.0), names=["rate"])
