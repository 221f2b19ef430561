//! The electric supply: the voltage at the valve's terminals, and its measurement.
//!
//! The running vacuum pump pulls the voltage down (paper, fig. 8). The sensor sits on the same terminals
//! as the valve, so it sees that dip too, and filters it: what the controller compensates with
//! (paper, eq. (9)) is a little late.

use super::scalar::Scalar;

/// Voltage drop and measurement.
#[derive(Clone, Copy, Debug)]
pub struct Supply<D = f64> {
    /// Drop of the voltage in V while the pump runs.
    pub pump_voltage_drop: D,
    /// Time constant of the measurement's filter in s.
    pub sensor_time_constant: D,
}

impl<D: Scalar> Supply<D> {
    /// The voltage at the valve in V from the system voltage (V) and the pump (0 … 1).
    #[must_use]
    pub fn voltage(&self, system_voltage: D, pump: D) -> D {
        (system_voltage - self.pump_voltage_drop * pump).at_least(0.0)
    }

    /// Rate of change of the measured voltage in V/s.
    #[must_use]
    pub fn measured_rate(&self, voltage: D, measured: D) -> D {
        (voltage - measured) / self.sensor_time_constant
    }
}
