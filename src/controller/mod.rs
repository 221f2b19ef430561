//! The boost pressure controller: the law of the paper's fig. 12, sampled at 80 Hz.
//!
//! ```text
//!                 ┌───────────── gain schedule ─────────────┐
//!                 │                    │                    │
//! reference ──┬── feedforward ─────────│───── + ── limits ──┬── compensator ── duty
//!             │                        │      │             │        │
//!             └── reference model ── feedback ┘             │  supply voltage
//!                                      │                    │
//!                               boost pressure              └── the other valves
//! ```
//!
//! The feedforward maps the reference to the duty that holds it. The [`feedback`], a PID controller tuned to the local
//! model of the [`schedule`], corrects the model error. The compensator converts the duty at nominal voltage to the
//! measured voltage, so that voltage disturbances do not move the wastegate. A reference model precedes the feedback,
//! except in the paper's structure. Both strategies use this law: in `split_range` its duty is allocated to all valves,
//! in `by_speed` it moves the high-pressure wastegate, and engine speed sets the others. A relay switches the vacuum
//! pump.
//!
//! Two more modes do not control boost pressure: `position` moves the wastegate to a reference ([`actuator_inverse`]),
//! `open_loop` takes the duty as an input. Both compensate for the voltage.
//!
//! The diagnosis judges measurements and actuators, and replaces what depends on failed ones.
//!
//! Everything is computed at the samples; outputs hold between them.

pub mod actuator_inverse;
pub mod allocation;
mod by_speed;
mod compensator;
mod day;
mod diagnosis;
mod estimate;
pub mod feedback;
mod feedforward;
mod firmness;
mod lag;
mod law;
mod reference_model;
pub mod schedule;
mod shaft_speed_limit;
mod speed_feedforward;
mod split_range;
mod surge_protection;
mod tank_relay;

/// The variables of the controller, generated from `modelDescription/controller.json`.
pub mod variables {
    fmu_export::include_variables!("BoostController");
}

use fmu_export::display::Rounded;
use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel};

use crate::LONGEST_STEP;
use allocation::Openings;
use by_speed::BySpeed;
use compensator::{Compensator, Limits, SupplyVoltage};
use day::Day;
use diagnosis::{BoostControl, Diagnosis};
use law::{BoostLaw, DutyTerms};
use schedule::Schedule;
use split_range::SplitRange;
use tank_relay::TankRelay;
use variables::{ControlMode, Inputs, Locals, Outputs, Parameters, Strategy, Variables};

/// The lowest boost pressure (Pa) that is a measurement. Some masters pass zeros to connected inputs in their first
/// step, and no engine runs with a fifth of ambient pressure upstream of its throttle.
const LEAST_MEASUREMENT: f64 = 20e3;

/// The boost pressure controller.
pub type BoostController = SampledModel<ControlLaw>;

/// The control law, with its memory.
#[derive(Clone, Debug, Default, Persistent)]
pub struct ControlLaw {
    relay: TankRelay,
    supply_voltage: SupplyVoltage,
    /// Mode boost; none before the first measurement.
    law: Option<BoostLaw>,
    split_range: SplitRange,
    by_speed: BySpeed,
    diagnosis: Diagnosis,
}

/// The controller's commands.
#[derive(Clone, Copy, Debug)]
struct Command {
    terms: DutyTerms,
    /// The limits of the sum of the terms.
    limits: Limits,
    /// The duty of the high-pressure wastegate's valve at nominal voltage (%).
    hp_duty: f64,
    openings: Openings,
}

impl Command {
    /// The sum of the terms is the duty of the high-pressure wastegate's valve.
    fn new(terms: DutyTerms, limits: Limits, openings: Openings) -> Self {
        Self { hp_duty: limits.clip(terms.duty()), terms, limits, openings }
    }
}

impl Sampled for ControlLaw {
    type Variables = Variables;
    const LONGEST_STEP: f64 = LONGEST_STEP;

    fn period(variables: &Variables) -> f64 {
        variables.parameters.sample_time
    }

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let parameters = &variables.parameters;
        let (least, most) = (parameters.pwm_min, parameters.pwm_max);
        if least >= most {
            return Err(Error::new(format!(
                "pwm_min is {least} % and must be below pwm_max, which is {most} %"
            )));
        }
        tank_relay::check(parameters)?;
        diagnosis::check(&parameters.diagnosis)?;
        by_speed::check(parameters)?;
        match (parameters.mode, parameters.strategy) {
            (ControlMode::Boost, Strategy::SplitRange) => split_range::check(parameters),
            _ => Ok(()),
        }
    }

    /// The outputs are those of the mode without memory. Initialization leaves no memory and does not use measured
    /// boost pressure, so that a plant that settles at these outputs can be initialized together with the controller
    /// without a loop.
    fn initialize(
        &mut self,
        variables: &mut Variables,
        inputs: &Inputs,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { parameters, locals, outputs, .. } = variables;
        warn_of_ignored_schedule(parameters, context);
        let supply_voltage = SupplyVoltage::default().sample(parameters, inputs.supply_voltage_measured);
        let compensator = Compensator::new(parameters, supply_voltage);
        let command = match (parameters.mode, parameters.strategy) {
            (ControlMode::Boost, Strategy::SplitRange) => {
                split_range::at_rest(parameters, inputs, compensator)
            }
            _ => BySpeed::default().without_feedback(parameters, inputs, limits(parameters, compensator)),
        };
        publish(locals, outputs, &command, compensator, false);
        self.diagnosis.findings().publish(locals, outputs);
        locals.sample_count = 0;
        Ok(())
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Variables,
        inputs: &Inputs,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.locals.sample_count = i32::try_from(sample.number + 1).unwrap_or(i32::MAX);
        let Variables { parameters, locals, outputs, .. } = variables;
        let was_found = self.diagnosis.findings();
        self.diagnosis.check_sensors(parameters, inputs);
        let boost_control = self.diagnosis.boost_control(parameters, inputs);
        if parameters.mode == ControlMode::Boost
            && self.law.is_none()
            && boost_control == BoostControl::Closed
        {
            if inputs.boost_pressure < LEAST_MEASUREMENT {
                return Ok(());
            }
            self.law = Some(BoostLaw::at(inputs.boost_pressure));
            let pressure = Rounded(inputs.boost_pressure / 1e3);
            context.event(format_args!("first boost measurement, {pressure} kPa"));
        }
        let (was_on, was_by_speed) = (self.relay, self.by_speed);
        let relay = self.relay.sample(parameters, inputs.tank_pressure);
        let vacuum_pump = self.diagnosis.pump(parameters, relay);
        if self.relay != was_on {
            let (state, pressure) = (if relay { "on" } else { "off" }, Rounded(inputs.tank_pressure / 1e3));
            context.event(format_args!("vacuum pump {state}, tank at {pressure} kPa"));
        }

        let supply_voltage = self.supply_voltage.sample(parameters, inputs.supply_voltage_measured);
        let supply_voltage = self.diagnosis.supply_voltage(parameters, supply_voltage);
        let compensator = Compensator::new(parameters, supply_voltage);
        let limits = limits(parameters, compensator);
        let command = match boost_control {
            BoostControl::Closed => self.closed_loop(parameters, inputs, compensator, limits),
            BoostControl::FeedforwardAlone => self.without_feedback(parameters, inputs, compensator, limits),
            BoostControl::LeastBoost => self.least_boost(parameters, inputs, limits),
        };
        self.by_speed.log_since(was_by_speed, inputs, context);
        publish(locals, outputs, &command, compensator, vacuum_pump);
        self.diagnosis.check_filling(parameters, inputs, outputs);
        if parameters.mode == ControlMode::Boost && boost_control == BoostControl::Closed {
            self.check_answer(parameters, inputs, &command);
        }
        let findings = self.diagnosis.findings();
        findings.warn_since(was_found, inputs, context);
        findings.publish(locals, outputs);
        Ok(())
    }
}

impl ControlLaw {
    /// The command with feedback, in mode boost.
    fn closed_loop(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
        limits: Limits,
    ) -> Command {
        match (&mut self.law, parameters.strategy) {
            (Some(law), Strategy::SplitRange) => {
                self.split_range.sample(law, parameters, inputs, compensator)
            }
            (Some(law), Strategy::BySpeed) => self.by_speed.sample(law, parameters, inputs, limits),
            (None, _) => self.by_speed.without_feedback(parameters, inputs, limits),
        }
    }

    /// The command without feedback.
    fn without_feedback(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
        limits: Limits,
    ) -> Command {
        match (parameters.mode, parameters.strategy) {
            (ControlMode::Boost, Strategy::SplitRange) => {
                split_range::at_rest(parameters, inputs, compensator)
            }
            _ => self.by_speed.without_feedback(parameters, inputs, limits),
        }
    }

    /// The command for least boost. The bypass stays shut: opening it would unload the high-pressure compressor, whose
    /// shaft already turns too fast with its wastegate stuck shut. The law's memory follows, for a bumpless return.
    fn least_boost(&mut self, parameters: &Parameters, inputs: &Inputs, limits: Limits) -> Command {
        self.law = Some(BoostLaw::at(inputs.boost_pressure));
        let terms = DutyTerms::feedforward(parameters.pwm_max, inputs.boost_pressure);
        let openings = Openings { lp_wastegate: 1.0, hp_bypass: 0.0, surge_valve: 0.0 };
        let command = Command::new(terms, limits, openings);
        match parameters.strategy {
            Strategy::SplitRange => {
                let day = Day::measured(parameters, inputs);
                Command { hp_duty: day.duty(parameters, command.hp_duty), ..command }
            }
            Strategy::BySpeed => command,
        }
    }

    /// Judges whether boost responds to a command.
    fn check_answer(&mut self, parameters: &Parameters, inputs: &Inputs, command: &Command) {
        let duty = command.limits.clip(command.terms.duty());
        match parameters.strategy {
            Strategy::SplitRange => {
                let schedule = Schedule::from(&parameters.range_schedule);
                let (inputs, reference, largest) = self.split_range.on_scheduled_day(parameters, inputs);
                self.diagnosis.check_answer(parameters, &inputs, Some(schedule), reference, duty, largest);
            }
            // Above, the low-pressure wastegate is open, for which its schedule was not identified.
            Strategy::BySpeed => self.diagnosis.check_answer(
                parameters,
                inputs,
                (inputs.engine_speed <= parameters.lp_wastegate_close_below)
                    .then(|| Schedule::from(&parameters.schedule)),
                feedforward::bounded_reference(parameters, inputs),
                duty,
                0.0,
            ),
        }
    }
}

/// Warns of a schedule set for the other strategy.
fn warn_of_ignored_schedule(parameters: &Parameters, context: &mut Context<'_>) {
    if parameters.strategy == Strategy::SplitRange && parameters.schedule != Parameters::default().schedule {
        context.warn(format_args!(
            "schedule is ignored: only strategy = by_speed uses it; strategy = split_range uses range_schedule"
        ));
    }
}

/// The limits of a duty at nominal voltage that moves only the high-pressure wastegate.
fn limits(parameters: &Parameters, compensator: Compensator) -> Limits {
    let (least, most) = match parameters.mode {
        ControlMode::Boost => (parameters.pwm_min, parameters.pwm_max),
        ControlMode::Position | ControlMode::OpenLoop => (0.0, 100.0),
    };
    compensator.limits(least, most)
}

/// Sets the outputs and local variables.
fn publish(
    locals: &mut Locals,
    outputs: &mut Outputs,
    command: &Command,
    compensator: Compensator,
    vacuum_pump: bool,
) {
    let Command { terms, limits, hp_duty, openings } = command;
    let duty = terms.duty();
    outputs.hp_wastegate_pwm = compensator.compensate(*hp_duty);
    outputs.vacuum_pump = f64::from(u8::from(vacuum_pump));
    outputs.lp_wastegate = openings.lp_wastegate;
    outputs.hp_bypass = openings.hp_bypass;
    outputs.surge_valve = openings.surge_valve;
    locals.feedforward_pwm = terms.feedforward;
    locals.proportional_term = terms.proportional;
    locals.integral_term = terms.integral;
    locals.derivative_term = terms.derivative;
    locals.unsaturated_pwm = duty;
    locals.virtual_duty = limits.clip(duty);
    locals.reference_model_pressure = terms.reference_model_pressure;
    locals.voltage_compensation = compensator.factor;
    locals.saturated = !limits.contain(duty);
}
