//! The limit of the high-pressure shaft's speed while boost rises.
//!
//! At rest the limit of the reference keeps the shaft below its largest speed. While boost pressure rises the slow
//! low-pressure stage lags behind, and the high-pressure stage makes up for it with more speed. Where the speed is
//! measured, the virtual duty is at least the one that holds the limit at rest, more above it and less below it, by the
//! speed to come: the reference model gets the duty within its limits, so it waits.

use fmu_export::Persistent;

use super::variables::{Parameters, ShaftSpeedLimitParameters};
use crate::elementary::{larger, smaller};

/// The least speed (rpm) that is a measurement: below, the limit is out of reach.
const LEAST_MEASUREMENT: f64 = 1e3;

/// The memory of the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ShaftSpeedLimit {
    /// The speed at the last sample (rpm).
    before: Option<f64>,
}

impl ShaftSpeedLimit {
    /// The least virtual duty (%) at a speed (rpm), if it is measured, by the duty that holds the largest one at rest.
    ///
    /// The most it asks for is where the low-pressure wastegate begins to open: beyond, boost falls, but the shaft
    /// hardly slows down, and with the bypass open it even speeds up.
    pub fn least_duty(&mut self, parameters: &Parameters, speed: f64, holding_duty: f64) -> Option<f64> {
        if speed < LEAST_MEASUREMENT {
            return None;
        }
        let &ShaftSpeedLimitParameters { speed: most, gain, lead_time } = &parameters.shaft_speed_limit;
        let rate = (speed - self.before.replace(speed).unwrap_or(speed)) / parameters.sample_time;
        let least = holding_duty + gain * (speed + lead_time * rate - most);
        Some(smaller(least, larger(holding_duty, parameters.allocation.low_pressure_start)))
    }
}
