//! The strategy `by_speed`: engine speed selects the working turbocharger (paper, sections 3.1 and 6).
//!
//! At low speed the low-pressure wastegate is shut and the small high-pressure stage provides boost. Above, the
//! low-pressure wastegate opens with engine speed. At high speed the high-pressure compressor would choke: it is
//! bypassed, its wastegate is fully open, and the low-pressure wastegate limits boost.
//!
//! The modes `position` and `open_loop` also use it for the other valves.

use fmu_export::display::Rounded;
use fmu_export::{Context, Error, Persistent};

use super::Command;
use super::allocation::Openings;
use super::compensator::Limits;
use super::feedback::FeedbackSettings;
use super::feedforward;
use super::law::{BoostLaw, DutyTerms, Task};
use super::schedule::{self, OperatingPoint};
use super::variables::{ControlMode, Inputs, Parameters, Real};
use crate::elementary::smaller;

/// The strategy's memory, in addition to the law's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct BySpeed {
    /// Whether the high-pressure stage is bypassed.
    bypassed: bool,
    low_pressure: LowPressureLoop,
}

impl BySpeed {
    /// The command of mode boost at one sample; `is_measured` tells a boost measurement from what the law expects.
    pub fn sample(
        &mut self,
        law: &mut BoostLaw,
        parameters: &Parameters,
        inputs: &Inputs,
        limits: Limits,
        is_measured: bool,
    ) -> Command {
        let &Inputs { engine_speed, boost_pressure: measurement, .. } = inputs;
        let reference = feedforward::bounded_reference(parameters, inputs);
        if self.bypasses(parameters, engine_speed) {
            // The law's memory follows boost pressure, for a bumpless start when it takes over again.
            *law = BoostLaw::at(measurement);
            let openings = Openings {
                lp_wastegate: self.low_pressure.sample(parameters, measurement - reference),
                hp_bypass: 1.0,
                surge_valve: 0.0,
            };
            return Command::new(DutyTerms::feedforward(parameters.pwm_max, measurement), limits, openings);
        }
        self.low_pressure = LowPressureLoop::default();
        let &Parameters { lambda, derivative_filter, .. } = parameters;
        let operating_point = OperatingPoint::new(&parameters.schedule, reference, engine_speed);
        let terms = law.sample(
            parameters,
            &Task {
                reference,
                measurement,
                operating_point,
                holding: None,
                model_lambda: lambda,
                feedback: FeedbackSettings::new(&operating_point.local_model(), lambda),
                derivative_filter,
                limits,
                own_limits: limits,
                stops_on_seat: false,
                knows_ambient_pressure: false,
                integral_exponent: 0.0,
                is_measured,
                authority: None,
            },
        );
        let openings = Openings {
            lp_wastegate: lp_wastegate(parameters, engine_speed),
            hp_bypass: 0.0,
            surge_valve: 0.0,
        };
        Command::new(terms, limits, openings)
    }

    /// The command without feedback, in any mode.
    pub fn without_feedback(&mut self, parameters: &Parameters, inputs: &Inputs, limits: Limits) -> Command {
        let reference = feedforward::bounded_reference(parameters, inputs);
        let bypassed = self.bypasses(parameters, inputs.engine_speed);
        let duty = if bypassed && parameters.mode == ControlMode::Boost {
            parameters.pwm_max
        } else {
            feedforward::at_rest(parameters, inputs)
        };
        // With the high-pressure stage bypassed, the low-pressure wastegate is shut except in mode boost.
        let openings = if bypassed {
            Openings { lp_wastegate: 0.0, hp_bypass: 1.0, surge_valve: 0.0 }
        } else {
            Openings {
                lp_wastegate: lp_wastegate(parameters, inputs.engine_speed),
                hp_bypass: 0.0,
                surge_valve: 0.0,
            }
        };
        Command::new(DutyTerms::feedforward(duty, reference), limits, openings)
    }

    /// Whether the high-pressure stage is bypassed at an engine speed (rpm): from the limit, until the speed falls
    /// below it by the hysteresis.
    fn bypasses(&mut self, parameters: &Parameters, engine_speed: Real) -> bool {
        let until = parameters.lp_wastegate_open_above;
        let from = if self.bypassed { until - parameters.stage_hysteresis } else { until };
        self.bypassed = engine_speed >= until || engine_speed > from;
        self.bypassed
    }

    /// Logs changes of the bypass since a sample.
    pub fn log_since(&self, before: Self, inputs: &Inputs, context: &mut Context<'_>) {
        if self.bypassed != before.bypassed {
            let (state, speed) =
                (if self.bypassed { "bypassed" } else { "active" }, Rounded(inputs.engine_speed));
            context.event(format_args!("high-pressure stage {state}, {speed} rpm"));
        }
    }
}

/// The low-pressure wastegate opening at an engine speed (rpm) while the high-pressure stage works: shut up to one
/// limit, fully open at the other, linear between.
fn lp_wastegate(parameters: &Parameters, engine_speed: Real) -> Real {
    let (shut, open) = (parameters.lp_wastegate_close_below, parameters.lp_wastegate_open_above);
    if engine_speed <= shut {
        0.0
    } else if engine_speed >= open {
        1.0
    } else {
        (engine_speed - shut) / (open - shut)
    }
}

/// Boost control by the low-pressure wastegate: PI with tracking anti-windup.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
struct LowPressureLoop {
    /// The integral term of the opening; none before the first sample.
    integral: Option<Real>,
}

impl LowPressureLoop {
    /// The wastegate opening for a boost error (Pa), positive above the reference. It starts shut.
    fn sample(&mut self, parameters: &Parameters, error: Real) -> Real {
        let proportional = parameters.low_pressure_gain * error;
        let integral = self.integral.unwrap_or(-proportional);
        let unlimited = proportional + integral;
        let opening = unlimited.clamp(0.0, 1.0);
        let share = parameters.sample_time / parameters.low_pressure_integral_time;
        // Tracking takes at least one sample; a larger share would be unstable.
        let tracking = smaller(share, 1.0);
        self.integral = Some(integral + share * proportional + tracking * (opening - unlimited));
        opening
    }
}

/// Rejects contradictory parameters of the strategy.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    let (shut, open) = (parameters.lp_wastegate_close_below, parameters.lp_wastegate_open_above);
    if shut < open {
        return schedule::check("schedule", &parameters.schedule);
    }
    Err(Error::new(format_args!(
        "lp_wastegate_close_below is {shut} rpm and must be below lp_wastegate_open_above, which is {open} rpm"
    )))
}
