"""Where the plant comes to rest, from a running engine and by the settled start."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from conftest import Make
from master import Instance, Master

COLUMNS = {
    "p_ic": "boost_pressure",
    "wg_percent": "hp_wastegate_position",
    "p_act": "actuator_pressure",
    "torque": "engine_torque",
    "W_ac": "air_mass_flow",
    "n_hp": "hp_turbo_speed",
    "n_lp": "lp_turbo_speed",
    "p_em": "exhaust_manifold_pressure",
    "p_it": "interstage_exhaust_pressure",
    "T_em": "exhaust_temperature",
    "T_ic": "charge_temperature",
}

RELATIVE = 1e-4
"""The tolerance of the solver, with room for another method's way to it in 60 s."""

POINTS = 0.01
"""The tolerance of the wastegate's position, in percent of its stroke."""

DAHL_POINTS = 1.3
"""How far friction can hold the wastegate from where it settles without: Dahl's force remembers."""

DIGITS = 5
"""Of the printed values."""


def table() -> list[dict[str, float]]:
    """The reference's steady states, printed."""
    file = Path(__file__).parents[2] / "data" / "steady_states.csv"
    with file.open() as lines:
        rows = np.genfromtxt((line for line in lines if not line.startswith("#")), delimiter=",", names=True)
    return [{name: float(row[name]) for name in rows.dtype.names} for row in rows]


def rounding(value: float) -> float:
    """Half a unit of the last printed digit."""
    return 0.0 if value == 0 else 0.5 * 10.0 ** (np.floor(np.log10(abs(value))) - DIGITS + 1)


def describe(row: dict[str, float]) -> str:
    """Names a test."""
    return f"{row['engine_speed_rpm']:.0f} rpm {row['pwm_percent']:.0f} %"


def settle(instance: Instance, inputs: dict[str, float], mode: str) -> None:
    """Starts with the tank's pressure held."""
    instance.start({"initialization.mode": mode, "tank.frozen": True, **inputs})


def inputs_of(row: dict[str, float]) -> dict[str, float]:
    """The inputs of a row; the others keep their start values."""
    return {"engine_speed": row["engine_speed_rpm"], "hp_wastegate_pwm": row["pwm_percent"]}


def missed(found: dict[str, float], row: dict[str, float], factor: float, points: float) -> dict[str, tuple]:
    """Values that differ from the row's by more than tolerances and rounding."""
    result = {}
    for column, name in COLUMNS.items():
        value, expected = found[name], row[column]
        if column == "wg_percent":
            value, tolerance = 100 * value, points
        else:
            tolerance = factor * abs(expected)
        if not abs(value - expected) <= tolerance + rounding(expected):
            result[name] = (value, expected)
    return result


@pytest.mark.parametrize("row", table(), ids=describe)
def test_running_engine_comes_to_rest(plant: Make, row: dict[str, float]) -> None:
    instance = plant()
    settle(instance, inputs_of(row), "running")
    last = Master([instance], 0.1).run(60.0).at(60.0)
    assert missed(last, row, RELATIVE, POINTS) == {}


@pytest.mark.parametrize("row", table(), ids=describe)
def test_settled_start_is_at_rest(plant: Make, row: dict[str, float]) -> None:
    instance = plant()
    settle(instance, inputs_of(row), "settled")
    assert instance.warnings() == []
    record = Master([instance], 0.1).run(5.0)
    # Nothing moves: 1e-6 of each value is ten times the relative tolerance of the steady-state solve, and a
    # hundredth of what the trace is held to.
    for name in COLUMNS.values():
        column = record[name]
        assert np.ptp(column) <= 1e-6 * np.max(np.abs(column)), name


@pytest.mark.parametrize("row", table(), ids=describe)
def test_settled_start_is_the_running_engines_rest(plant: Make, row: dict[str, float]) -> None:
    """The same but for the friction force: none is left in a settled start.

    The force of the running engine's rest (at most the Coulomb force) is put into a plant without
    friction as a change of the spring's preload, and then both agree to the table's tolerance.
    """
    running = plant()
    settle(running, inputs_of(row), "running")
    Master([running], 0.1).run(60.0)
    friction = running.get("actuator.friction_force")
    preload = running.get("actuator.spring_preload")
    # But for the error that the integration aims at, relative to the full scale, which the Coulomb force is.
    error = running.get("solver.relative_tolerance")
    assert abs(friction) <= running.get("actuator.coulomb_friction") * (1 + error)

    settled = plant()
    inputs = {**inputs_of(row), "actuator.spring_preload": preload + friction}
    settle(settled, inputs, "settled")
    found = {name: settled.get(name) for name in COLUMNS.values()}
    assert missed(found, row, RELATIVE, POINTS) == {}

    plain = plant()
    settle(plain, inputs_of(row), "settled")
    position = 100 * plain.get("hp_wastegate_position")
    assert abs(position - row["wg_percent"]) <= DAHL_POINTS + POINTS


EXTREMES = list(itertools.product([0.0, 700.0, 8000.0], [0.0, 0.02, 1.0], [0.0, 1.0]))


def extreme(speed: float, throttle: float, valves: float) -> dict[str, float]:
    """Engines that stand still, shut throttles, everything open at top speed."""
    names = ["lp_wastegate", "hp_bypass", "surge_valve"]
    return {"engine_speed": speed, "throttle": throttle, **dict.fromkeys(names, valves)}


def assert_finite(instance: Instance) -> None:
    """No variable is NaN or infinite."""
    variables = instance.fmu.description.modelVariables
    reals = instance.reals(v.name for v in variables if v.type == "Real")
    assert np.isfinite(reals).all()


@pytest.mark.parametrize(("speed", "throttle", "valves"), EXTREMES)
def test_extremes_settle_or_are_told(plant: Make, speed: float, throttle: float, valves: float) -> None:
    """A settled start is at rest, or a warning says that it is not."""
    instance = plant()
    settle(instance, extreme(speed, throttle, valves), "settled")
    assert_finite(instance)
    warned = bool(instance.warnings())
    record = Master([instance], 0.1).run(5.0)
    assert_finite(instance)
    # The same 1e-6 as at the table's points; speeds and flows that are 0 have a scale instead of a value.
    floors = {"hp_turbo_speed": 1.0, "lp_turbo_speed": 1.0, "air_mass_flow": 1e-6, "engine_torque": 1e-3}
    moved = {
        name: float(np.ptp(record[name]))
        for name in COLUMNS.values()
        if np.ptp(record[name]) > max(1e-6 * np.max(np.abs(record[name])), 1e-6 * floors.get(name, 0.0))
    }
    print(f"{'warned' if warned else 'not warned'}, moved: {moved}")
    assert warned or moved == {}


@pytest.mark.parametrize(("speed", "throttle", "valves"), EXTREMES)
def test_extremes_run_from_a_running_engine(
    plant: Make, speed: float, throttle: float, valves: float
) -> None:
    instance = plant()
    settle(instance, extreme(speed, throttle, valves), "running")
    Master([instance], 0.1).run(5.0)
    assert_finite(instance)


def test_a_start_without_isolated_steady_state_is_told(plant: Make) -> None:
    """An engine at rest behind a shut throttle holds whatever pressure its intake manifold has."""
    instance = plant()
    settle(instance, extreme(0.0, 0.0, 0.0), "settled")
    assert len(instance.warnings()) == 1
    assert "steady" in instance.warnings()[0]


def test_tank_pressure_holds_in_each_mode(plant: Make) -> None:
    for mode in ["settled", "running", "given"]:
        instance = plant()
        instance.start({"initialization.mode": mode, "tank.pressure": 31000.0})
        assert instance.get("tank_pressure") == 31000.0
        assert instance.warnings() == []


def test_a_state_that_is_not_used_is_told_once(plant: Make) -> None:
    """Start values of states count in the mode `given` only."""
    instance = plant()
    instance.start({"exhaust.pressure": 103e3, "hp_shaft.speed": 7000.0})
    told = " ".join(instance.warnings())
    assert told.count("exhaust.pressure") == told.count("hp_shaft.speed") == 1
    given = plant()
    given.start({"initialization.mode": "given", "exhaust.pressure": 103e3})
    assert given.warnings() == []
    assert given.get("exhaust.pressure") == 103e3
