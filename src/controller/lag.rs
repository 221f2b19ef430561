//! A first-order lag, and the rate of change filtered with it.

use fmu_export::Persistent;

use super::variables::Real;

/// A signal behind another by a time constant, by backward differences: stable for any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Lag {
    /// The lagged signal; none before the first sample.
    value: Option<Real>,
}

impl Lag {
    /// The lagged signal at a sample, with a time constant (s), or the signal itself without one. It starts at the signal.
    pub fn sample(&mut self, sample_time: Real, time_constant: Real, signal: Real) -> Real {
        let before = self.value.unwrap_or(signal);
        let value = if time_constant > 0.0 {
            before + sample_time / (time_constant + sample_time) * (signal - before)
        } else {
            signal
        };
        self.value = Some(value);
        value
    }

    /// The rate of change of a signal (1/s) at a sample, filtered with a time constant (s).
    pub fn rate(&mut self, sample_time: Real, time_constant: Real, signal: Real) -> Real {
        (signal - self.sample(sample_time, time_constant, signal)) / time_constant
    }
}
