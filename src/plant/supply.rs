//! The electric supply: the voltage at the valve's terminals, and its measurement.
//!
//! The running vacuum pump pulls the voltage down (paper, fig. 8). The sensor sits on the same terminals
//! as the valve, so it sees that dip too, and filters it: what the controller compensates with
//! (paper, eq. (9)) is a little late.

/// Voltage drop and measurement.
#[derive(Clone, Copy, Debug)]
pub struct Supply {
    /// Drop of the voltage in V while the pump runs.
    pub pump_voltage_drop: f64,
    /// Time constant of the measurement's filter in s.
    pub sensor_time_constant: f64,
}

impl Supply {
    /// The voltage at the valve in V from the system voltage (V) and the pump (0 … 1).
    #[must_use]
    pub fn voltage(&self, system_voltage: f64, pump: f64) -> f64 {
        (system_voltage - self.pump_voltage_drop * pump).max(0.0)
    }

    /// Rate of change of the measured voltage in V/s.
    #[must_use]
    pub fn measured_rate(&self, voltage: f64, measured: f64) -> f64 {
        (voltage - measured) / self.sensor_time_constant
    }
}
