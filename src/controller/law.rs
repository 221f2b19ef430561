//! The control law: feedforward and feedback of the paper's fig. 12, from boost pressure to one duty.
//!
//! Both strategies use it; they differ in the schedule and in what the duty moves.

use fmu_export::Persistent;

use super::actuator_inverse;
use super::compensator::Limits;
use super::feedback::{FeedbackSettings, Pid};
use super::reference_model::ReferenceModel;
use super::schedule::OperatingPoint;
use super::variables::{FeedbackStructure, Parameters, Real};

/// A duty at nominal voltage as the sum of its terms (%).
#[derive(Clone, Copy, Debug, Default)]
pub struct DutyTerms {
    pub feedforward: Real,
    pub proportional: Real,
    pub integral: Real,
    pub derivative: Real,
    /// The boost pressure (Pa) used by the feedback for comparison.
    pub reference_model_pressure: Real,
}

impl DutyTerms {
    /// A duty without feedback.
    pub fn feedforward(duty: Real, reference_model_pressure: Real) -> Self {
        Self { feedforward: duty, reference_model_pressure, ..Self::default() }
    }

    pub fn duty(&self) -> Real {
        self.feedforward + self.proportional + self.integral + self.derivative
    }
}

/// The law's inputs at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a, const COLUMNS: usize> {
    /// The boost pressure reference (Pa).
    pub reference: Real,
    /// The measured boost pressure (Pa).
    pub measurement: Real,
    /// The schedule at the reference.
    pub operating_point: OperatingPoint<'a, COLUMNS>,
    /// The duty (%) that holds the reference model's pressure, if not the duty at rest.
    pub holding: Option<Real>,
    /// λ of the reference model (s).
    pub model_lambda: Real,
    pub feedback: FeedbackSettings,
    /// Derivative time over the time constant of the derivative filter.
    pub derivative_filter: Real,
    pub limits: Limits,
    /// The limits without those that protect the shaft.
    pub own_limits: Limits,
    /// Whether the feedforward is limited, from below where the high-pressure wastegate is on its seat. Not in the
    /// strategy `by_speed`, on whose results users rely.
    pub stops_on_seat: bool,
    /// Whether ambient pressure is measured, so that an engine that cannot follow is known from one in thin air: the
    /// reference model then waits for it, the integral term does not wind up while the wastegate is on its seat, and its
    /// authority is limited.
    pub knows_ambient_pressure: bool,
    /// The exponent for rescaling the integral term with the engine's gain: 0 keeps it as a duty, 1 as a pressure.
    pub integral_exponent: Real,
    /// Whether the measurement is one, and not what the law expects, from which the integral term would learn nothing.
    pub is_measured: bool,
    /// How far the integral term may move boost at rest by the schedule (Pa), if it is limited.
    pub authority: Option<Real>,
}

/// What the integral term corrects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Correction {
    /// How far the integral term moves boost at rest (Pa).
    pub pressure: Real,
    /// Whether the integral term is at the limit of its authority.
    pub is_exhausted: bool,
}

/// The memory of the law.
#[derive(Clone, Copy, Debug, Default, Persistent)]
pub struct BoostLaw {
    pid: Pid,
    reference_model: ReferenceModel,
    /// The reference model's gain at the last sample (Pa/%), if the integral term is rescaled.
    gain: Option<Real>,
    /// The part of the duty without effect at the last sample, cut off by its own limits or by the seat (%).
    blocked: Real,
    correction: Correction,
}

impl BoostLaw {
    /// A controller at rest at a boost pressure (Pa).
    pub fn at(boost_pressure: Real) -> Self {
        Self {
            pid: Pid::at(boost_pressure),
            reference_model: ReferenceModel::at(boost_pressure),
            ..Self::default()
        }
    }

    /// The law with an integral term (%).
    pub fn with_integral(mut self, integral: Real) -> Self {
        self.pid.integral = integral;
        self
    }

    /// Converts all pressures (Pa).
    pub fn convert(&mut self, pressure: impl Fn(Real) -> Real) {
        self.pid.convert(&pressure);
        self.reference_model.convert(&pressure);
    }

    /// The boost pressure of the reference model (Pa).
    pub fn model_pressure(&self) -> Real {
        self.reference_model.pressure
    }

    /// The boost pressure (Pa) that a sound sensor should measure.
    pub fn expected_measurement(&self) -> Real {
        self.reference_model.expected_measurement()
    }

    /// The part of the duty cut off by its own limits at the last sample (%), by which the integral term winds down.
    pub fn blocked(&self) -> Real {
        self.blocked
    }

    /// What the integral term corrected at the last sample.
    pub fn correction(&self) -> Correction {
        self.correction
    }

    /// The duty at one sample.
    pub fn sample<const COLUMNS: usize>(
        &mut self,
        parameters: &Parameters,
        task: &Task<'_, COLUMNS>,
    ) -> DutyTerms {
        let sample_time = parameters.sample_time;
        let &Task { reference, measurement, operating_point, ref feedback, .. } = task;
        self.pid.differentiate(feedback, task.derivative_filter, sample_time, measurement);
        // The nearest duty that makes a difference. The shaft's limits would take the model too far from the engine.
        let moving = |duty| {
            let within = task.own_limits.clip(duty);
            if task.stops_on_seat {
                actuator_inverse::effective_duty(&parameters.actuator_inverse, within)
            } else {
                within
            }
        };

        let (feedforward, error, reference_model_pressure) = match parameters.structure {
            FeedbackStructure::Paper => (operating_point.feedforward(), reference - measurement, reference),
            FeedbackStructure::ModelReference => {
                let model = &mut self.reference_model;
                let waits = task.knows_ambient_pressure && self.blocked * model.error(measurement) > 0.0;
                if waits {
                    model.approach(measurement, sample_time / task.model_lambda);
                }
                let linearized = model.linearize(operating_point, task.holding);
                if let Some(before) = self.gain {
                    self.pid.rescale(before / linearized.gain, task.integral_exponent);
                }
                self.gain = (task.integral_exponent > 0.0).then_some(linearized.gain);
                let (error, pressure) = (model.error(measurement), model.pressure);
                let asked = model.feedforward(&linearized, reference, task.model_lambda);
                let duty = moving(asked);
                let delay = operating_point.local_model().delay;
                if !waits {
                    model.advance(&linearized, duty, delay, sample_time);
                }
                // What the engine gets but not the model, the integral term would have to make up for.
                (if task.stops_on_seat { duty } else { asked }, error, pressure)
            }
        };
        let terms = DutyTerms {
            feedforward,
            proportional: feedback.gain * error,
            integral: self.pid.integral,
            derivative: self.pid.derivative,
            reference_model_pressure,
        };
        let duty = terms.duty();
        // While the shaft's limits override the duty, the integral term is frozen: the feedback cannot correct the
        // error, and the term would be too large when the limits release.
        let error = if task.limits.clip(duty) > task.own_limits.clip(duty) { 0.0 } else { error };
        let effective = if task.knows_ambient_pressure { moving(duty) } else { task.own_limits.clip(duty) };
        self.blocked = effective - duty;
        if task.is_measured {
            self.pid.integrate(feedback, sample_time, error, self.blocked);
        }
        if let Some(authority) = task.authority {
            let range = operating_point.correction(self.reference_model.pressure, authority);
            let integral = self.pid.integral;
            // Without a measured ambient pressure, thin air looks like a sensor's drift.
            if task.knows_ambient_pressure {
                self.pid.integral = range.clip(integral);
            }
            let share = if integral < 0.0 { -integral / range.least } else { integral / range.most };
            // At a limit of the duty, the engine and not the term is at its end.
            let is_exhausted = !range.contain(integral) && self.blocked == 0.0;
            self.correction = Correction { pressure: -share * authority, is_exhausted };
        }
        terms
    }
}
