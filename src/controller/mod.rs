//! The boost pressure controller: the law of the paper's fig. 12, sampled at 80 Hz.
//!
//! ```text
//!                 ┌───────────── gain schedule ─────────────┐
//!                 │                    │                    │
//! reference ──┬── feedforward ─────────│───── + ── limits ── compensator ── duty
//!             │                        │      │                  │
//!             └── reference model ── feedback ┘            supply voltage
//!                                      │
//!                               boost pressure
//! ```
//!
//! The feedforward maps the reference to the duty that holds it. The [`feedback`], a PID controller tuned by the
//! local model of the [`schedule`], corrects what the map does not contain. The compensator converts the duty at
//! nominal voltage to that at the measured voltage, so that a disturbance of the voltage does not move the
//! wastegate. Between reference and feedback stands a reference model, unless the structure is that of the paper.
//! Besides, a relay switches the vacuum pump, and the stage strategy decides which turbocharger works.
//!
//! Two further modes do not control boost pressure: `position` moves the wastegate to a reference
//! ([`actuator_inverse`]), `open_loop` takes the duty as an input. Both compensate for the voltage.
//!
//! Everything is computed at the samples; between them the outputs are held.

pub mod actuator_inverse;
mod compensator;
pub mod feedback;
mod feedforward;
mod reference_model;
pub mod schedule;
mod stage;
mod tank_relay;

/// The variables of the controller, generated from `modelDescription/controller.json`.
pub mod variables {
    fmu_export::include_variables!("BoostController");
}

use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel};

use crate::LONGEST_STEP;
use compensator::{Compensator, Limits, SupplyVoltage};
use feedback::{FeedbackSettings, Pid};
use reference_model::ReferenceModel;
use schedule::OperatingPoint;
use stage::{LowPressureLoop, StageStrategy};
use tank_relay::TankRelay;
use variables::{ControlMode, FeedbackStructure, Inputs, Locals, Outputs, Parameters, Variables};

/// The least boost pressure (Pa) that is a measurement. Some masters pass zeros to connected inputs in their
/// first step, and no engine runs at a fifth of the ambient pressure upstream of its throttle.
const LEAST_MEASUREMENT: f64 = 20e3;

/// The limits of the duty (%) where none are set: modes position and `open_loop`.
const FULL_RANGE: (f64, f64) = (0.0, 100.0);

/// The boost pressure controller.
pub type BoostController = SampledModel<ControlLaw>;

/// The control law, with its memory.
#[derive(Clone, Debug, Default, Persistent)]
pub struct ControlLaw {
    relay: TankRelay,
    stage: StageStrategy,
    supply_voltage: SupplyVoltage,
    /// Of mode boost: none before the first measurement.
    boost: Option<BoostLoop>,
}

/// The memory of mode boost.
#[derive(Clone, Copy, Debug, Default, Persistent)]
struct BoostLoop {
    pid: Pid,
    reference_model: ReferenceModel,
    low_pressure: LowPressureLoop,
}

/// A duty at nominal voltage and its terms (%).
#[derive(Clone, Copy, Debug)]
struct DutyCommand {
    feedforward: f64,
    proportional: f64,
    integral: f64,
    derivative: f64,
    /// The boost pressure (Pa) that the feedback compares with.
    reference_model_pressure: f64,
}

impl DutyCommand {
    /// A duty without feedback.
    fn feedforward(duty: f64, reference_model_pressure: f64) -> Self {
        Self {
            feedforward: duty,
            proportional: 0.0,
            integral: 0.0,
            derivative: 0.0,
            reference_model_pressure,
        }
    }

    fn duty(&self) -> f64 {
        self.feedforward + self.proportional + self.integral + self.derivative
    }
}

/// What the stage strategy and the relay decide.
#[derive(Clone, Copy, Debug)]
struct Valves {
    vacuum_pump: bool,
    lp_wastegate: f64,
    hp_bypass: bool,
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
                "pwm_min is {least} % and pwm_max is {most} %, but the least duty must be below the largest"
            )));
        }
        tank_relay::check(parameters)?;
        stage::check(parameters)?;
        schedule::check(&parameters.schedule)
    }

    /// The outputs are those of the mode without memory. Initialization leaves no memory, and the
    /// measured boost pressure is not used, so that a plant that settles at these outputs can be
    /// initialized together with the controller without a loop.
    fn initialize(
        &mut self,
        variables: &mut Variables,
        inputs: &Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { parameters, locals, outputs, .. } = variables;
        let bypassed = StageStrategy::default().sample(parameters, inputs.engine_speed);
        let valves = Valves {
            vacuum_pump: false,
            lp_wastegate: if bypassed { 0.0 } else { stage::lp_wastegate(parameters, inputs.engine_speed) },
            hp_bypass: bypassed,
        };
        let duty = if bypassed && parameters.mode == ControlMode::Boost {
            parameters.pwm_max
        } else {
            feedforward::at_rest(parameters, inputs)
        };
        let command = DutyCommand::feedforward(duty, feedforward::bounded_reference(parameters, inputs));
        let supply_voltage = SupplyVoltage::default().sample(inputs.supply_voltage_measured);
        let compensator = Compensator::new(parameters, supply_voltage);
        publish(locals, outputs, &command, compensator, limits(parameters, compensator), valves);
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
        let Sample { number, time } = sample;
        variables.locals.sample_count = i32::try_from(number + 1).unwrap_or(i32::MAX);
        let Variables { parameters, locals, outputs, .. } = variables;
        if parameters.mode == ControlMode::Boost && self.boost.is_none() {
            if inputs.boost_pressure < LEAST_MEASUREMENT {
                return Ok(());
            }
            self.boost = Some(BoostLoop::at(inputs.boost_pressure));
            let pressure = inputs.boost_pressure;
            context.event(format_args!("at {time} s: the first measurement of boost, {pressure} Pa"));
        }
        let (was_on, was_bypassed) = (self.relay, self.stage);
        let vacuum_pump = self.relay.sample(parameters, inputs.tank_pressure);
        let bypassed = self.stage.sample(parameters, inputs.engine_speed);
        if self.relay != was_on {
            let (does, pressure) = (if vacuum_pump { "on" } else { "off" }, inputs.tank_pressure);
            context.event(format_args!("at {time} s: the vacuum pump goes {does}, tank at {pressure} Pa"));
        }
        if self.stage != was_bypassed {
            let (is, speed) = (if bypassed { "bypassed" } else { "active" }, inputs.engine_speed);
            context.event(format_args!("at {time} s: the high-pressure stage is {is}, {speed} rpm"));
        }

        let supply_voltage = self.supply_voltage.sample(inputs.supply_voltage_measured);
        let compensator = Compensator::new(parameters, supply_voltage);
        let limits = limits(parameters, compensator);
        let reference = feedforward::bounded_reference(parameters, inputs);
        // While the high-pressure stage is bypassed, the low-pressure wastegate is shut except in mode boost.
        let mut lp_wastegate =
            if bypassed { 0.0 } else { stage::lp_wastegate(parameters, inputs.engine_speed) };
        let command = match &mut self.boost {
            Some(boost) if bypassed => {
                lp_wastegate = boost.bypass(parameters, inputs.boost_pressure, reference);
                DutyCommand::feedforward(parameters.pwm_max, inputs.boost_pressure)
            }
            Some(boost) => boost.control(parameters, inputs, reference, limits),
            None => DutyCommand::feedforward(feedforward::at_rest(parameters, inputs), reference),
        };
        let valves = Valves { vacuum_pump, lp_wastegate, hp_bypass: bypassed };
        publish(locals, outputs, &command, compensator, limits, valves);
        Ok(())
    }
}

impl BoostLoop {
    /// A controller at rest at a boost pressure (Pa).
    fn at(boost_pressure: f64) -> Self {
        Self {
            pid: Pid::at(boost_pressure),
            reference_model: ReferenceModel::at(boost_pressure),
            low_pressure: LowPressureLoop::default(),
        }
    }

    /// Boost by the high-pressure wastegate, at one sample.
    fn control(
        &mut self,
        parameters: &Parameters,
        inputs: &Inputs,
        reference: f64,
        limits: Limits,
    ) -> DutyCommand {
        let &Parameters { sample_time, lambda, derivative_filter, .. } = parameters;
        let measurement = inputs.boost_pressure;
        self.low_pressure = LowPressureLoop::default();

        let operating_point = OperatingPoint::new(&parameters.schedule, reference, inputs.engine_speed);
        let local_model = operating_point.local_model();
        let tuning = FeedbackSettings::new(&local_model, lambda);
        self.pid.differentiate(&tuning, derivative_filter, sample_time, measurement);

        let (feedforward, error, reference_model_pressure) = match parameters.structure {
            FeedbackStructure::Paper => (operating_point.feedforward(), reference - measurement, reference),
            FeedbackStructure::ModelReference => {
                let model = &mut self.reference_model;
                let linearized = model.linearize(operating_point);
                let feedforward = model.feedforward(&linearized, reference, lambda);
                let error = model.error(measurement);
                let pressure = model.pressure;
                model.advance(&linearized, limits.clip(feedforward), local_model.delay, sample_time);
                (feedforward, error, pressure)
            }
        };
        let command = DutyCommand {
            feedforward,
            proportional: tuning.gain * error,
            integral: self.pid.integral,
            derivative: self.pid.derivative,
            reference_model_pressure,
        };
        let duty = command.duty();
        self.pid.integrate(&tuning, sample_time, error, limits.clip(duty) - duty);
        command
    }

    /// Boost by the low-pressure wastegate, at one sample: its opening. The state of the control by the
    /// high-pressure wastegate follows the boost pressure, so that it starts there when it takes over again.
    fn bypass(&mut self, parameters: &Parameters, boost_pressure: f64, reference: f64) -> f64 {
        let low_pressure = self.low_pressure;
        *self = Self { low_pressure, ..Self::at(boost_pressure) };
        self.low_pressure.sample(parameters, boost_pressure - reference)
    }
}

/// The limits of the duty at nominal voltage.
fn limits(parameters: &Parameters, compensator: Compensator) -> Limits {
    let (least, most) = match parameters.mode {
        ControlMode::Boost => (parameters.pwm_min, parameters.pwm_max),
        ControlMode::Position | ControlMode::OpenLoop => FULL_RANGE,
    };
    compensator.limits(least, most)
}

/// Sets the outputs and local variables.
fn publish(
    locals: &mut Locals,
    outputs: &mut Outputs,
    command: &DutyCommand,
    compensator: Compensator,
    limits: Limits,
    valves: Valves,
) {
    let duty = command.duty();
    outputs.hp_wastegate_pwm = compensator.compensate(limits.clip(duty));
    outputs.vacuum_pump = f64::from(u8::from(valves.vacuum_pump));
    outputs.lp_wastegate = valves.lp_wastegate;
    outputs.hp_bypass = f64::from(u8::from(valves.hp_bypass));
    locals.feedforward_pwm = command.feedforward;
    locals.proportional_term = command.proportional;
    locals.integral_term = command.integral;
    locals.derivative_term = command.derivative;
    locals.unsaturated_pwm = duty;
    locals.reference_model_pressure = command.reference_model_pressure;
    locals.voltage_compensation = compensator.factor;
    locals.saturated = !limits.contain(duty);
}
