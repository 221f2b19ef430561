//! The plant: a two-stage turbocharged petrol engine with a vacuum-actuated wastegate.
//!
//! A PWM signal drives a solenoid valve, which mixes ambient air and the vacuum of a tank into the chamber of
//! the [actuator]; its rod opens the high-pressure turbine's wastegate. A mean value engine model gives the
//! effect on boost: flow resistances, valves, compressors, turbines, shafts, intercooler and cylinders, connected
//! by volumes with pressures as states. [`system`] is the assembly, in the order of the paper's fig. 2.
//!
//! Each component has its own file with its equations, their sources and units, independent of importers and time
//! steps. Pressures are in Pa, temperatures in K, mass flows in kg/s. A side of a flow is a pair of pressure and
//! temperature.
//!
//! The paper describes the actuation system and refers to the literature for the engine; the turbocharger maps
//! and volumes are not published. They are chosen here to reproduce the paper's figures; the description of each
//! parameter in `modelDescription/plant.json` states its source.
//!
//! [`BoostPlant`] starts an experiment (`initialization`), integrates over communication steps (`integration`)
//! and sets the variables that `modelDescription/plant.json` declares.

pub mod actuator;
mod air_filter;
mod compressor;
mod cylinders;
mod duty_latch;
mod exhaust;
mod exhaust_manifold;
mod flow_resistance;
mod gas;
mod initialization;
mod integration;
mod intercooler;
mod orifice;
mod port;
mod shaft;
mod solenoid_valve;
mod supply;
pub mod system;
mod turbine;
mod vacuum_tank;

/// The plant's variables, generated from `modelDescription/plant.json`.
pub mod variables {
    fmu_export::include_variables!("BoostPlant");
}

use fmu_export::display::Rounded;
use fmu_export::{
    Context, Dual, Error, Event, Experiment, InputSignal, Model, ModelExchange, Persistent, Recorded, Step,
    Tape, Variables as _,
};

use self::duty_latch::DutyLatch;
use self::initialization::{Settled, running, settled, started};
use self::integration::{IntervalInputs, Pace, budget};
use self::system::{Evaluation, System};
use self::variables::{InitializationMode, Inputs, Parameters, States, Variables};
use crate::LONGEST_STEP;
use crate::solver::course::Interval;
use crate::solver::steady_state::NoSteadyState;

/// The largest ratio of Dahl's stiffness to the Coulomb force in 1/m: beyond it the friction force changes too fast for
/// the 1/2400 s steps of the reference implementation.
pub const STIFFEST_FRICTION: f64 = 2000.0;
/// Relative tolerance of that limit, for rounding.
const ROUNDING: f64 = 1e-9;

/// The smallest tolerance, and the minimum of `solver.relative_tolerance`: below it, rounding dominates the error
/// estimate.
const SMALLEST_TOLERANCE: f64 = 1e-8;

/// The plant as a co-simulation model.
#[derive(Clone, Debug, Persistent)]
pub struct BoostPlant {
    /// Derived from the parameters.
    #[persistent(skip)]
    system: System,
    latch: DutyLatch,
    pace: Pace,
}

impl Default for BoostPlant {
    fn default() -> Self {
        Self {
            system: System::new(&Parameters::default()),
            latch: DutyLatch::default(),
            pace: Pace::default(),
        }
    }
}

impl Model for BoostPlant {
    type Variables = Variables;
    const LONGEST_STEP: f64 = LONGEST_STEP;

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let p = &variables.parameters;
        let actuator = &p.actuator;
        if actuator.friction_stiffness > STIFFEST_FRICTION * (1.0 + ROUNDING) * actuator.coulomb_friction {
            return Err(Error::new(format!(
                "actuator.friction_stiffness = {:?} N/m is more than 2000 1/m times \
                 actuator.coulomb_friction = {:?} N",
                actuator.friction_stiffness, actuator.coulomb_friction
            )));
        }
        if actuator.chamber_volume <= actuator.membrane_area * actuator.stroke {
            return Err(Error::new(format!(
                "actuator.chamber_volume = {:?} m3 is not more than what actuator.membrane_area = {:?} m2 \
                 displaces over actuator.stroke = {:?} m",
                actuator.chamber_volume, actuator.membrane_area, actuator.stroke
            )));
        }
        for (name, gas) in [("air", &p.air), ("exhaust_gas", &p.exhaust_gas)] {
            if gas.gas_constant >= gas.specific_heat {
                return Err(Error::new(format!(
                    "{name}.gas_constant = {:?} J/(kg.K) is not less than {name}.specific_heat = {:?} \
                     J/(kg.K)",
                    gas.gas_constant, gas.specific_heat
                )));
            }
        }
        Ok(())
    }

    fn initialize(
        &mut self,
        variables: &mut Variables,
        inputs: &Inputs,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.system = System::new(&variables.parameters);
        self.latch = DutyLatch::new(context.experiment.start_time, inputs.hp_wastegate_pwm);
        self.pace = Pace::default();
        let tank_pressure = variables.start.tank.pressure;
        variables.states = match variables.parameters.initialization.mode {
            InitializationMode::Settled => {
                let settled = settled(&variables.parameters, inputs, tank_pressure);
                warn_of_unsettled_start(&settled, inputs, context);
                settled.states
            }
            InitializationMode::Running => running(&self.system, inputs, tank_pressure),
            InitializationMode::Given => variables.start,
        };
        warn_of_ignored_starts(variables, context);
        self.refresh(context.experiment.start_time, variables, inputs);
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let parameters = &variables.parameters;
        let mut states = variables.states;
        let tolerance = tolerance(parameters, context.experiment);
        let budget = budget(step.size);
        let mut done = 0.0;
        if parameters.valve.duty_latch {
            let begin = step.start - self.latch.start_time;
            let frequency = parameters.valve.pwm_frequency;
            // The duty is discrete: all periods that start within a step have the same one.
            if let Some(instant) = self.latch.next_before(begin + step.size, frequency) {
                done = (instant - begin).max(0.0);
                let interval = Interval { from: 0.0, to: done, tolerance, budget: &budget };
                self.integrate(&mut states, variables, step, interval)?;
                self.latch.take_until(begin + step.size, frequency, step.inputs.initial().hp_wastegate_pwm);
            }
        }
        let interval = Interval { from: done, to: step.size, tolerance, budget: &budget };
        let evaluation = self.integrate(&mut states, variables, step, interval)?;
        variables.states = states;
        let inputs = self.as_held(variables, step.inputs.at(step.size));
        match evaluation {
            Some(evaluation) => self.show(variables, &inputs, &evaluation),
            None => self.refresh(step.end(), variables, &inputs),
        }
        Ok(())
    }

    fn refresh(&mut self, _time: f64, variables: &mut Variables, inputs: &Inputs) {
        let inputs = self.as_held(variables, *inputs);
        let evaluation = self.system.evaluate(&inputs, &variables.states);
        self.show(variables, &inputs, &evaluation);
    }

    fn differentiate(
        &self,
        _time: Dual,
        variables: &Variables,
        inputs: &Inputs,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        let parameters = variables.parameters.combine(&direction.parameters, &mut Dual::new);
        let mut inputs = inputs.combine(direction.inputs(), &mut Dual::new);
        if variables.parameters.valve.duty_latch {
            // A new command does not act before the next period.
            inputs.hp_wastegate_pwm = Dual::from(self.latch.held);
        }
        let states = variables.states.combine(&direction.start, &mut Dual::new);
        Ok(derivatives_of(&System::new(&parameters), &inputs, &states))
    }

    fn differentiate_initialization(
        &self,
        _start_time: Dual,
        variables: &Variables,
        inputs: &Inputs,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        let parameters = variables.parameters.combine(&direction.parameters, &mut Dual::new);
        let inputs = inputs.combine(direction.inputs(), &mut Dual::new);
        let start = variables.start.combine(&direction.start, &mut Dual::new);
        let mode = variables.parameters.initialization.mode;
        let states = started(mode, &parameters, &inputs, &start, &variables.states)?;
        Ok(derivatives_of(&System::new(&parameters), &inputs, &states))
    }

    fn differentiate_backwards(
        &self,
        _time: f64,
        variables: &Variables,
        inputs: &Inputs,
        weights: &Variables,
        by_parameters: bool,
        tape: &mut Tape,
    ) -> Result<Variables, Error> {
        tape.clear();
        let tape = &*tape;
        let variable = |value| tape.variable(value);
        let parameters = if by_parameters {
            variables.parameters.map(variable)
        } else {
            variables.parameters.map(Recorded::from)
        };
        let inputs = inputs.map(variable);
        let mut acting = inputs;
        if variables.parameters.valve.duty_latch {
            // A new command does not act before the next period.
            acting.hp_wastegate_pwm = Recorded::from(self.latch.held);
        }
        let states = variables.states.map(variable);
        weigh(&System::new(&parameters), &acting, &states, weights, tape);
        let derivative = |number| tape.derivative(number);
        Ok(Variables {
            parameters: parameters.map(derivative),
            inputs: inputs.map(derivative),
            states: states.map(derivative),
            ..Variables::zero()
        })
    }

    fn differentiate_initialization_backwards(
        &self,
        _start_time: f64,
        variables: &Variables,
        inputs: &Inputs,
        weights: &Variables,
        tape: &mut Tape,
    ) -> Result<Variables, Error> {
        tape.clear();
        let tape = &*tape;
        let variable = |value| tape.variable(value);
        let parameters = variables.parameters.map(variable);
        let inputs = inputs.map(variable);
        let start = variables.start.map(variable);
        let mode = variables.parameters.initialization.mode;
        let states = started(mode, &parameters, &inputs, &start, &variables.states)?;
        weigh(&System::new(&parameters), &inputs, &states, weights, tape);
        let derivative = |number| tape.derivative(number);
        Ok(Variables {
            parameters: parameters.map(derivative),
            inputs: inputs.map(derivative),
            states: start.map(derivative),
            ..Variables::zero()
        })
    }

    fn take_parameters(&mut self, variables: &Variables) {
        self.system = System::new(&variables.parameters);
    }

    fn restored(&mut self, variables: &Variables) {
        self.take_parameters(variables);
    }
}

/// The importer's solver replaces `integration`. PWM periods are time events. Kinks of the equations, such as the rod's
/// stops and reversals, are not events: solvers do not need them (`docs/integration.md`).
impl ModelExchange for BoostPlant {
    fn next_event(&self, _time: f64, variables: &mut Variables, _inputs: &Inputs) -> Option<f64> {
        let valve = &variables.parameters.valve;
        valve.duty_latch.then(|| self.latch.next(valve.pwm_frequency))
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        _variables: &mut Variables,
        inputs: &Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            self.latch.take(inputs.hp_wastegate_pwm);
        }
        Ok(())
    }
}

impl BoostPlant {
    /// The inputs with the duty seen by the valve.
    fn as_held(&self, variables: &Variables, mut inputs: Inputs) -> Inputs {
        if variables.parameters.valve.duty_latch {
            inputs.hp_wastegate_pwm = self.latch.held;
        }
        inputs
    }

    /// Sets outputs, local variables and derivatives from the states, the effective inputs and their evaluation.
    fn show(&self, variables: &mut Variables, inputs: &Inputs, evaluation: &Evaluation) {
        variables.derivatives = evaluation.derivatives();
        (variables.outputs, variables.locals) = self.system.quantities(inputs, &variables.states, evaluation);
    }

    /// Advances the states over an interval, in s from the start of the step. Returns the evaluation at its end, unless
    /// it is empty.
    fn integrate(
        &mut self,
        states: &mut States,
        variables: &Variables,
        step: &Step<'_, Inputs>,
        interval: Interval<'_>,
    ) -> Result<Option<Evaluation>, Error> {
        if interval.to <= interval.from {
            return Ok(None);
        }
        let signal: &InputSignal<Inputs> = step.inputs;
        let initial = self.as_held(variables, *signal.initial());
        let (is_constant, latched) = (signal.is_constant(), variables.parameters.valve.duty_latch);
        let held = self.latch.held;
        let at = |time: f64| {
            if is_constant {
                return initial;
            }
            let mut inputs = signal.at(time);
            if latched {
                inputs.hp_wastegate_pwm = held;
            }
            inputs
        };
        self.pace.advance(&self.system, &IntervalInputs { at, is_constant }, states, interval).map(Some).map_err(|failure| {
            Error::new(format!(
                "{} cannot be integrated beyond {:?} s: even the shortest steps, or as many as are tried, miss \
                 the tolerance of {:?} of full scale; the equations are too stiff with these parameters and \
                 inputs",
                failure.state,
                step.start + failure.time,
                interval.tolerance
            ))
        })
    }
}

/// The derivatives of all variables calculated from inputs and states.
fn derivatives_of(system: &System<Dual>, inputs: &Inputs<Dual>, states: &States<Dual>) -> Variables {
    let evaluation = system.evaluate(inputs, states);
    let (outputs, locals) = system.quantities(inputs, states, &evaluation);
    let mut derivatives = Variables::zero();
    derivatives.states = states.map(|state| state.derivative);
    derivatives.derivatives = evaluation.derivatives().map(|rate| rate.derivative);
    derivatives.locals = locals.map(|local| local.derivative);
    derivatives.outputs = outputs.map(|output| output.derivative);
    derivatives
}

/// Backward pass of a tape from all variables calculated from inputs and states, with their weights.
fn weigh<'t>(
    system: &System<Recorded<'t>>,
    inputs: &Inputs<Recorded<'t>>,
    states: &States<Recorded<'t>>,
    weights: &Variables,
    tape: &'t Tape,
) {
    let evaluation = system.evaluate(inputs, states);
    let (outputs, locals) = system.quantities(inputs, states, &evaluation);
    let mut weigh = |number, weight| tape.weigh(number, weight);
    let _ = states.combine(&weights.states, &mut weigh);
    let _ = evaluation.derivatives().combine(&weights.derivatives, &mut weigh);
    let _ = locals.combine(&weights.locals, &mut weigh);
    let _ = outputs.combine(&weights.outputs, &mut weigh);
    tape.go_back();
}

/// The integration tolerance: the parameter's, or the importer's if smaller.
fn tolerance(parameters: &Parameters, experiment: Experiment) -> f64 {
    let asked = experiment.tolerance.unwrap_or(f64::INFINITY);
    parameters.solver.relative_tolerance.min(asked).max(SMALLEST_TOLERANCE)
}

/// Warns if the experiment does not start at rest.
fn warn_of_unsettled_start(settled: &Settled, inputs: &Inputs, context: &mut Context<'_>) {
    let Some(shortcoming) = &settled.shortcoming else { return };
    let reason = match shortcoming.failure {
        NoSteadyState::NotIsolated => "no isolated steady state exists",
        NoSteadyState::NotConverged => "no steady state was found",
    };
    let instead = if shortcoming.followed > 0.0 {
        format!("the state of a running engine after {} s", shortcoming.followed)
    } else {
        "a running engine, as its transient cannot be integrated".to_owned()
    };
    context.warn(format_args!(
        "initialization.mode = settled: {reason} with engine_speed = {} rpm, throttle = {} and the other \
         inputs; the experiment starts from {instead}",
        Rounded(inputs.engine_speed),
        Rounded(inputs.throttle)
    ));
}

/// Warns of start values ignored by the initialization mode.
fn warn_of_ignored_starts(variables: &Variables, context: &mut Context<'_>) {
    if variables.parameters.initialization.mode == InitializationMode::Given {
        return;
    }
    let (start, default) = (variables.start.to_array(), States::default().to_array());
    let ignored: Vec<_> = (0..States::COUNT)
        .filter(|&i| start[i].to_bits() != default[i].to_bits())
        .map(|i| States::NAMES[i])
        .filter(|&name| name != "tank.pressure")
        .collect();
    if !ignored.is_empty() {
        context.warn(format_args!(
            "the start values of {} are ignored: only initialization.mode = given uses them",
            ignored.join(", ")
        ));
    }
}
