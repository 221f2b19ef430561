//! The law of control: feedforward and feedback of the paper's fig. 12, from the boost pressure to one duty.
//!
//! It is the same for both strategies, which differ in the schedule that they give it and in what the duty moves.

use fmu_export::Persistent;

use super::compensator::Limits;
use super::feedback::{FeedbackSettings, Firmness, Pid};
use super::reference_model::ReferenceModel;
use super::schedule::OperatingPoint;
use super::variables::{FeedbackStructure, Parameters};
use crate::elementary::larger;

/// A duty at nominal voltage as the sum of its terms (%).
#[derive(Clone, Copy, Debug)]
pub struct DutyTerms {
    pub feedforward: f64,
    pub proportional: f64,
    pub integral: f64,
    pub derivative: f64,
    /// The boost pressure (Pa) that the feedback compares with.
    pub reference_model_pressure: f64,
}

impl DutyTerms {
    /// A duty without feedback.
    pub fn feedforward(duty: f64, reference_model_pressure: f64) -> Self {
        Self {
            feedforward: duty,
            proportional: 0.0,
            integral: 0.0,
            derivative: 0.0,
            reference_model_pressure,
        }
    }

    pub fn duty(&self) -> f64 {
        self.feedforward + self.proportional + self.integral + self.derivative
    }
}

/// What the law is asked for at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a, const COLUMNS: usize> {
    /// The reference of the boost pressure (Pa).
    pub reference: f64,
    /// The measured boost pressure (Pa).
    pub measurement: f64,
    /// The schedule at the reference.
    pub operating_point: OperatingPoint<'a, COLUMNS>,
    /// The duty (%) that holds the pressure of the reference model where that is not the duty at rest.
    pub holding: Option<f64>,
    pub firmness: Firmness,
    pub limits: Limits,
    /// Those within which the duty moves the wastegate.
    pub model_limits: Limits,
    /// Whether the reference model waits for an engine that cannot follow.
    pub waits: bool,
}

/// The memory of the law.
#[derive(Clone, Copy, Debug, Default, Persistent)]
pub struct BoostLaw {
    pid: Pid,
    reference_model: ReferenceModel,
    /// What the limits took away from the duty at the last sample (%).
    blocked: f64,
}

impl BoostLaw {
    /// A controller at rest at a boost pressure (Pa).
    pub fn at(boost_pressure: f64) -> Self {
        Self {
            pid: Pid::at(boost_pressure),
            reference_model: ReferenceModel::at(boost_pressure),
            blocked: 0.0,
        }
    }

    /// The same with all pressures (Pa) converted.
    pub fn convert(&mut self, pressure: impl Fn(f64) -> f64) {
        self.pid.convert(&pressure);
        self.reference_model.convert(&pressure);
    }

    /// The boost pressure of the reference model (Pa).
    pub fn model_pressure(&self) -> f64 {
        self.reference_model.pressure
    }

    /// The duty at one sample.
    pub fn sample<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        task: &Task<'_, COLUMNS>,
    ) -> DutyTerms {
        let &Parameters { sample_time, lambda, .. } = parameters;
        let Task { reference, measurement, operating_point, holding, firmness, limits, model_limits, waits } =
            *task;
        let local_model = operating_point.local_model();
        let tuning = FeedbackSettings::new(&local_model, firmness.lambda).leading(firmness.lead);
        self.pid.differentiate(&tuning, firmness.derivative_filter, sample_time, measurement);

        let (feedforward, error, reference_model_pressure) = match parameters.structure {
            FeedbackStructure::Paper => (operating_point.feedforward(), reference - measurement, reference),
            FeedbackStructure::ModelReference => {
                let model = &mut self.reference_model;
                if waits && self.blocked * model.error(measurement) > 0.0 {
                    model.approach(measurement, sample_time / larger(lambda, sample_time));
                }
                let linearized = model.linearize(operating_point, holding);
                let unlimited = model.feedforward(&linearized, reference, lambda);
                let error = model.error(measurement);
                let pressure = model.pressure;
                if !(waits && self.blocked * error > 0.0) {
                    let duty = model_limits.clip(unlimited);
                    model.advance(&linearized, duty, local_model.delay, sample_time);
                }
                (if waits { limits.clip(unlimited) } else { unlimited }, error, pressure)
            }
        };
        let terms = DutyTerms {
            feedforward,
            proportional: tuning.gain * error,
            integral: self.pid.integral,
            derivative: self.pid.derivative,
            reference_model_pressure,
        };
        let duty = terms.duty();
        let cut = limits.clip(duty) - duty;
        self.pid.integrate(&tuning, sample_time, error, cut);
        self.blocked = cut;
        terms
    }
}
