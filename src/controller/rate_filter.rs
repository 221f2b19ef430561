//! The rate of change of a measured speed.

use fmu_export::Persistent;

/// A first-order filter that gives the rate of change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct RateFilter {
    /// The filtered value; none before the first sample.
    filtered: Option<f64>,
}

impl RateFilter {
    /// The rate of change (1/s) of a value at a sample, with a time constant (s).
    pub fn sample(&mut self, sample_time: f64, time_constant: f64, value: f64) -> f64 {
        let before = self.filtered.unwrap_or(value);
        let filtered = before + sample_time / (time_constant + sample_time) * (value - before);
        self.filtered = Some(filtered);
        (value - filtered) / time_constant
    }
}
