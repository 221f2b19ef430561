//! The feedforward's error on a fast engine speed ramp, as found by the feedback.
//!
//! The integral term does not help there: the error is gone when the ramp ends, but the term would persist. This one is
//! proportional to the engine speed rate and ends with the ramp.

use fmu_export::Persistent;

use super::feedback::FeedbackSettings;

/// An engine speed ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    /// The rate of engine speed (rpm/s).
    pub rate: f64,
    /// 1 if this term does the integral action, 0 if the integral term does.
    pub share: f64,
}

/// The memory of the term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct RampTerm {
    /// The term over the engine speed rate (% s/rpm).
    duty_by_rate: f64,
}

impl RampTerm {
    /// The duty (%) on a ramp.
    pub fn duty(self, ramp: Ramp) -> f64 {
        self.duty_by_rate * ramp.rate
    }

    /// Updates the term for the next sample with the error (Pa). It restarts with each ramp.
    pub fn integrate(&mut self, tuning: &FeedbackSettings, sample_time: f64, error: f64, ramp: Ramp) {
        if ramp.share > 0.0 {
            self.duty_by_rate += sample_time * tuning.integral_gain * error * ramp.share / ramp.rate;
        } else {
            *self = Self::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::controller::schedule::LocalModel;

    const SAMPLE_TIME: f64 = 0.0125;

    #[test]
    fn it_is_the_integral_of_the_error_along_a_ramp_and_ends_with_it() {
        let model = LocalModel { gain: -2000.0, time_constant: 0.5, delay: 0.0 };
        let tuning = FeedbackSettings::new(&model, 0.1);
        // Falling and rising, of an error (Pa) that lasts for a second.
        for rate in [-2000.0, 500.0] {
            let mut term = RampTerm::default();
            let error = 1000.0;
            for _ in 0..80 {
                term.integrate(&tuning, SAMPLE_TIME, error, Ramp { rate, share: 1.0 });
            }
            // The round-off of 80 sums.
            let expected = tuning.integral_gain * error;
            assert!((term.duty(Ramp { rate, share: 1.0 }) / expected - 1.0).abs() < 1e-13);
            // At half the rate half of it is left, and without a ramp nothing.
            assert!((term.duty(Ramp { rate: rate / 2.0, share: 0.2 }) / expected - 0.5).abs() < 1e-13);
            assert!(term.duty(Ramp::default()).abs() < f64::MIN_POSITIVE);
            term.integrate(&tuning, SAMPLE_TIME, error, Ramp::default());
            assert_eq!(term, RampTerm::default());
        }
    }
}
