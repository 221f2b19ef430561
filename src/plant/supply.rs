//! The electric supply: the voltage at the valve's terminals, and its measurement.
//!
//! The running vacuum pump pulls the voltage down (paper, fig. 8). The sensor shares the valve's terminals, so it sees
//! that dip too, but filters it: the controller's compensation (paper, eq. (9)) is slightly late.

use super::variables::{PumpParameters, SupplySensorParameters};
use fmu_export::Number;

/// Voltage drop and measurement.
#[derive(Clone, Copy, Debug)]
pub struct Supply<D = f64> {
    /// The pump, which loads the supply.
    pub pump: PumpParameters<D>,
    /// The voltage sensor.
    pub sensor: SupplySensorParameters<D>,
}

impl<D: Number> Supply<D> {
    /// The voltage at the valve in V from the system voltage (V) and the pump (0 … 1).
    pub fn voltage(&self, system_voltage: D, pump: D) -> D {
        (system_voltage - self.pump.voltage_drop * pump).max(0.0)
    }

    /// Rate of change of the measured voltage in V/s.
    pub fn measured_rate(&self, voltage: D, measured: D) -> D {
        (voltage - measured) / self.sensor.time_constant
    }
}
