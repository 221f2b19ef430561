"""The boost pressure controller in Python, for PythonFMU, to compare the one in Rust with.

The law is that of `src/controller/` in mode boost with the paper's own structure: feedforward by bilinear
interpolation, PID controller by lambda-tuning at the interpolated operating point, compensation of the supply
voltage, and the relay of the vacuum tank, with the declared parameters. It does less than the FMU in Rust:
each step is a sample, whatever its size; the high-pressure stage is never bypassed; nothing is checked, and
no intermediate value is an output.
"""

import json
from bisect import bisect_right
from math import sqrt
from pathlib import Path

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class PythonController(Fmi2Slave):
    """One sample a step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.boost_reference = 125e3
        self.boost_pressure = 101325.0
        self.tank_pressure = 32.5e3
        self.supply_voltage_measured = 12.0
        self.engine_speed = 1500.0
        self.hp_wastegate_pwm = 0.0
        self.vacuum_pump = 0.0
        self.register_variable(Real("boost_reference", causality=Fmi2Causality.input))
        self.register_variable(Real("boost_pressure", causality=Fmi2Causality.input))
        self.register_variable(Real("tank_pressure", causality=Fmi2Causality.input))
        self.register_variable(Real("supply_voltage_measured", causality=Fmi2Causality.input))
        self.register_variable(Real("engine_speed", causality=Fmi2Causality.input))
        self.register_variable(Real("hp_wastegate_pwm", causality=Fmi2Causality.output))
        self.register_variable(Real("vacuum_pump", causality=Fmi2Causality.output))

        # Beside this script, both in the build folder and in the FMU's resources.
        declared = json.loads(Path(__file__).with_name("controller.json").read_text())
        start = {variable["name"]: variable.get("start") for variable in declared["variables"]}
        (schedule,) = (c["variables"] for c in declared["components"] if c["name"] == "schedule")
        tables = {variable["name"]: variable["start"] for variable in schedule}
        self.pressures, self.speeds = tables["boost_reference"], tables["engine_speed"]
        self.duties, self.gains = tables["feedforward"], tables["gain"]
        self.time_constants, self.delays = tables["time_constant"], tables["delay"]
        self.sample_time = start["sample_time"]
        self.nominal_voltage = start["nominal_voltage"]
        self.lambda_ = start["lambda"]
        self.derivative_filter = start["derivative_filter"]
        self.pwm_min, self.pwm_max = start["pwm_min"], start["pwm_max"]
        self.boost_limit = start["boost_limit"]
        self.tank_pressure_on, self.tank_pressure_off = start["tank_pressure_on"], start["tank_pressure_off"]

        self.measurement = None
        self.integral = self.derivative = 0.0

    @staticmethod
    def place(axis, value):
        """The grid point below a value, and the fraction of the interval to the next one."""
        below = bisect_right(axis, value, 1, len(axis) - 1) - 1
        fraction = (value - axis[below]) / (axis[below + 1] - axis[below])
        return below, min(max(fraction, 0.0), 1.0)

    @staticmethod
    def interpolate(table, row, column):
        (i, y), (j, x) = row, column
        lower, upper = table[i], table[i + 1]
        return (1.0 - y) * ((1.0 - x) * lower[j] + x * lower[j + 1]) + y * (
            (1.0 - x) * upper[j] + x * upper[j + 1]
        )

    def do_step(self, current_time, step_size):
        if self.tank_pressure > self.tank_pressure_on:
            self.vacuum_pump = 1.0
        elif self.tank_pressure < self.tank_pressure_off:
            self.vacuum_pump = 0.0

        factor = self.nominal_voltage / max(self.supply_voltage_measured, 6.0)
        most = min(self.pwm_max, 100.0 / factor)
        reference = min(self.boost_reference, self.boost_limit)
        measurement = self.boost_pressure
        if self.measurement is None:
            self.measurement = measurement

        row, column = self.place(self.pressures, reference), self.place(self.speeds, self.engine_speed)
        feedforward = self.interpolate(self.duties, row, column)
        time_constant = self.interpolate(self.time_constants, row, column)
        delay = self.interpolate(self.delays, row, column)
        integral_time = time_constant + delay / 2.0
        gain = integral_time / ((delay / 2.0 + self.lambda_) * self.interpolate(self.gains, row, column))
        derivative_time = time_constant * delay / (delay + 2.0 * time_constant)
        tracking_time = max(sqrt(integral_time * derivative_time), 4.0 * self.sample_time)

        pole = derivative_time / (derivative_time + self.derivative_filter * self.sample_time)
        change = measurement - self.measurement
        self.derivative = pole * self.derivative - gain * self.derivative_filter * pole * change
        self.measurement = measurement
        error = reference - measurement
        duty = feedforward + gain * error + self.integral + self.derivative
        limited = min(max(duty, self.pwm_min), most)
        self.integral += gain * self.sample_time / integral_time * error
        self.integral += self.sample_time / tracking_time * (limited - duty)
        self.hp_wastegate_pwm = min(limited * factor, 100.0)
        return True
