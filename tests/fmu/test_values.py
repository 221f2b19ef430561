"""Values at the ends of what they may be, of which the models must make something sensible."""

from __future__ import annotations

import pytest
from conftest import Make

STEP = 1 / 80


def test_largest_tank_is_accepted(plant: Make) -> None:
    """A vessel that nothing empties, for experiments."""
    instance = plant()
    instance.start({"tank.volume": 1e4})
    instance.slave.doStep(0.0, STEP)


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
