//! How firm the feedback is: at rest as gentle as the vacuum needs, on engine speed ramps as fast as the actuator lets
//! it.
//!
//! Measurement noise moves the wastegate, and each movement costs vacuum, so that noise sets the shortest λ at rest. A
//! ramp lasts seconds, which the tank sustains: there λ is the actuator's lag, and the derivative term leads by it, as in
//! a Smith predictor for an integrating plant, which the shafts are on that time scale.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::feedback::FeedbackSettings;
use super::schedule::LocalModel;
use super::variables::{FirmnessParameters, Parameters};
use crate::elementary::{between, larger};

/// From 0 at rest to 1 on a fast ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Firmness {
    share: f64,
}

impl Firmness {
    /// Takes a rate of engine speed (rpm/s): its magnitude counts at once, and fades.
    pub fn sample(&mut self, parameters: &Parameters, rate: f64) -> Self {
        let &FirmnessParameters { full_rate, fading_time } = &parameters.firmness;
        let faded = self.share - parameters.sample_time / fading_time;
        self.share = larger(ramp(rate.abs(), 0.0, full_rate), faded);
        *self
    }

    /// The feedback for a local model.
    pub fn feedback(self, parameters: &Parameters, model: &LocalModel) -> FeedbackSettings {
        let &Parameters { feedback_lambda, actuator_lag, derivative_filter, sample_time, .. } = parameters;
        let lambda = between(feedback_lambda, actuator_lag, self.share);
        FeedbackSettings::new(model, lambda, derivative_filter)
            .leading(self.share * actuator_lag, sample_time)
    }
}
