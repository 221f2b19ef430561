"""Where the plant comes to rest, from a running engine and by the settled start."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from conftest import Make
from master import Fmu, Instance, Master

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
    file = Path(__file__).parents[1] / "data" / "steady_states.csv"
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
    assert abs(friction) <= running.get("actuator.coulomb_friction") * (1 + 1e-9)

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


@pytest.mark.parametrize(("speed", "throttle", "valves"), EXTREMES)
@pytest.mark.parametrize("mode", ["settled", "running"])
def test_extremes_stay_finite(
    plant: Make, plant_fmu: Fmu, mode: str, speed: float, throttle: float, valves: float
) -> None:
    """Engines that stand still, shut throttles, everything open at top speed."""
    instance = plant()
    names = ["lp_wastegate", "hp_bypass", "surge_valve"]
    inputs = {"engine_speed": speed, "throttle": throttle, **dict.fromkeys(names, valves)}
    settle(instance, inputs, mode)
    no_isolated_rest = speed == 0 or throttle == 0
    if mode == "settled" and no_isolated_rest:
        assert instance.warnings(), "a start that is no steady state was not told"
    Master([instance], 0.1).run(5.0)
    reals = [v.name for v in plant_fmu.description.modelVariables if v.type == "Real"]
    assert np.isfinite(instance.reals(reals)).all()


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
    told = [text for text in instance.warnings() if "exhaust.pressure" in text or "hp_shaft.speed" in text]
    assert len(told) == 2
    given = plant()
    given.start({"initialization.mode": "given", "exhaust.pressure": 103e3})
    assert given.warnings() == []
    assert given.get("exhaust.pressure") == 103e3
