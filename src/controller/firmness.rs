//! How firm the feedback is: at rest as gentle as the vacuum needs, on engine speed ramps as fast as the actuator
//! permits.
//!
//! Measurement noise moves the wastegate, and each movement costs vacuum. So at rest λ exceeds the actuator's lag, and a
//! filter of the measurement takes up the difference, which the local model knows as a delay. A ramp lasts seconds, which
//! the tank sustains: there λ is the actuator's lag, the measurement is not filtered, and the derivative term leads by
//! the lag, as in a Smith predictor for an integrating plant, which the shafts are on that time scale.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::schedule::LocalModel;
use super::variables::{Parameters, Real};
use crate::elementary::{between, larger};

/// The largest gain at rest (%/Pa): the vacuum sustains 100 Pa of noise with it where the engine responds least to the
/// duty, at 1000 rpm, 112 kPa or 2250 rpm, 130 kPa.
const LARGEST_GAIN: Real = 4e-3;

/// The rate of engine speed (rpm/s) from which a ramp is fast: with it the pump sustains 50 Pa of noise on endless
/// ramps of 700 rpm/s, which it does not with 500 rpm/s.
const FAST_RAMP: Real = 1e3;

/// The time (s) in which a ramp's firmness fades: the longest time constant of the schedule, as the shafts take that
/// long to follow the ramp.
const FADING_TIME: Real = 2.0;

/// The firmness of the feedback, from 0 at rest to 1 on a fast ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Firmness {
    share: Real,
}

impl Firmness {
    /// Takes a rate of engine speed (rpm/s): its magnitude counts at once, and fades.
    pub fn sample(&mut self, parameters: &Parameters, rate: Real) -> Self {
        let faded = self.share - parameters.sample_time / FADING_TIME;
        self.share = larger(ramp(rate.abs(), 0.0, FAST_RAMP), faded);
        *self
    }

    /// The share of the firmest feedback.
    pub fn share(self) -> Real {
        self.share
    }

    /// λ of the feedback (s) for a local model: at rest at least `feedback_lambda`, and longer where its gain would exceed
    /// [`LARGEST_GAIN`].
    pub fn lambda(self, parameters: &Parameters, model: &LocalModel) -> Real {
        let of_largest_gain = model.time_constant / (LARGEST_GAIN * model.gain.abs()) - 0.5 * model.delay;
        let at_rest = larger(parameters.feedback_lambda, of_largest_gain);
        between(at_rest, parameters.actuator_lag, self.share)
    }

    /// The lead (s) of the derivative term.
    pub fn lead(self, parameters: &Parameters) -> Real {
        self.share * parameters.actuator_lag
    }
}
