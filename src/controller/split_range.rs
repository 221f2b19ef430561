//! The strategy `split_range`: one control law with one integrator commands a virtual duty that sets all three valves,
//! without switching or hysteresis, hence without bumps when one valve takes over from another.
//!
//! ```text
//! reference ─ lag ─ min ─ reference model ─ duty that holds its pressure, by the speed feedforward ─┐
//! shaft's limit ─────┘                                                                              + ─ limits ─ allocation
//! boost ─ filter ─ feedback, as firm as engine speed changes ───────────────────────────────────────┘
//! ```
//!
//! One law for any ambient conditions and engine speed: pressures, engine speeds and times are those of the schedule's
//! [`day`](super::day). All time constants follow from the actuator's lag, the time until boost responds to the duty.

use fmu_export::{Error, Persistent};

use super::allocation::{self, Bypass, Openings};
use super::compensator::{Compensator, Limits};
use super::day::Day;
use super::diagnosis::Asked;
use super::estimate::{Line, Measured};
use super::feedback::FeedbackSettings;
use super::feedforward;
use super::firmness::Firmness;
use super::lag::Lag;
use super::law::{BoostLaw, DutyTerms, Task};
use super::schedule::{self, LocalModel, OperatingPoint};
use super::shaft_speed_limit::{self, ShaftSpeedLimit};
use super::speed_feedforward;
use super::surge_protection::SurgeValve;
use super::variables::{ActiveLimit, FeedbackStructure, Inputs, Parameters, Real};
use super::{Command, Conditions};
use crate::elementary::{between, larger, smaller};

/// The strategy's memory, in addition to the law's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SplitRange {
    engine_speed: Line,
    firmness: Firmness,
    measured: Lag,
    asked: Lag,
    bypass: Bypass,
    shaft_speed: ShaftSpeedLimit,
    surge_valve: SurgeValve,
    /// The virtual duty at the last sample (%).
    virtual_duty: Real,
    /// The limit of the reference at the last sample (Pa, at reference conditions).
    limit: Real,
    /// The ambient conditions of the law's pressures.
    day: Day,
    /// By how much the limit of boost pressure is higher on the scheduled day (Pa); 0 at reference conditions.
    day_shift: Real,
}

impl SplitRange {
    /// The command at one sample. A measurement that the law expected already is not filtered.
    pub fn sample(
        &mut self,
        law: &mut BoostLaw,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
        is_measured: bool,
    ) -> Command {
        let &Parameters { sample_time, actuator_lag, ref allocation, .. } = parameters;
        let day = self.convert(law, parameters, inputs);
        let (engine_speed, rate) =
            self.engine_speed.sample(measured_engine_speed(parameters), inputs.engine_speed);
        let inputs = &Inputs { engine_speed, ..*inputs };
        let pressure = law.model_pressure();
        let pressure_here = day.pressure(pressure);
        let speed_factor = day.speed_factor(pressure_here, pressure);
        let engine_speed = speed_factor * inputs.engine_speed;
        let at = |pressure| {
            OperatingPoint::new(&parameters.range_schedule, pressure, engine_speed)
                .slower(day.time_scale(), 0.0)
        };
        // As fast as the actuator permits: its lag, and as much for λ of the firmest feedback.
        let model_lambda = larger(2.0 * actuator_lag, sample_time);
        let to_come = inputs.engine_speed + model_lambda * rate;
        let gain = || at(pressure).local_model().gain;
        let limit = self
            .shaft_speed
            .of_reference(parameters, &day, inputs, to_come, (self.virtual_duty, gain))
            .unwrap_or_else(|| shaft_speed_limit::scheduled_limit(parameters, engine_speed));
        self.limit = limit;

        let own_limits = allocation.limits(parameters, engine_speed, compensator);
        let excess = self.shaft_speed.excess(parameters, inputs.hp_turbo_speed);
        let least = excess.map_or(own_limits.least, |excess| {
            let holding = at(limit).extrapolated_feedforward(limit);
            larger(own_limits.least, shaft_speed_limit::least_duty(parameters, excess, holding))
        });
        let limits = Limits { least, ..own_limits };

        let changing = self.firmness.sample(parameters, rate);
        let firmness = if least > own_limits.least { Firmness::default() } else { changing };
        // Boost follows its reference with `reference_lambda` in all, slower by as much as the ambient conditions slow the
        // shafts: for a faster step the wastegate shuts, and opens too late.
        let reference_lag = match parameters.structure {
            FeedbackStructure::Paper => 0.0,
            FeedbackStructure::ModelReference => {
                parameters.reference_lambda * day.time_scale() - model_lambda
            }
        };
        let asked = feedforward::bounded_reference(parameters, inputs);
        let asked = self.asked.sample(sample_time, reference_lag, asked);
        let asked = day.scheduled_pressure(asked);
        let reference = smaller(asked, limit);
        let operating_point = at(reference);
        let local = operating_point.local_model();
        let (lambda, filter_time) = response(parameters, &local, engine_speed, firmness);
        let measurement_filter = if is_measured { filter_time } else { 0.0 };
        let measured = self.measured.sample(sample_time, measurement_filter, inputs.boost_pressure);
        let operating_point = operating_point.slower(day.time_scale(), filter_time);
        let local = LocalModel { delay: local.delay + filter_time, ..local };
        let (feedback, derivative_filter) = feedback(parameters, &local, lambda, firmness);

        let (rate, bypass) = (day.time_scale() * (speed_factor * rate), self.bypass.opening());
        let holding = speed_feedforward::holding_duty(parameters, pressure, engine_speed, rate, bypass);
        let mut terms = law.sample(
            parameters,
            &Task {
                reference,
                measurement: day.scheduled_pressure(measured),
                operating_point,
                holding,
                model_lambda,
                feedback,
                derivative_filter,
                limits,
                own_limits,
                stops_on_seat: true,
                knows_ambient_pressure: day.is_measured,
                integral_exponent: parameters.integral_exponent,
                is_measured,
                authority: Some(parameters.integral_authority),
            },
        );
        let virtual_duty = limits.clip(terms.duty());
        self.virtual_duty = virtual_duty;
        // The model's own, unless it waited.
        terms.reference_model_pressure = if terms.reference_model_pressure.to_bits() == pressure.to_bits() {
            pressure_here
        } else {
            day.pressure(terms.reference_model_pressure)
        };

        let duty_of_others = excess.map_or(virtual_duty, |excess| {
            shaft_speed_limit::duty_of_other_valves(parameters, excess, virtual_duty)
        });
        let mut openings = allocation.openings(duty_of_others, engine_speed);
        let asked = openings.hp_bypass * excess.map_or(1.0, shaft_speed_limit::bypass_share);
        openings.hp_bypass = self.bypass.sample(parameters, asked, virtual_duty);
        let expected = || day.pressure(larger(pressure, reference));
        openings.surge_valve = self.surge_valve.sample(parameters, inputs.boost_pressure, expected);
        let mut command = command(parameters, &day, terms, limits, openings);
        command.conditions = Conditions {
            reference_limit: limit,
            firmness: firmness.share(),
            day,
            active_limit: match limits.active(terms.duty()) {
                ActiveLimit::DutyMin if least > own_limits.least => ActiveLimit::LeastDutyOfShaft,
                ActiveLimit::None if law.correction().is_exhausted => ActiveLimit::IntegralAuthority,
                ActiveLimit::None if asked > limit => ActiveLimit::ShaftSpeed,
                ActiveLimit::None if inputs.boost_reference > parameters.boost_limit => {
                    ActiveLimit::BoostLimit
                }
                of_duty => of_duty,
            },
        };
        command
    }

    /// The measured ambient conditions, to whose pressures at reference conditions the law's memory is converted.
    fn convert(&mut self, law: &mut BoostLaw, parameters: &Parameters, inputs: &Inputs) -> Day {
        let day = Day::measured(parameters, inputs);
        if day != self.day {
            let before = core::mem::replace(&mut self.day, day);
            self.day_shift = day.scheduled_pressure(parameters.boost_limit) - parameters.boost_limit;
            law.convert(|pressure| day.scheduled_pressure(before.pressure(pressure)));
        }
        day
    }

    /// Follows a sample with all valves set for least boost; returns the opening of the bypass, which shuts.
    pub fn follow(&mut self, parameters: &Parameters, inputs: &Inputs) -> Real {
        self.engine_speed.sample(measured_engine_speed(parameters), inputs.engine_speed);
        self.bypass.shut(parameters)
    }

    /// Boost pressure (Pa) and engine speed (rpm) at reference conditions.
    pub fn on_scheduled_day(&self, inputs: &Inputs) -> (Real, Real) {
        let scheduled_pressure = self.day.scheduled_pressure(inputs.boost_pressure);
        let speed_factor = self.day.speed_factor(inputs.boost_pressure, scheduled_pressure);
        (scheduled_pressure, speed_factor * inputs.engine_speed)
    }

    /// What is asked for, at reference conditions.
    pub fn asked(&self, parameters: &Parameters, inputs: &Inputs) -> Asked {
        let by_driver = self.day.scheduled_pressure(feedforward::bounded_reference(parameters, inputs));
        Asked { by_driver, reference: smaller(by_driver, self.limit), day_shift: self.day_shift }
    }

    /// The boost pressure here (Pa) that a sound sensor should measure.
    pub fn expected_measurement(&self, law: &BoostLaw) -> Real {
        self.day.pressure(law.expected_measurement())
    }

    /// The law at rest at a boost pressure (Pa).
    pub fn law_at(&self, boost_pressure: Real) -> BoostLaw {
        BoostLaw::at(self.day.scheduled_pressure(boost_pressure))
    }
}

/// How engine speed (rpm) is measured.
fn measured_engine_speed(parameters: &Parameters) -> Measured {
    let &Parameters { sample_time, actuator_lag, ref measurement, .. } = parameters;
    Measured { sample_time, noise: measurement.engine_speed_noise, response: actuator_lag }
}

/// The command without memory: the virtual duty that holds the reference at rest.
pub fn at_rest(parameters: &Parameters, inputs: &Inputs, compensator: Compensator) -> Command {
    let day = Day::measured(parameters, inputs);
    let asked = feedforward::bounded_reference(parameters, inputs);
    let scheduled = day.scheduled_pressure(asked);
    let engine_speed = day.speed_factor(asked, scheduled) * inputs.engine_speed;
    let reference = smaller(scheduled, shaft_speed_limit::scheduled_limit(parameters, engine_speed));
    let holding = OperatingPoint::new(&parameters.range_schedule, reference, engine_speed).feedforward();
    let limits = parameters.allocation.limits(parameters, engine_speed, compensator);
    let openings = parameters.allocation.openings(limits.clip(holding), engine_speed);
    command(parameters, &day, DutyTerms::feedforward(holding, day.pressure(reference)), limits, openings)
}

/// λ of the feedback for a local model at an engine speed (rpm), and the time constant of the measurement's filter (s).
fn response(
    parameters: &Parameters,
    model: &LocalModel,
    engine_speed: Real,
    firmness: Firmness,
) -> (Real, Real) {
    match parameters.structure {
        FeedbackStructure::Paper => {
            let &Parameters { lambda, feedback_lambda, ref allocation, .. } = parameters;
            (between(lambda, feedback_lambda, allocation.low_pressure_share(engine_speed)), 0.0)
        }
        FeedbackStructure::ModelReference => {
            let lambda = firmness.lambda(parameters, model);
            (lambda, larger(lambda - parameters.actuator_lag, 0.0))
        }
    }
}

/// The settings of the feedback for a local model with a λ (s), and its derivative time over the time constant of the
/// derivative filter.
fn feedback(
    parameters: &Parameters,
    model: &LocalModel,
    lambda: Real,
    firmness: Firmness,
) -> (FeedbackSettings, Real) {
    let settings = FeedbackSettings::new(model, lambda);
    match parameters.structure {
        FeedbackStructure::Paper => (settings, parameters.derivative_filter),
        FeedbackStructure::ModelReference => {
            let settings = settings.with_lead(firmness.lead(parameters));
            // Over one sample: a slower filter would cost the lead.
            (settings, larger(settings.derivative_time / parameters.sample_time, 1.0))
        }
    }
}

fn command(
    parameters: &Parameters,
    day: &Day,
    terms: DutyTerms,
    limits: Limits,
    openings: Openings,
) -> Command {
    let hp_duty = day.duty(parameters, smaller(limits.clip(terms.duty()), parameters.pwm_max));
    Command { hp_duty, ..Command::new(terms, limits, openings) }
}

/// Rejects contradictory parameters of the strategy.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    allocation::check(parameters)?;
    schedule::check("range_schedule", &parameters.range_schedule)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pressures scale about with ambient pressure, of which the limit of boost is less than three times.
    #[test]
    fn ambient_pressure_near_that_of_the_schedule_shifts_pressures_by_little() {
        let parameters = Parameters::default();
        let shift = |deficit: Real| {
            let ambient_pressure = parameters.nominal_ambient_pressure - deficit;
            let inputs = Inputs { ambient_pressure, ..Inputs::default() };
            let mut split_range = SplitRange::default();
            split_range.convert(&mut BoostLaw::at(150e3), &parameters, &inputs);
            split_range.asked(&parameters, &inputs).day_shift
        };
        assert!(shift(0.0) == 0.0, "{}", shift(0.0));
        assert!((0.0..3.0).contains(&shift(1.0).abs()) && shift(1.0) != 0.0, "{}", shift(1.0));
    }
}
