//! The rate of change of a measured speed.

use fmu_export::Persistent;

use super::lag::Lag;

/// A first-order filter that gives the rate of change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct RateFilter {
    filtered: Lag,
}

impl RateFilter {
    /// The rate of change (1/s) of a value at a sample, with a time constant (s).
    pub fn sample(&mut self, sample_time: f64, time_constant: f64, value: f64) -> f64 {
        (value - self.filtered.sample(sample_time, time_constant, value)) / time_constant
    }
}
