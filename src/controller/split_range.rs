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
use super::allocation::{self, Bypass, Openings};
use super::compensator::{Compensator, Limits};
use super::feedforward;
use super::law::{BoostLaw, DutyTerms, Task};
use super::schedule::{self, OperatingPoint};
use super::speed_feedforward::{self, SpeedFilter};
use super::variables::{Inputs, Parameters};
use crate::elementary::smaller;

/// The memory of the strategy, beside the law's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SplitRange {
    engine_speed: SpeedFilter,
    bypass: Bypass,
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
        let engine_speed = inputs.engine_speed;
        let rate = self.engine_speed.sample(parameters, engine_speed);
        let (pressure, bypass) = (law.model_pressure(), self.bypass.opening());
        let reference = reference(parameters, inputs);
        let limits = allocation.limits(parameters, engine_speed, compensator);
        let terms = law.sample(
            parameters,
            Task {
                reference,
                measurement: inputs.boost_pressure,
                operating_point: OperatingPoint::new(&parameters.range_schedule, reference, engine_speed),
                holding: speed_feedforward::holding_duty(parameters, pressure, engine_speed, rate, bypass),
                feedback_lambda: lambda
                    + (feedback_lambda - lambda) * allocation.low_pressure_share(engine_speed),
                limits,
            },
        );
        let virtual_duty = limits.clip(terms.duty());
        let asked = allocation.openings(virtual_duty, engine_speed);
        let hp_bypass = self.bypass.sample(parameters, asked.hp_bypass, virtual_duty);
        command(parameters, terms, limits, Openings { hp_bypass, ..asked })
    }
}

/// The command without memory: the virtual duty that holds the reference at rest.
pub fn at_rest(parameters: &Parameters, inputs: &Inputs, compensator: Compensator) -> Command {
    let reference = reference(parameters, inputs);
    let engine_speed = inputs.engine_speed;
    let holding = OperatingPoint::new(&parameters.range_schedule, reference, engine_speed).feedforward();
    let limits = parameters.allocation.limits(parameters, engine_speed, compensator);
    let openings = parameters.allocation.openings(limits.clip(holding), engine_speed);
    command(parameters, DutyTerms::feedforward(holding, reference), limits, openings)
}

fn command(parameters: &Parameters, terms: DutyTerms, limits: Limits, openings: Openings) -> Command {
    Command { hp_duty: smaller(limits.clip(terms.duty()), parameters.pwm_max), terms, limits, openings }
}

/// The reference of the boost pressure (Pa), within the limits that protect the engine and its high-pressure shaft.
pub fn reference(parameters: &Parameters, inputs: &Inputs) -> f64 {
    let schedule = &parameters.range_schedule;
    let limit = schedule::interpolate(&schedule.engine_speed, &schedule.boost_limit, inputs.engine_speed);
    smaller(feedforward::bounded_reference(parameters, inputs), limit)
}

/// Rejects parameters of the strategy that contradict each other.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    allocation::check(parameters)?;
    schedule::check("range_schedule", &parameters.range_schedule)
}
