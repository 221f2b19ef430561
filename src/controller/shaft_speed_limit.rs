//! The limit of the high-pressure shaft's speed while boost rises.
//!
//! At rest the limit of the reference keeps the shaft below its largest speed. While boost pressure rises the slow
//! low-pressure stage lags behind, and the high-pressure stage makes up for it with more speed. Where the speed is
//! measured, the virtual duty is at least the one that holds the limit at rest, more above it and less below it, by the
//! speed to come: the reference model gets the duty within its limits, so it waits. The bypass shuts above the largest
//! speed, also at rest: open, it takes the load off the shaft, in the cold at 5500 rpm to 219 krpm at 120 kPa, where with
//! it shut 178 krpm would be possible (a search over all valves).

use fmu_export::Persistent;

use super::allocation::ramp;
use super::variables::{Parameters, ShaftSpeedLimitParameters};
use crate::elementary::{larger, smaller};

/// The least speed (rpm) that is a measurement: below, the limit is out of reach.
const LEAST_MEASUREMENT: f64 = 1e3;

/// The excess of speed (rpm) from which on the bypass is shut: with 205 krpm, at 209 krpm.
const BYPASS_SHUT_AT: f64 = 4e3;

/// The memory of the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ShaftSpeedLimit {
    /// The speed at the last sample (rpm).
    before: Option<f64>,
}

impl ShaftSpeedLimit {
    /// By how much a speed to come is above the largest (rpm), if the speed (rpm) is measured.
    pub fn excess(&mut self, parameters: &Parameters, speed: f64) -> Option<f64> {
        if speed < LEAST_MEASUREMENT {
            return None;
        }
        let &ShaftSpeedLimitParameters { speed: most, lead_time, .. } = &parameters.shaft_speed_limit;
        let rate = (speed - self.before.replace(speed).unwrap_or(speed)) / parameters.sample_time;
        Some(speed + lead_time * rate - most)
    }
}

/// The least virtual duty (%) at an excess of speed (rpm), by the duty that holds the largest speed at rest.
///
/// The most it asks for is where the low-pressure wastegate begins to open: beyond, boost falls, but the shaft hardly
/// slows down.
pub fn least_duty(parameters: &Parameters, excess: f64, holding_duty: f64) -> f64 {
    let least = holding_duty + parameters.shaft_speed_limit.gain * excess;
    smaller(least, larger(holding_duty, parameters.allocation.low_pressure_start))
}

/// The share of the bypass that stays open at an excess of speed (rpm): open, it takes the load off the shaft.
pub fn bypass_share(excess: f64) -> f64 {
    1.0 - ramp(excess, 0.0, BYPASS_SHUT_AT)
}
