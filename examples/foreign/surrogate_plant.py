"""A quick model of a turbocharged engine in Python: somebody else's plant, for BoostController.

It has other names and other units than BoostPlant. What it computes is fitted to BoostController's maps at
1500 rpm: the static boost pressure by a logistic function of the wastegate's duty, and its lag.
"""

from math import exp

from pythonfmu import Fmi2Causality
from quantity import Quantity, SlaveWithUnits

AMBIENT_PRESSURE = 1.01325
"""bar."""
BOOST_LEAST, BOOST_SPAN = 1.05, 1.35
"""With the wastegate open, and by how much it rises with the wastegate shut (bar)."""
DUTY_MIDDLE, DUTY_WIDTH = 0.37, 0.037
"""Where it is half way between, and over which duties it changes."""
ENGINE_SPEED, VOLTAGE = 157.08, 12.0
"""At which this holds (rad/s, V): boost above ambient goes with the speed, the valve with the voltage."""
TIME_CONSTANT, ACTUATOR_TIME_CONSTANT = 1.5, 0.07
"""Of boost pressure and of the wastegate's actuator (s)."""
TANK_LEAK, TANK_PUMPED = 0.001, 0.0058
"""By what the pressure in the vacuum tank rises, and what the pump takes away (bar/s)."""
PUMP_VOLTAGE = 0.2
"""By what the pump lowers the supply's voltage (V)."""


class SurrogatePlant(SlaveWithUnits):
    """Two lags and a static map."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.description = "engine with turbocharger: two lags and a static map"
        self.wg_duty, self.pump_on = 0.44, 0.0
        self.n_engine, self.u_battery = ENGINE_SPEED, VOLTAGE
        self.p_tank = 0.325
        self.settle()

        inputs = {"wg_duty": "1", "pump_on": "1", "n_engine": "rad/s", "u_battery": "V"}
        for name, unit in inputs.items():
            self.register_variable(Quantity(name, unit, causality=Fmi2Causality.input))
        for name, unit in {"p_boost": "bar", "p_tank": "bar", "u_measured": "V"}.items():
            self.register_variable(Quantity(name, unit, causality=Fmi2Causality.output))

    def settle(self):
        self.u_measured = self.u_battery - PUMP_VOLTAGE * self.pump_on
        self.wastegate = self.wg_duty * self.u_measured / VOLTAGE
        self.p_boost = self.static_pressure()

    def static_pressure(self):
        pressure = BOOST_LEAST + BOOST_SPAN / (1.0 + exp((self.wastegate - DUTY_MIDDLE) / DUTY_WIDTH))
        return AMBIENT_PRESSURE + (pressure - AMBIENT_PRESSURE) * self.n_engine / ENGINE_SPEED

    def exit_initialization_mode(self):
        self.settle()

    def do_step(self, current_time, step_size):
        self.u_measured = self.u_battery - PUMP_VOLTAGE * self.pump_on
        duty = self.wg_duty * self.u_measured / VOLTAGE
        self.wastegate += (1.0 - exp(-step_size / ACTUATOR_TIME_CONSTANT)) * (duty - self.wastegate)
        self.p_boost += (1.0 - exp(-step_size / TIME_CONSTANT)) * (self.static_pressure() - self.p_boost)
        self.p_tank += step_size * (TANK_LEAK - TANK_PUMPED * self.pump_on)
        return True
