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
mod actuator_reach;
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
use fmu_export::{Context, Error, Float, Persistent, Sample, Sampled};

use crate::LONGEST_STEP;
use actuator_reach::ActuatorReach;
use allocation::Openings;
use by_speed::BySpeed;
use compensator::{Compensator, Limits, SupplyVoltage};
use day::Day;
use diagnosis::{Asked, BoostControl, Diagnosis, Done};
use law::{BoostLaw, DutyTerms};
use schedule::Schedule;
use split_range::SplitRange;
use tank_relay::TankRelay;
use variables::{
    ActiveLimit, ControlMode, FeedbackStructure, Inputs, Locals, Outputs, Parameters, Real, Strategy,
    Variables,
};

/// The lowest boost pressure (Pa) that is a measurement. Some masters pass zeros to connected inputs in their first
/// step, and no engine runs with a fifth of ambient pressure upstream of its throttle.
const LEAST_MEASUREMENT: Real = 20e3;

/// The valves besides the high-pressure wastegate, for least boost.
const LEAST_BOOST: Openings = Openings { lp_wastegate: 1.0, hp_bypass: 0.0, surge_valve: 1.0 };

/// The control law, with its memory.
#[derive(Clone, Debug, Default, Persistent)]
pub struct ControlLaw {
    relay: TankRelay,
    supply_voltage: SupplyVoltage,
    /// Mode boost; none before the first measurement.
    law: Option<BoostLaw>,
    split_range: SplitRange,
    by_speed: BySpeed,
    actuator_reach: ActuatorReach,
    diagnosis: Diagnosis,
    /// The integral term (%) when boost pressure last changed with the engine running: what a sensor taught that was
    /// alive.
    learnt_integral: Real,
}

/// What a calibrator sees of the limits and conditions behind a command.
#[derive(Clone, Copy, Debug, Default)]
struct Conditions {
    /// The limit of the boost pressure reference (Pa).
    reference_limit: Real,
    /// The firmness of the feedback.
    firmness: Real,
    day: Day,
    /// The limit in effect.
    active_limit: ActiveLimit,
}

/// The controller's commands.
#[derive(Clone, Copy, Debug)]
struct Command {
    terms: DutyTerms,
    /// The limits of the sum of the terms.
    limits: Limits,
    /// The duty of the high-pressure wastegate's valve at nominal voltage (%).
    hp_duty: Real,
    openings: Openings,
    conditions: Conditions,
}

impl Command {
    /// The sum of the terms is the duty of the high-pressure wastegate's valve.
    fn new(terms: DutyTerms, limits: Limits, openings: Openings) -> Self {
        let active_limit = limits.active(terms.duty());
        let conditions = Conditions { active_limit, ..Conditions::default() };
        Self { hp_duty: limits.clip(terms.duty()), terms, limits, openings, conditions }
    }
}

/// The commands for least boost where nothing else is known, not even measurements.
#[must_use]
pub fn limp_home(parameters: &Parameters) -> Outputs {
    let Openings { lp_wastegate, hp_bypass, surge_valve } = LEAST_BOOST;
    Outputs {
        hp_wastegate_pwm: parameters.pwm_max,
        vacuum_pump: 1.0,
        lp_wastegate,
        hp_bypass,
        surge_valve,
        ..Outputs::default()
    }
}

impl Sampled for ControlLaw {
    type Variables = Variables;
    const LONGEST_STEP: f64 = LONGEST_STEP;

    fn period(variables: &Variables) -> f64 {
        Float::decimal(variables.parameters.sample_time)
    }

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let parameters = &variables.parameters;
        let (least, most) = (parameters.pwm_min, parameters.pwm_max);
        if least >= most {
            return Err(Error::new(format_args!(
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
    fn initialize(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        let Variables { parameters, inputs, locals, outputs, .. } = variables;
        warn_of_ignored_schedule(parameters, context);
        let supply_voltage = SupplyVoltage::default().measured(inputs.supply_voltage_measured);
        let compensator = Compensator::new(parameters, supply_voltage);
        let command = self.without_feedback(parameters, inputs, compensator);
        publish(locals, outputs, &command, compensator, false);
        outputs.fault_code = 0.0;
        locals.sample_count = 0;
        Ok(())
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.locals.sample_count = i32::try_from(sample.number + 1).unwrap_or(i32::MAX);
        let Variables { parameters, inputs, locals, outputs, .. } = variables;
        let was_found = self.diagnosis.findings();
        self.diagnosis.check_sensors(parameters, inputs);
        let mut boost_control = self.diagnosis.boost_control(parameters);
        let is_found = self.diagnosis.findings().has(diagnosis::BOOST_SENSOR);
        if parameters.mode == ControlMode::Boost && self.law.is_none() && !is_found {
            // An outlier may be an input that is not connected yet, or a plant that starts beyond the range.
            if inputs.boost_pressure < LEAST_MEASUREMENT {
                return Ok(());
            }
            boost_control = BoostControl::Closed;
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

        let measured = self.supply_voltage.measured(inputs.supply_voltage_measured);
        let is_replaced = self.diagnosis.replaces_supply_voltage(parameters);
        let supply_voltage = self.supply_voltage.compensated(parameters, measured, is_replaced);
        let compensator = Compensator::new(parameters, supply_voltage);
        if parameters.mode == ControlMode::Boost
            && self.actuator_is_out_of_reach(parameters, inputs, measured, boost_control)
        {
            boost_control = BoostControl::LeastBoost;
        }
        if self.diagnosis.boost_sensor_misled() && self.law.is_some() {
            let reference = feedforward::bounded_reference(parameters, inputs);
            self.law = Some(self.law_at(parameters, reference).with_integral(self.learnt_integral));
        }
        let command = match boost_control {
            BoostControl::Closed => self.closed_loop(parameters, inputs, compensator, true),
            BoostControl::WithoutMeasurement => self.without_measurement(parameters, inputs, compensator),
            BoostControl::LeastBoost => self.least_boost(parameters, inputs, compensator),
        };
        self.by_speed.log_since(was_by_speed, inputs, context);
        publish(locals, outputs, &command, compensator, vacuum_pump);
        locals.anti_windup_cut = self.law.as_ref().map_or(0.0, BoostLaw::blocked);
        if self.diagnosis.learns(inputs) {
            self.learnt_integral = locals.integral_term;
        }
        self.diagnosis.check_filling(parameters, inputs, outputs);
        if parameters.mode == ControlMode::Boost && boost_control != BoostControl::LeastBoost {
            self.check_loop(parameters, inputs, &command);
        }
        self.diagnosis.publish(was_found, sample.time, inputs, (locals, outputs), context);
        Ok(())
    }
}

impl ControlLaw {
    /// Whether the other valves are to limit boost, since the actuator cannot, at a supply voltage (V).
    fn actuator_is_out_of_reach(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        supply_voltage: Option<Real>,
        boost_control: BoostControl,
    ) -> bool {
        let tank_pressure = self.diagnosis.tank_pressure(inputs);
        let excess = match boost_control {
            BoostControl::Closed => {
                inputs.boost_pressure - feedforward::bounded_reference(parameters, inputs)
            }
            BoostControl::WithoutMeasurement | BoostControl::LeastBoost => 0.0,
        };
        let mut reach = self.actuator_reach;
        let holding_duty =
            || self.without_feedback(parameters, inputs, Compensator::new(parameters, None)).hp_duty;
        let measured = (tank_pressure, supply_voltage);
        let is_lost =
            reach.is_lost(parameters, measured, holding_duty, excess, inputs.pressure_deficit(parameters));
        self.actuator_reach = reach;
        is_lost
    }

    /// The command with feedback, in mode boost; `is_measured` tells a measurement from what the law expects.
    fn closed_loop(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
        is_measured: bool,
    ) -> Command {
        match (&mut self.law, parameters.strategy) {
            (Some(law), Strategy::SplitRange) => {
                self.split_range.sample(law, parameters, inputs, compensator, is_measured)
            }
            (Some(law), Strategy::BySpeed) => {
                let limits = limits(parameters, compensator);
                self.by_speed.sample(law, parameters, inputs, limits, is_measured)
            }
            (None, _) => self.without_feedback(parameters, inputs, compensator),
        }
    }

    /// The command while the boost sensor is implausible: the reference model's pressure replaces its measurement, so that
    /// the feedback rests and the integral term stays.
    fn without_measurement(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
    ) -> Command {
        match (&self.law, parameters.structure) {
            (Some(law), FeedbackStructure::ModelReference) => {
                let boost_pressure = self.expected_measurement(parameters, law);
                let inputs = Inputs { boost_pressure, ..*inputs };
                self.closed_loop(parameters, &inputs, compensator, false)
            }
            _ => self.without_feedback(parameters, inputs, compensator),
        }
    }

    /// The command without feedback.
    fn without_feedback(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        compensator: Compensator,
    ) -> Command {
        match (parameters.mode, parameters.strategy) {
            (ControlMode::Boost, Strategy::SplitRange) => {
                split_range::at_rest(parameters, inputs, compensator)
            }
            _ => self.by_speed.without_feedback(parameters, inputs, limits(parameters, compensator)),
        }
    }

    /// The command for least boost. The bypass stays shut: opening it would unload the high-pressure compressor, whose
    /// shaft already turns too fast with its wastegate shut. The law's memory follows, for a bumpless return.
    fn least_boost(&mut self, parameters: &Parameters, inputs: &Inputs, compensator: Compensator) -> Command {
        self.law = Some(self.law_at(parameters, inputs.boost_pressure));
        let terms = DutyTerms::feedforward(parameters.pwm_max, inputs.boost_pressure);
        let mut command = Command::new(terms, limits(parameters, compensator), LEAST_BOOST);
        command.conditions.active_limit = ActiveLimit::LeastBoost;
        match parameters.strategy {
            Strategy::SplitRange => {
                let day = Day::measured(parameters, inputs);
                command.hp_duty = day.duty(parameters, command.hp_duty);
                command.openings.hp_bypass = self.split_range.follow(parameters, inputs);
                command
            }
            Strategy::BySpeed => command,
        }
    }

    /// The law at rest at a boost pressure (Pa).
    fn law_at(&self, parameters: &Parameters, boost_pressure: Real) -> BoostLaw {
        match parameters.strategy {
            Strategy::SplitRange => self.split_range.law_at(boost_pressure),
            Strategy::BySpeed => BoostLaw::at(boost_pressure),
        }
    }

    /// The boost pressure (Pa) that a sound sensor should measure.
    fn expected_measurement(&self, parameters: &Parameters, law: &BoostLaw) -> Real {
        match parameters.strategy {
            Strategy::SplitRange => self.split_range.expected_measurement(law),
            Strategy::BySpeed => law.expected_measurement(),
        }
    }

    /// Judges whether boost responds to a command.
    fn check_loop(&mut self, parameters: &Parameters, inputs: &Inputs, command: &Command) {
        let Self { law, split_range, actuator_reach, diagnosis, .. } = self;
        let Some(law) = law else { return };
        let done = |asked| Done {
            asked,
            duty: command.limits.clip(command.terms.duty()),
            correction: law.correction(),
            tank_has_filled: actuator_reach.has_filled(),
        };
        match parameters.strategy {
            Strategy::SplitRange => {
                let schedule = Schedule::from(&parameters.range_schedule);
                let here = split_range.on_scheduled_day(inputs);
                let done = done(split_range.asked(parameters, inputs));
                let expected = || split_range.expected_measurement(law);
                diagnosis.check_loop(parameters, inputs, Some(schedule), here, &done, expected);
            }
            // Above, the low-pressure wastegate is open, for which its schedule was not identified.
            Strategy::BySpeed => {
                let schedule = (inputs.engine_speed <= parameters.lp_wastegate_close_below)
                    .then(|| Schedule::from(&parameters.schedule));
                let here = (inputs.boost_pressure, inputs.engine_speed);
                let reference = feedforward::bounded_reference(parameters, inputs);
                let done = done(Asked { by_driver: reference, reference, day_shift: 0.0 });
                diagnosis
                    .check_loop(parameters, inputs, schedule, here, &done, || law.expected_measurement());
            }
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
    let Command { terms, limits, hp_duty, openings, conditions } = command;
    let duty = terms.duty();
    outputs.hp_wastegate_pwm = compensator.compensate(*hp_duty);
    outputs.vacuum_pump = Real::from(u8::from(vacuum_pump));
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
    locals.active_limit = conditions.active_limit;
    locals.reference_limit = conditions.reference_limit;
    locals.feedback_firmness = conditions.firmness;
    locals.day = conditions.day.locals();
}
