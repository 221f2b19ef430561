//! The strategy `split_range`: one law of control with one integrator commands a virtual duty, from which all three
//! valves are set. No switch and no hysteresis, hence no bump where one valve takes over from another.
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
use super::feedforward;
use super::law::{BoostLaw, DutyTerms, Task};
use super::schedule;
use super::shaft_speed_limit::{self, ShaftSpeedLimit};
use super::speed_feedforward::{self, SpeedFilter};
use super::surge_protection::SurgeValve;
use super::variables::{Inputs, Parameters};
use crate::elementary::{larger, smaller};

/// The memory of the strategy, beside the law's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SplitRange {
    engine_speed: SpeedFilter,
    bypass: Bypass,
    shaft_speed: ShaftSpeedLimit,
    surge_valve: SurgeValve,
    /// The day of the law's pressures.
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
        let &Parameters { lambda, feedback_lambda, ref allocation, .. } = parameters;
        let day = Day::measured(parameters, inputs);
        if day != self.day {
            let before = std::mem::replace(&mut self.day, day);
            law.convert(|pressure| day.scheduled_pressure(before.pressure(pressure)));
        }
        let (pressure, bypass) = (law.model_pressure(), self.bypass.opening());
        let factor = day.speed_factor(pressure);
        let engine_speed = factor * inputs.engine_speed;
        // The sensitivity grows with the time constants.
        let rate = day.time_scale() * (factor * self.engine_speed.sample(parameters, inputs.engine_speed));
        let (reference, limit) = references(parameters, inputs, &day, engine_speed);
        let mut limits = allocation.limits(parameters, engine_speed, compensator);
        let at = |pressure| day.operating_point(parameters, pressure, engine_speed);
        let holding = at(limit).feedforward();
        let mut waits = day.is_other;
        let excess = self.shaft_speed.excess(parameters, inputs.hp_turbo_speed);
        let least = excess.map(|excess| shaft_speed_limit::least_duty(parameters, excess, holding));
        if let Some(least) = least
            && least > limits.least
        {
            (limits.least, waits) = (least, false);
        }
        let expected = day.pressure(larger(pressure, reference));
        let surge_valve = self.surge_valve.sample(parameters, inputs.boost_pressure, expected);
        let terms = law.sample(
            parameters,
            Task {
                reference,
                measurement: day.scheduled_pressure(inputs.boost_pressure),
                operating_point: at(reference).slower(day.time_scale()),
                holding: speed_feedforward::holding_duty(
                    parameters,
                    &day,
                    pressure,
                    engine_speed,
                    rate,
                    bypass,
                ),
                feedback_lambda: lambda
                    + (feedback_lambda - lambda) * allocation.low_pressure_share(engine_speed),
                limits,
                model_limits: if day.is_other { lifting(parameters, limits) } else { limits },
                waits,
            },
        );
        let virtual_duty = limits.clip(terms.duty());
        let mut asked = allocation.openings(virtual_duty, engine_speed);
        asked.hp_bypass *= excess.map_or(1.0, shaft_speed_limit::bypass_share);
        let hp_bypass = self.bypass.sample(parameters, asked.hp_bypass, virtual_duty);
        command(parameters, &day, terms, limits, Openings { hp_bypass, surge_valve, ..asked })
    }

    /// The inputs and the reference of the boost pressure (Pa) of the last sample as on the day of the schedule, and the
    /// pressure there (Pa) of the largest reference.
    pub fn on_scheduled_day(&self, parameters: &Parameters, inputs: &Inputs) -> (Inputs, f64, f64) {
        let day = &self.day;
        let boost_pressure = day.scheduled_pressure(inputs.boost_pressure);
        let engine_speed = day.speed_factor(boost_pressure) * inputs.engine_speed;
        let (reference, _) = references(parameters, inputs, day, engine_speed);
        let largest = day.scheduled_pressure(parameters.boost_limit);
        (Inputs { boost_pressure, engine_speed, ..*inputs }, reference, largest)
    }
}

/// The command without memory: the virtual duty that holds the reference at rest.
pub fn at_rest(parameters: &Parameters, inputs: &Inputs, compensator: Compensator) -> Command {
    let day = Day::measured(parameters, inputs);
    let asked = day.scheduled_pressure(feedforward::bounded_reference(parameters, inputs));
    let engine_speed = day.speed_factor(asked) * inputs.engine_speed;
    let (reference, _) = references(parameters, inputs, &day, engine_speed);
    let holding = day.operating_point(parameters, reference, engine_speed).feedforward();
    let limits = parameters.allocation.limits(parameters, engine_speed, compensator);
    let openings = parameters.allocation.openings(limits.clip(holding), engine_speed);
    command(parameters, &day, DutyTerms::feedforward(holding, reference), limits, openings)
}

/// The part of the duty's limits in which the high-pressure wastegate is off its seat.
fn lifting(parameters: &Parameters, limits: Limits) -> Limits {
    let lift_off = actuator_inverse::duty(&parameters.actuator_inverse, 0.0);
    Limits { least: larger(limits.least, lift_off), ..limits }
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

/// The reference of the boost pressure, within the limits that protect the engine and its high-pressure shaft, and the
/// limit for the shaft (Pa, as on the day of the schedule).
fn references(parameters: &Parameters, inputs: &Inputs, day: &Day, engine_speed: f64) -> (f64, f64) {
    let schedule = &parameters.range_schedule;
    let limit = schedule::interpolate(&schedule.engine_speed, &schedule.boost_limit, engine_speed);
    (smaller(day.scheduled_pressure(feedforward::bounded_reference(parameters, inputs)), limit), limit)
}

/// Rejects parameters of the strategy that contradict each other.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    allocation::check(parameters)?;
    schedule::check("range_schedule", &parameters.range_schedule)
}
