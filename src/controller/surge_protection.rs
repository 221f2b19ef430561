//! The surge valve: when the throttle shuts, the compressors' flow has nowhere to go, and they would surge.
//!
//! The controller sees boost pressure, not the throttle: with the flow blocked, boost rises more in one sample than the
//! wastegates can cause. The valve then opens at once, wider for a faster rise: a small flow needs a small opening, or
//! the low-pressure compressor would surge instead. It stays open for a while and shuts slowly; if the throttle is
//! still shut, the pressure rises again.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::variables::{Parameters, Real, SurgeProtectionParameters};
use crate::elementary::larger;

/// The memory of the valve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SurgeValve {
    /// Boost pressure at the last sample (Pa).
    before: Option<Real>,
    /// The remaining time the valve stays open (s).
    open_for: Real,
    opening: Real,
}

impl SurgeValve {
    /// The opening at a sample, from the boost pressure (Pa) and the one expected by the law (Pa).
    pub fn sample(
        &mut self,
        parameters: &Parameters,
        boost_pressure: Real,
        expected: impl FnOnce() -> Real,
    ) -> Real {
        let &Parameters { sample_time, ref surge_protection, .. } = parameters;
        let &SurgeProtectionParameters { rate, full_rate, excess, opening_time, closing_time } =
            surge_protection;
        let rise = boost_pressure - self.before.replace(boost_pressure).unwrap_or(boost_pressure);
        if rise > rate * sample_time && boost_pressure > expected() + excess {
            let wide = ramp(rise / sample_time, 0.0, full_rate);
            (self.opening, self.open_for) = (larger(self.opening, wide), opening_time);
        } else if self.open_for > 0.0 {
            self.open_for -= sample_time;
        } else {
            self.opening = larger(self.opening - sample_time / closing_time, 0.0);
        }
        self.opening
    }
}
