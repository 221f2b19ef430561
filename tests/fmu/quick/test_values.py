"""Values at the ends of what they may be, of which the models must make something sensible."""

from __future__ import annotations

import pytest
from conftest import Make
from master import Reals

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
    if voltage == 4.0:
        # In mode boost 75 % at 6 V (less is not believed) would be 150 %. At 0 V nothing was measured yet:
        # nothing is compensated.
        assert max(duties) == 100.0


def test_tunable_parameter_leaves_what_a_ramp_reached(plant: Make) -> None:
    """Who sets it between two steps asks for no other inputs: outputs stay those of the step's end."""
    instance = plant()
    instance.start()
    Reals(instance, ["engine_speed"]).set_derivatives([4e4])
    instance.slave.doStep(0.0, STEP)
    reached = {name: instance.get(name) for name in instance.fmu.named("output")}
    instance.set({"tank.frozen": True})
    assert {name: instance.get(name) for name in reached} == reached
    # An input that is set brings its own value, and the others' that were set.
    instance.set({"throttle": 1.0})
    assert instance.get("air_mass_flow") != reached["air_mass_flow"]
