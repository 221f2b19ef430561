"""A boost pressure PI controller in Python, as an FMU from another tool for BoostPlant.

It has the interface's names and units, so it needs no connections.
"""

from pythonfmu import Fmi2Causality, Fmi2Variability
from quantity import Quantity, SlaveWithUnits

PWM_MIN, PWM_MAX = 25.0, 75.0
"""The duty range in which the wastegate actuator moves, at nominal voltage (%)."""
NOMINAL_VOLTAGE, LEAST_VOLTAGE = 12.0, 6.0
"""The nominal voltage, and the lowest one compensated for (V)."""
TANK_PRESSURE_ON, TANK_PRESSURE_OFF = 35e3, 30e3
"""The vacuum pump is switched on above the first, off below the second (Pa)."""


class PiController(SlaveWithUnits):
    """Incremental form, accumulated within the duty limits, so the integral does not wind up."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.description = "PI controller of boost pressure"
        self.boost_reference = self.boost_pressure = 125e3
        self.tank_pressure = 32.5e3
        self.supply_voltage_measured = NOMINAL_VOLTAGE
        # From BoostController's maps at 1500 rpm and 180 kPa, where the gain is largest: time constant 1.8 s,
        # -96 hPa/%, delay 0.07 s; for a closed-loop time constant of 0.3 s.
        self.gain, self.integral_time = -5.6e-4, 1.8
        # At 1500 rpm and 125 kPa.
        self.hp_wastegate_pwm = self.duty = 44.0
        self.vacuum_pump = 0.0
        # No stage changes.
        self.lp_wastegate = self.hp_bypass = 0.0
        self.error = None

        inputs = {
            "boost_reference": "Pa",
            "boost_pressure": "Pa",
            "tank_pressure": "Pa",
            "supply_voltage_measured": "V",
        }
        for name, unit in inputs.items():
            self.register_variable(Quantity(name, unit, causality=Fmi2Causality.input))
        outputs = {"hp_wastegate_pwm": "%", "vacuum_pump": "1", "lp_wastegate": "1", "hp_bypass": "1"}
        for name, unit in outputs.items():
            self.register_variable(
                Quantity(name, unit, causality=Fmi2Causality.output, variability=Fmi2Variability.discrete)
            )
        for name, unit in {"gain": "%/Pa", "integral_time": "s"}.items():
            self.register_variable(
                Quantity(name, unit, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
            )

    def do_step(self, current_time, step_size):
        # Some masters pass zeros before the first measurement.
        if self.boost_pressure == 0.0:
            return True
        error = self.boost_reference - self.boost_pressure
        change = 0.0 if self.error is None else error - self.error
        self.error = error
        duty = self.duty + self.gain * (change + step_size / self.integral_time * error)
        self.duty = min(max(duty, PWM_MIN), PWM_MAX)
        compensation = NOMINAL_VOLTAGE / max(self.supply_voltage_measured, LEAST_VOLTAGE)
        self.hp_wastegate_pwm = min(self.duty * compensation, 100.0)

        if self.tank_pressure > TANK_PRESSURE_ON:
            self.vacuum_pump = 1.0
        elif self.tank_pressure < TANK_PRESSURE_OFF:
            self.vacuum_pump = 0.0
        return True
