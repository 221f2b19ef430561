"""The supply voltage as a disturbance: figs. 1, 8, 10 and 14."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Make
from experiments import (
    ON_TOLERANCE,
    SAMPLE_TIME,
    couple,
    couple_running,
    deviation,
    noise,
    run_in,
    scenario,
    staircase,
)
from master import Master, Record

DIP = staircase(*scenario("figure_1")["inputs"]["supply_voltage"]["steps"])
"""The voltage of figs. 1 and 10."""

DUTY = scenario("figure_1")["inputs"]["hp_wastegate_pwm"]

OPEN_LOOP = {"mode": "open_loop", "pwm_reference": DUTY}

STEPS = staircase(*scenario("figure_14")["inputs"]["supply_voltage"]["steps"])
"""The voltage of fig. 14."""


def position(record: Record) -> np.ndarray:
    """The wastegate's, in points (percent of the stroke)."""
    return 100 * record["hp_wastegate_position"]


def check_dip(record: Record) -> None:
    """Fig. 1: 0.8 V less moves the wastegate by a tenth of its stroke, and boost pressure by 12 kPa."""
    before, after = record.at(2.0), record.at(6.0)
    change = {name: after[name] - before[name] for name in record}
    points = 100 * change["hp_wastegate_position"]
    print(
        f"actuator {change['actuator_pressure']:.0f} Pa, wastegate {points:.2f} points, "
        f"boost {change['boost_pressure']:.0f} Pa"
    )
    # 0.01 % of full scale at both ends, and half of the last printed digit.
    assert abs(change["actuator_pressure"] - 2466) <= 20 + 0.5
    assert 76.75e3 <= before["actuator_pressure"] <= 76.85e3
    assert 79.25e3 <= after["actuator_pressure"] <= 79.35e3
    assert -9.7 - 0.07 <= points <= -9.2 + 0.07
    assert 49.5 - 0.06 <= 100 * before["hp_wastegate_position"] <= 50.0 + 0.06
    assert 12.3e3 - 90 <= change["boost_pressure"] <= 12.8e3 + 90


def test_dip_of_the_plant_alone(plant: Make) -> None:
    instance = plant()
    run_in(instance, {"hp_wastegate_pwm": DUTY, "supply_voltage": 11.9})
    check_dip(Master([instance], SAMPLE_TIME, inputs={"supply_voltage": DIP}).run(8.0))


def test_dip_of_the_open_loop(plant: Make, controller: Make) -> None:
    master = couple_running(
        plant(),
        controller(),
        {**OPEN_LOOP, "compensate_voltage": False},
        {"supply_voltage": 11.9},
        inputs={"supply_voltage": DIP},
    )
    record = master.run(8.0)
    assert set(record["hp_wastegate_pwm"]) == {DUTY}
    check_dip(record)


def test_compensated_duty_leaves_the_plant_alone(plant: Make) -> None:
    """Fig. 10: 12/U times the duty is the valve's exact inverse."""
    instance = plant()
    run_in(instance, {"hp_wastegate_pwm": DUTY * 12 / 11.9, "supply_voltage": 11.9})
    inputs = {"supply_voltage": DIP, "hp_wastegate_pwm": lambda time: DUTY * 12 / DIP(time)}
    record = Master([instance], SAMPLE_TIME, inputs=inputs).run(10.0)
    print(f"{np.ptp(position(record)):.5f} points")
    assert np.ptp(position(record)) < 0.0005


def test_compensation_by_the_controller(plant: Make, controller: Make) -> None:
    """Fig. 10 with a measured, lagged supply: a pulse at each edge that is soon over."""
    supply = {"supply_voltage": 11.9, "supply_voltage_measured": 11.9}
    master = couple_running(
        plant(),
        controller(),
        {**OPEN_LOOP, "supply_voltage_measured": 11.9},
        {"supply_voltage": supply["supply_voltage"]},
        inputs={"supply_voltage": DIP},
    )
    record = master.run(10.0)
    rest = position(record)[0]
    for edge in [2.0, 6.0]:
        before = 100 * record.at(edge)["hp_wastegate_position"]
        pulse = np.max(np.abs(position(record.between(edge, edge + 1.0)) - before))
        end = 100 * record.at(edge + 3.9)["hp_wastegate_position"]
        later = position(record.between(edge + 0.1, edge + 3.9))
        left = abs(later[0] - end)
        print(f"edge {edge}: pulse {pulse:.2f}, after 0.1 s {left:.2f}, at rest {end - rest:.2f}")
        # 0.01 points for 0.01 % of full scale, and half a digit.
        assert pulse <= 5.3 + 0.06
        assert np.max(np.abs(later - end)) <= 0.5 + 0.06
        assert abs(end - rest) <= 0.7 + 0.06


def voltage_steps(plant: Make, controller: Make, lag: float = 0.02, **options) -> float:
    """Fig. 14: the largest deviation from 125 kPa (Pa) after 3 s."""
    inputs = {"supply_voltage": STEPS}
    plant_values = {"supply_sensor.time_constant": lag}
    master = couple(plant(), controller(), plant_values=plant_values, inputs=inputs, **options)
    result = deviation(master.run(42.0), 125e3, 3.0)
    print(f"{result:.0f} Pa")
    return result


@pytest.mark.parametrize(
    ("lag", "reference"), [(0.001, 240), (0.02, 520), (0.05, 1050), (0.1, 1800), (0.2, 2800)]
)
def test_voltage_steps_with_compensation(plant: Make, controller: Make, lag: float, reference: float) -> None:
    """The lag of the voltage's measurement is what is left of the disturbance."""
    found = voltage_steps(plant, controller, lag)
    digit = 50 if lag >= 0.1 else 5
    assert abs(found - reference) <= digit + ON_TOLERANCE
    # The paper's: below 1 kPa (0.8 %), with the lag of a measurement.
    assert found < 1000 or lag > 0.02


def test_voltage_steps_with_compensation_and_noise(plant: Make, controller: Make) -> None:
    found = voltage_steps(plant, controller, distort={"boost_pressure": noise(0, 100.0)})
    assert found < 1000


@pytest.mark.parametrize(("lam", "reference"), [(0.3, 6400), (1.0, 11700)])
def test_voltage_steps_without_compensation(
    plant: Make, controller: Make, lam: float, reference: float
) -> None:
    values = {"compensate_voltage": False, "lambda": lam}
    found = voltage_steps(plant, controller, controller_values=values)
    assert abs(found - reference) <= 50 + ON_TOLERANCE


def test_pump_disturbs_the_wastegate(plant: Make, controller: Make) -> None:
    """Fig. 8: the relay runs the pump, whose current costs 0.4 V while it is on."""
    master = couple_running(
        plant(),
        controller(),
        {**OPEN_LOOP, "pwm_reference": 50.0, "compensate_voltage": False, "engine_speed": 2000.0},
        {"engine_speed": 2000.0, "tank.pressure": 30e3},
        {"pump.voltage_drop": 0.4},
    )
    record = master.run(90.0)
    on = record["time"][record["vacuum_pump"] > 0.5]
    # A record's row holds the command of the sample one step before it.
    begins, ends = on[0] - SAMPLE_TIME, on[-1]
    print(f"pump on {begins:.3f} to {ends:.3f} s")
    # Half of the last digit, and one sample: 0.01 % of full scale is 3.5 Pa of the tank, that is 0.05 s
    # of leaking at 5 kPa in 72 s.
    assert abs(begins - 71.88) <= 0.05 + 0.02
    assert abs(ends - 81.54) <= 0.05 + 0.02
    before, during = record.at(round(begins, 4)), record.at(round(ends, 4))
    after = record.at(85.0)
    opens = 100 * (during["hp_wastegate_position"] - before["hp_wastegate_position"])
    returns = 100 * (after["hp_wastegate_position"] - during["hp_wastegate_position"])
    pressure = during["actuator_pressure"] - before["actuator_pressure"]
    print(f"wastegate {opens:.2f}, then {returns:+.2f} points, actuator {pressure:.0f} Pa")
    # The reference's 4.3 points, less what friction, whose force starts at its limit, gives way at first.
    assert -4.35 <= opens <= -4.05
    assert abs(returns - 4.3) <= 0.05 + 0.02
    assert abs(pressure - 1460) <= 5 + 20
