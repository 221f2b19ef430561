"""The actuator's characteristic: fig. 7, and position control by its inverse."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Make
from experiments import couple, couple_running, ramp, scenario

RAMP = ramp(*scenario("figure_7")["inputs"]["pwm_reference"]["points"])
"""The duty of fig. 7 (%)."""


def test_hysteresis_is_negligible(plant: Make, controller: Make) -> None:
    """Fig. 7: slowly up and down, compared at equal duty from 5 to 95 %."""
    values = {"mode": "open_loop", "pwm_reference": 0.0, "compensate_voltage": False}
    master = couple_running(plant(), controller(), values, inputs={"pwm_reference": RAMP})
    record = master.run(200.0)
    half = len(record["time"]) // 2
    duty = record["hp_wastegate_pwm"]
    grid = np.arange(5.0, 95.01, 0.25)

    def gap(name: str, part: np.ndarray) -> float:
        up = np.interp(part, duty[: half + 1], record[name][: half + 1])
        down = np.interp(part, duty[half:][::-1], record[name][half:][::-1])
        return float(np.max(np.abs(up - down)))

    points = 100 * gap("hp_wastegate_position", grid)
    low = gap("actuator_pressure", grid[grid < 85])
    all_over = gap("actuator_pressure", grid)
    print(f"position {points:.2f} points, pressure {low:.0f} Pa below 85 %, {all_over:.0f} Pa in all")
    # Half of the last digit, and 0.01 % of full scale twice.
    assert points <= 1.3 + 0.05 + 0.02
    assert low <= 100 + 20
    # Where the tank's pressure is the floor, the relay's band shows.
    assert all_over <= 1900 + 50 + 20


@pytest.mark.parametrize("reference", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("voltage", [11.0, 12.0, 13.5])
def test_position_mode_puts_the_wastegate_there(
    plant: Make, controller: Make, reference: float, voltage: float
) -> None:
    """The inverse of what the paper's section 3 models, whatever the supply."""
    master = couple(
        plant(),
        controller(),
        controller_values={"mode": "position", "wastegate_reference": reference},
        inputs={"supply_voltage": lambda _: voltage},
    )
    record = master.run(2.0)
    # The start without friction is the inverse's own; the settled solve is good to 1e-6.
    assert record["hp_wastegate_position"][0] == pytest.approx(reference, abs=1e-4)
    # Later the tank may rise and the pump move the supply: nothing of it reaches the wastegate.
    assert record["hp_wastegate_position"][-1] == pytest.approx(reference, abs=1e-3)
