//! The strategy `split_range`: one control law with one integrator commands a virtual duty that sets all three valves,
//! without switching or hysteresis, hence without bumps when one valve takes over from another.
//!
//! ```text
//! reference ─ limit ─ reference model ─ feedforward ─ + ─ virtual duty ─ allocation ┬─ high-pressure wastegate
//!                          │   change of engine speed │                             ├─ low-pressure wastegate
//!                          └─────── feedback ─────────┘                             └─ lag ─ bypass
//! ```

use fmu_export::{Error, Persistent};

use super::Command;
use super::actuator_inverse;
use super::allocation::{self, Bypass, Openings};
use super::compensator::{Compensator, Limits};
use super::day::Day;
use super::duty_lead::DutyLead;
use super::feedforward;
use super::law::{BoostLaw, DutyTerms, Task};
use super::off_schedule::{self, LeadingRate, Motion, ReferenceFilter};
use super::rate_filter::RateFilter;
use super::schedule;
use super::shaft_speed_limit::{self, ShaftSpeedLimit};
use super::speed_feedforward;
use super::surge_protection::SurgeValve;
use super::variables::{Inputs, Parameters};
use crate::elementary::{between, larger, smaller};

/// The strategy's memory, in addition to the law's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SplitRange {
    engine_speed: RateFilter,
    leading_rate: LeadingRate,
    motion: Motion,
    asked: ReferenceFilter,
    bypass: Bypass,
    duty_lead: DutyLead,
    shaft_speed: ShaftSpeedLimit,
    surge_valve: SurgeValve,
    /// The virtual duty at the last sample (%).
    virtual_duty: f64,
    /// The limited reference at the last sample (Pa, at reference conditions).
    reference: f64,
    /// The ambient conditions of the law's pressures.
    day: Day,
}

impl SplitRange {
    /// The command at one sample.
    pub fn sample(
        &mut self,
        law: &mut BoostLaw,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
    ) -> Command {
        let &Parameters { sample_time, ref allocation, .. } = parameters;
        let day = Day::measured(parameters, inputs);
        if day != self.day {
            let before = std::mem::replace(&mut self.day, day);
            law.convert(|pressure| day.scheduled_pressure(before.pressure(pressure)));
        }
        let (pressure, bypass) = (law.model_pressure(), self.bypass.opening());
        let factor = day.speed_factor(pressure);
        let engine_speed = factor * inputs.engine_speed;
        // The sensitivity scales with the time constants.
        let filter_time = off_schedule::filter_time(parameters, &day);
        let acceleration = self.engine_speed.sample(sample_time, filter_time, inputs.engine_speed);
        self.motion.sample(sample_time, acceleration);
        let motion = self.motion.at(parameters, &day, engine_speed);
        let model_lambda = motion.model_lambda(parameters);
        let leading = self.leading_rate.sample(parameters, &day, acceleration);
        let rate = day.time_scale() * (factor * leading);
        let measurement = day.scheduled_pressure(inputs.boost_pressure);
        let limit = match shaft_speed_limit::measured(inputs.hp_turbo_speed) {
            None => scheduled_limit(parameters, engine_speed),
            Some(speed) => {
                let limit_at = |speed| {
                    day.limit_of_shaft(speed, |speed| shaft_speed_limit::uncapped_limit(parameters, speed))
                };
                let here = limit_at(inputs.engine_speed);
                // Boost lags its reference by λ, and the rate by the filter: take a rising limit that far ahead.
                let ahead = model_lambda + filter_time;
                let to_come = limit_at(larger(inputs.engine_speed + ahead * acceleration, 0.0));
                let gain = day.operating_point(parameters, pressure, engine_speed).local_model().gain;
                let margin = shaft_speed_limit::margin(parameters, speed, self.virtual_duty, gain);
                let above = measurement + margin - here;
                larger(here, to_come) + self.shaft_speed.correction(parameters, above, speed)
            }
        };
        let asked = feedforward::bounded_reference(parameters, inputs);
        let asked = self.asked.sample(sample_time, motion.reference_filter_time(parameters, &day), asked);
        let reference = smaller(day.scheduled_pressure(asked), limit);
        self.reference = reference;
        let own_limits = allocation.limits(parameters, engine_speed, compensator);
        let at = |pressure| day.operating_point(parameters, pressure, engine_speed);
        let (mut limits, mut firm) = (own_limits, motion);
        let mut waits = day.off_reference;
        let excess = self.shaft_speed.excess(
            parameters,
            inputs.hp_turbo_speed,
            off_schedule::shaft_speed_allowance(parameters, &day),
        );
        if let Some(excess) = excess {
            let holding = at(limit).extrapolated_feedforward(limit);
            let least = shaft_speed_limit::least_duty(parameters, excess, holding);
            if least > limits.least {
                (limits.least, firm) = (least, Motion::default());
                if !motion.changed_lately() {
                    waits = 0.0;
                }
            }
        }
        let expected = day.pressure(larger(pressure, reference));
        let surge_valve = self.surge_valve.sample(parameters, inputs.boost_pressure, expected);
        let terms = law.sample(
            parameters,
            &Task {
                reference,
                measurement,
                operating_point: at(reference).slower(day.time_scale()),
                holding: speed_feedforward::holding_duty(
                    parameters,
                    &day,
                    pressure,
                    engine_speed,
                    rate,
                    bypass,
                ),
                model_lambda,
                firmness: firm.firmness(parameters, engine_speed),
                limits,
                own_limits,
                overridden: day.off_reference,
                model_limits: model_limits(parameters, limits, own_limits, day.off_reference),
                ramp: motion.ramp(acceleration),
                waits,
                integral_exponent: motion.integral_exponent(parameters),
            },
        );
        let virtual_duty = limits.clip(terms.duty());
        self.virtual_duty = virtual_duty;
        let duty_of_others = excess.map_or(virtual_duty, |excess| {
            shaft_speed_limit::duty_of_other_valves(parameters, excess, virtual_duty)
        });
        let mut asked = allocation.openings(duty_of_others, engine_speed);
        asked.hp_bypass *= excess.map_or(1.0, shaft_speed_limit::bypass_share);
        let hp_bypass = self.bypass.sample(parameters, asked.hp_bypass, virtual_duty);
        let openings = Openings { hp_bypass, surge_valve, ..asked };
        let command = command(parameters, &day, terms, limits, openings);
        Command { hp_duty: self.duty_lead.sample(parameters, &day, command.hp_duty), ..command }
    }

    /// The inputs and the boost pressure reference (Pa) at the last sample, and the pressure (Pa) of the largest
    /// reference, all at reference conditions.
    pub fn on_scheduled_day(&self, parameters: &Parameters, inputs: &Inputs) -> (Inputs, f64, f64) {
        let day = &self.day;
        let boost_pressure = day.scheduled_pressure(inputs.boost_pressure);
        let engine_speed = day.speed_factor(boost_pressure) * inputs.engine_speed;
        let largest = day.scheduled_pressure(parameters.boost_limit);
        (Inputs { boost_pressure, engine_speed, ..*inputs }, self.reference, largest)
    }
}

/// The command without memory: the virtual duty that holds the reference at rest.
pub fn at_rest(parameters: &Parameters, inputs: &Inputs, compensator: Compensator) -> Command {
    let day = Day::measured(parameters, inputs);
    let asked = day.scheduled_pressure(feedforward::bounded_reference(parameters, inputs));
    let engine_speed = day.speed_factor(asked) * inputs.engine_speed;
    let reference = smaller(asked, scheduled_limit(parameters, engine_speed));
    let holding = day.operating_point(parameters, reference, engine_speed).feedforward();
    let limits = parameters.allocation.limits(parameters, engine_speed, compensator);
    let openings = parameters.allocation.openings(limits.clip(holding), engine_speed);
    command(parameters, &day, DutyTerms::feedforward(holding, reference), limits, openings)
}

/// The limits within which the duty moves the reference model. At reference conditions the model is valid up to the
/// limits that protect the shaft, and waits at them. Off reference conditions, by a share (0 to 1), they are the law's own
/// limits where the high-pressure wastegate is off its seat.
fn model_limits(parameters: &Parameters, limits: Limits, own_limits: Limits, off_reference: f64) -> Limits {
    if off_reference == 0.0 {
        return limits;
    }
    let lift_off = actuator_inverse::duty(&parameters.actuator_inverse, 0.0);
    let least = between(limits.least, larger(own_limits.least, lift_off), off_reference);
    Limits { least, ..limits }
}

fn command(
    parameters: &Parameters,
    day: &Day,
    mut terms: DutyTerms,
    limits: Limits,
    openings: Openings,
) -> Command {
    let hp_duty = day.duty(parameters, smaller(limits.clip(terms.duty()), parameters.pwm_max));
    terms.reference_model_pressure = day.pressure(terms.reference_model_pressure);
    Command { terms, limits, hp_duty, openings }
}

/// The reference limit that keeps the high-pressure shaft within its speed at rest (Pa, at reference conditions).
fn scheduled_limit(parameters: &Parameters, engine_speed: f64) -> f64 {
    let schedule = &parameters.range_schedule;
    schedule::interpolate(&schedule.engine_speed, &schedule.boost_limit, engine_speed)
}

/// Rejects contradictory parameters of the strategy.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    allocation::check(parameters)?;
    schedule::check("range_schedule", &parameters.range_schedule)
}
