"""A simple turbocharged engine model in Python, as an FMU from another tool for BoostController.

Its names and units differ from BoostPlant's. It is fitted to BoostController's maps at 1500 rpm: static boost
pressure is a logistic function of wastegate duty, followed by a lag.
"""

from math import exp

from pythonfmu import Fmi2Causality
from quantity import Quantity, SlaveWithUnits

AMBIENT_PRESSURE = 1.01325
"""bar."""
BOOST_LEAST, BOOST_SPAN = 1.05, 1.35
"""Boost with the wastegate open, and its rise with the wastegate shut (bar)."""
DUTY_MIDDLE, DUTY_WIDTH = 0.37, 0.037
"""The duty at half the rise, and the width of the transition."""
ENGINE_SPEED, VOLTAGE = 157.08, 12.0
"""The operating point (rad/s, V): boost above ambient is proportional to the speed, the valve to the
voltage."""
TIME_CONSTANT, ACTUATOR_TIME_CONSTANT = 1.5, 0.07
"""Time constants of boost pressure and wastegate actuator (s)."""
TANK_LEAK, TANK_PUMPED = 0.001, 0.0058
"""Rise of vacuum tank pressure, and its fall with the pump on (bar/s)."""
PUMP_VOLTAGE = 0.2
"""Voltage drop with the pump on (V)."""


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
