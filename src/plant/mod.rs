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
//! [`Plant`] is the model: its equations, start (`initialization`) and integration over communication steps
//! (`integration`).

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

use fmu_export::display::{Rounded, Seconds};
use fmu_export::{
    Context, Equations, Error, Event, Experiment, InputSignal, Integrated, Number, Persistent, Step,
};

use self::duty_latch::DutyLatch;
use self::initialization::{Settled, follow_settled, running, settled};
use self::integration::{IntervalInputs, Pace, budget};
use self::system::{Instant, System};
use self::variables::{Evaluation, InitializationMode, Inputs, Parameters, States, Variables};
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

/// The plant as an FMU's model.
pub type BoostPlant = Integrated<Plant>;

/// The plant's equations, with its own integrator in co-simulation (`integration`).
///
/// In Model Exchange the importer's takes its place. PWM periods are time events. Kinks of the equations, such as the
/// rod's stops and reversals, are not events: solvers do not need them (`docs/integration.md`).
#[derive(Clone, Debug, Persistent)]
pub struct Plant {
    /// Derived from the parameters, for the integration.
    #[persistent(skip)]
    system: System,
    latch: DutyLatch,
    pace: Pace,
    /// The states of a settled start, for its derivatives.
    found: States,
    /// Whether they are a steady state.
    is_settled: bool,
}

impl Default for Plant {
    fn default() -> Self {
        Self {
            system: System::new(&Parameters::default()),
            latch: DutyLatch::default(),
            pace: Pace::default(),
            found: States::default(),
            is_settled: true,
        }
    }
}

impl Equations for Plant {
    type Variables = Variables;
    const LONGEST_STEP: f64 = LONGEST_STEP;
    const ADVANCES_ITSELF: bool = true;

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

    fn prepare(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        let Variables { parameters, inputs, start, .. } = variables;
        self.latch = DutyLatch::new(context.experiment.start_time);
        if parameters.initialization.mode == InitializationMode::Settled {
            let settled = settled(parameters, inputs, start.tank.pressure);
            warn_of_unsettled_start(&settled, inputs, context);
            (self.found, self.is_settled) = (settled.states, settled.shortcoming.is_none());
        }
        warn_of_ignored_starts(variables, context);
        Ok(())
    }

    fn take_parameters(&mut self, variables: &Variables) {
        self.system = System::new(&variables.parameters);
    }

    fn initialize<T: Number>(&self, variables: &mut Variables<T>) {
        let Variables { parameters, inputs, states, .. } = variables;
        let tank_pressure = states.tank.pressure;
        match parameters.initialization.mode {
            InitializationMode::Settled => {
                *states = if self.is_settled {
                    follow_settled(parameters, inputs, &self.found, tank_pressure)
                } else {
                    self.found.map(T::from)
                };
            }
            InitializationMode::Running => {
                *states = running(&System::new(parameters), inputs, tank_pressure);
            }
            InitializationMode::Given => {}
        }
    }

    fn check_start(&self) -> Result<(), Error> {
        if self.is_settled {
            return Ok(());
        }
        Err(Error::new("the experiment does not start settled, so its start has no derivative"))
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        self.evaluate_with(&System::new(variables.parameters), variables);
    }

    fn evaluate_values(&self, _time: f64, variables: Evaluation<'_>) {
        self.evaluate_with(&self.system, variables);
    }

    fn advance(
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
            if let Some(period_start) = self.latch.next_before(begin + step.size, frequency) {
                done = (period_start - begin).max(0.0);
                let interval = Interval { from: 0.0, to: done, tolerance, budget: &budget };
                self.integrate(&mut states, parameters, step, interval)?;
                self.latch.take_until(begin + step.size, frequency, step.inputs.initial().hp_wastegate_pwm);
            }
        }
        let interval = Interval { from: done, to: step.size, tolerance, budget: &budget };
        let instant = self.integrate(&mut states, parameters, step, interval)?;
        let inputs = self.latch.hold(parameters, step.inputs.at(step.size));
        let instant = instant.unwrap_or_else(|| self.system.evaluate(&inputs, &states));
        variables.states = states;
        variables.derivatives = instant.derivatives();
        (variables.outputs, variables.locals) = self.system.quantities(&inputs, &states, &instant);
        Ok(())
    }

    fn next_event(&self, _time: f64, variables: &Variables) -> Option<f64> {
        let valve = &variables.parameters.valve;
        valve.duty_latch.then(|| self.latch.next(valve.pwm_frequency))
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            self.latch.take(variables.inputs.hp_wastegate_pwm);
        }
        Ok(())
    }
}

impl Plant {
    fn evaluate_with<T: Number>(&self, system: &System<T>, variables: Evaluation<'_, T>) {
        let Evaluation { parameters, inputs, states, derivatives, locals, outputs } = variables;
        let inputs = self.latch.hold(parameters, *inputs);
        let instant = system.evaluate(&inputs, states);
        *derivatives = instant.derivatives();
        (*outputs, *locals) = system.quantities(&inputs, states, &instant);
    }

    /// Advances the states over an interval, in s from the start of the step. Returns the evaluation at its end, unless
    /// it is empty.
    fn integrate(
        &mut self,
        states: &mut States,
        parameters: &Parameters,
        step: &Step<'_, Inputs>,
        interval: Interval<'_>,
    ) -> Result<Option<Instant>, Error> {
        if interval.to <= interval.from {
            return Ok(None);
        }
        let Self { system, latch, pace, .. } = self;
        let signal: &InputSignal<Inputs> = step.inputs;
        let (initial, is_constant) = (latch.hold(parameters, *signal.initial()), signal.is_constant());
        let at = |time: f64| if is_constant { initial } else { latch.hold(parameters, signal.at(time)) };
        pace.advance(system, &IntervalInputs { at, is_constant }, states, interval).map(Some).map_err(|failure| {
            Error::new(format!(
                "{} cannot be integrated beyond {} s: even the shortest steps, or as many as are tried, miss \
                 the tolerance of {:?} of full scale; the equations are too stiff with these parameters and \
                 inputs",
                failure.state,
                Seconds(step.start + failure.time),
                interval.tolerance
            ))
        })
    }
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
