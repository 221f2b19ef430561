"""The plant against a reference solution at a tolerance of 1e-11: 40 s under a lively duty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import Make
from master import Reals

STEP = 1 / 80

INPUTS = {
    "pwm": "hp_wastegate_pwm",
    "U": "supply_voltage",
    "pump": "vacuum_pump",
    "N": "engine_speed",
    "th": "throttle",
    "lpwg": "lp_wastegate",
    "bp": "hp_bypass",
    "sv": "surge_valve",
    "p_amb": "ambient_pressure",
    "T_amb": "ambient_temperature",
}

STATES = {
    "p_tank": ("tank.pressure", 3.5e4),
    "p_act": ("actuator.chamber_pressure", 1e5),
    "x": ("actuator.position", 1e-2),
    "v": ("actuator.velocity", 0.1),
    "F_fr": ("actuator.friction_force", 0.2),
    "u_pl": ("valve.plunger_duty", 100),
    "p_af": ("air_filter.pressure", 1e5),
    "p_1": ("lp_compressor.outlet_pressure", 2e5),
    "p_2": ("hp_compressor.outlet_pressure", 2e5),
    "p_ic": ("intercooler.outlet_pressure", 2e5),
    "p_im": ("intake_manifold.pressure", 2e5),
    "p_em": ("exhaust_manifold.pressure", 2e5),
    "p_it": ("interstage_exhaust.pressure", 1.5e5),
    "p_t": ("exhaust.pressure", 1e5),
    "w_hp": ("hp_shaft.speed", 2e4),
    "w_lp": ("lp_shaft.speed", 1e4),
}
"""Name and full scale, in the trace's order."""

OUTPUTS = {
    "y_boost_pressure": ("boost_pressure", 2e5),
    "y_wg_percent": ("hp_wastegate_position", 1),
    "y_actuator_pressure": ("actuator_pressure", 1e5),
    "y_tank_pressure": ("tank_pressure", 3.5e4),
    "y_torque": ("engine_torque", 400),
    "y_W_air": ("air_mass_flow", 0.2),
    "y_n_hp": ("hp_turbo_speed", 2e5),
    "y_n_lp": ("lp_turbo_speed", 1e5),
    "y_p_em": ("exhaust_manifold_pressure", 2e5),
    "y_p_it": ("interstage_exhaust_pressure", 1.5e5),
    "y_T_em": ("exhaust_temperature", 1200),
    "y_T_ic": ("charge_temperature", 1200),
    "y_W_hpc": ("hp_compressor.mass_flow", 0.2),
    "y_W_lpc": ("lp_compressor.mass_flow", 0.2),
    "y_W_wg": ("hp_wastegate_port.mass_flow", 0.2),
    "y_p_PWM": ("valve.pressure", 1e5),
    "y_T_2": ("hp_compressor.outlet_temperature", 1200),
    "y_W_lpt": ("lp_turbine.mass_flow", 0.2),
    "y_W_hpt": ("hp_turbine.mass_flow", 0.2),
    "y_eta_vol": ("cylinders.volumetric_efficiency", 1),
}

TOLERANCE = 1e-4
"""Of full scale: a tenth of what a good pressure sensor resolves."""

TOLERANCES = {"v": 1e-3, "F_fr": 5e-3}
"""Rod velocity and friction force are fast and tiny."""


@pytest.fixture(scope="module")
def trace(root: Path) -> tuple[list[float], np.ndarray]:
    """The initial state, and a row at the end of each step with the inputs that were held over it."""
    file = root / "tests" / "data" / "plant_trace.csv"
    with file.open() as lines:
        initial = [float(word) for word in next(lines).split(":")[1].split()]
        return initial, np.genfromtxt(lines, delimiter=",", names=True)


def test_trace(plant: Make, trace: tuple[list[float], np.ndarray]) -> None:
    initial, rows = trace
    instance = plant()
    start = {name: value for (name, _), value in zip(STATES.values(), initial, strict=True)}
    start |= {name: rows[column][0] for column, name in INPUTS.items()}
    instance.start({"initialization.mode": "given", **start})
    assert instance.warnings() == []

    columns = STATES | OUTPUTS
    inputs = Reals(instance, list(INPUTS.values()))
    outputs = Reals(instance, [name for name, _ in columns.values()])
    expected = np.column_stack([rows[column] for column in columns])
    # The trace gives the wastegate's position in percent.
    expected[:, list(columns).index("y_wg_percent")] /= 100
    held = np.column_stack([rows[column] for column in INPUTS])
    found = np.empty_like(expected)
    for index, values in enumerate(held):
        inputs.set(values)
        instance.slave.doStep(index * STEP, STEP)
        found[index] = outputs.get()

    worst = np.max(np.abs(found - expected), axis=0)
    scales = np.array([scale for _, scale in columns.values()])
    relative = dict(zip(columns, worst / scales, strict=True))
    print({name: f"{value:.1e}" for name, value in relative.items()})
    missed = {n: v for n, v in relative.items() if not v <= TOLERANCES.get(n, TOLERANCE)}
    assert missed == {}
