"""A PI controller of boost pressure in Python: somebody else's controller, for BoostPlant.

It meets the plant by equal names. The stages of the engine it leaves as they start.
"""

from pythonfmu import Fmi2Causality, Fmi2Variability
from quantity import Quantity, SlaveWithUnits

PWM_MIN, PWM_MAX = 25.0, 75.0
"""Within which the wastegate's actuator moves (%)."""
TANK_PRESSURE_ON, TANK_PRESSURE_OFF = 35e3, 30e3
"""Above the first the vacuum pump goes on, below the second off (Pa)."""


class PiController(SlaveWithUnits):
    """The law's increments are added up within the limits of the duty: no integral winds up."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.description = "PI controller of boost pressure"
        self.boost_reference = self.boost_pressure = 125e3
        self.tank_pressure = 32.5e3
        # As of BoostController's maps at 1500 rpm and 180 kPa, where a duty does most: a time constant of
        # 1.8 s, -96 hPa/%, a delay of 0.07 s; so that the closed loop has a time constant of 0.3 s.
        self.gain, self.integral_time = -5.6e-4, 1.8
        # At 1500 rpm and 125 kPa.
        self.hp_wastegate_pwm = 44.0
        self.vacuum_pump = 0.0
        self.error = 0.0

        names = {"boost_reference": "Pa", "boost_pressure": "Pa", "tank_pressure": "Pa"}
        for name, unit in names.items():
            self.register_variable(Quantity(name, unit, causality=Fmi2Causality.input))
        for name, unit in {"hp_wastegate_pwm": "%", "vacuum_pump": "1"}.items():
            self.register_variable(
                Quantity(name, unit, causality=Fmi2Causality.output, variability=Fmi2Variability.discrete)
            )
        for name, unit in {"gain": "%/Pa", "integral_time": "s"}.items():
            self.register_variable(
                Quantity(name, unit, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
            )

    def exit_initialization_mode(self):
        self.error = self.boost_reference - self.boost_pressure

    def do_step(self, current_time, step_size):
        error = self.boost_reference - self.boost_pressure
        increment = self.gain * (error - self.error + step_size / self.integral_time * error)
        self.hp_wastegate_pwm = min(max(self.hp_wastegate_pwm + increment, PWM_MIN), PWM_MAX)
        self.error = error

        if self.tank_pressure > TANK_PRESSURE_ON:
            self.vacuum_pump = 1.0
        elif self.tank_pressure < TANK_PRESSURE_OFF:
            self.vacuum_pump = 0.0
        return True
