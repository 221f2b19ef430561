//! The states at the start of an experiment.
//!
//! [`running`] is an engine just started: no boost, both shafts turning slowly, the wastegate shut. [`settled`] is the
//! steady state for the initial inputs, so that an experiment starts at rest: the actuation is solved in closed form,
//! the gas path by [`steady_state`]. In both, the vacuum tank has its start pressure: it leaks and is never in
//! equilibrium.

use fmu_export::steady_state::{self, NoSteadyState};
use fmu_export::{Dual, Number, Simulation};

use super::BoostPlant;
use super::system::{GAS_PATH_SCALES, System};
use super::variables::{
    ActuationStates, GasPathStates, InitializationMode, Inputs, Parameters, StateGroups, States, Variables,
};

const GAS_PATH: usize = GasPathStates::COUNT;

/// The longest simulated transient if no steady state is found, in s.
const LONGEST_TRANSIENT: u32 = 60;
/// The rate of change in 1/s of the scaled states below which a transient has settled.
const AT_REST: f64 = 1e-9;

/// The states of an engine just started, with the vacuum tank at a pressure in Pa.
pub fn running<D: Number>(system: &System<D>, inputs: &Inputs<D>, tank_pressure: D) -> States<D> {
    let ambient_pressure = inputs.ambient_pressure;
    // Shaft speeds and the rest of the actuator keep their declared start values.
    let mut states = States::default().map(D::from);
    states.supply_sensor.voltage = system.command(inputs).0;
    states.tank.pressure = tank_pressure;
    states.actuator.chamber_pressure = ambient_pressure;
    states.air_filter.pressure = ambient_pressure - 200.0;
    states.lp_compressor.outlet_pressure = ambient_pressure;
    states.hp_compressor.outlet_pressure = ambient_pressure + 500.0;
    states.intercooler.outlet_pressure = ambient_pressure;
    states.intake_manifold.pressure = ambient_pressure * 0.98;
    states.exhaust_manifold.pressure = ambient_pressure + 1e4;
    states.interstage_exhaust.pressure = ambient_pressure + 4e3;
    states.exhaust.pressure = ambient_pressure + 800.0;
    states
}

/// The outcome of the search for the settled states.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// The states to start from.
    pub states: States,
    /// Why the states are not a steady state, if so.
    pub shortcoming: Option<Shortcoming>,
}

/// The reason why an experiment does not start in a steady state.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortcoming {
    /// The solver's outcome.
    pub failure: NoSteadyState,
    /// The time in s for which the transient from [`running`] was simulated instead.
    pub followed: f64,
}

/// The gas path and the rod at rest, for parameters, inputs and a tank pressure in Pa.
struct AtRest<T: Number> {
    system: System<T>,
    inputs: Inputs<T>,
    /// The states with the actuation at rest.
    actuated: States<T>,
}

impl<T: Number> AtRest<T> {
    fn new(parameters: &Parameters<T>, inputs: &Inputs<T>, tank_pressure: T) -> Self {
        let system = System::new(parameters);
        let running = running(&system, inputs, tank_pressure);
        Self { actuated: settle_actuation(&system, inputs, running), inputs: *inputs, system }
    }

    /// The rates of the gas path with the rod at rest.
    fn rates(&self, unknowns: [T; GAS_PATH]) -> [T; GAS_PATH] {
        let gas_path = GasPathStates::from_array(unknowns);
        let opening = self.system.actuator.opening(self.position(&gas_path));
        self.system.gas_path(&self.inputs, &gas_path, opening).derivatives.to_array()
    }

    /// The position in m at which the rod rests without friction: membrane and exhaust forces balance spring and stops.
    fn position(&self, gas_path: &GasPathStates<T>) -> T {
        let forces = self.system.actuator.evaluate(
            0.0.into(),
            0.0.into(),
            self.inputs.ambient_pressure,
            self.actuated.actuator.chamber_pressure,
            System::exhaust_difference(gas_path),
        );
        self.system.actuator.position_at_rest(forces.membrane_force + forces.exhaust_force)
    }

    /// The states with the gas path at rest, and with it the rod.
    fn states(&self, unknowns: [T; GAS_PATH]) -> States<T> {
        let gas_path = GasPathStates::from_array(unknowns);
        let actuation = ActuationStates::of(&self.actuated);
        let mut states = States::from_groups(StateGroups { actuation, gas_path });
        states.actuator.position = self.position(&gas_path);
        states
    }
}

/// The steady state for the inputs, with the vacuum tank held at a pressure in Pa.
///
/// If none is found, the states at the end of the transient from [`running`].
#[inline]
pub fn settled(parameters: &Parameters, inputs: &Inputs, tank_pressure: f64) -> Settled {
    let at_rest = AtRest::new(parameters, inputs, tank_pressure);
    let still = AtRest::new(&parameters.map(Dual::from), &inputs.map(Dual::from), tank_pressure.into());
    let guess = GasPathStates::of(&at_rest.actuated).to_array();
    match steady_state::find(|unknowns| still.rates(unknowns), guess, &GAS_PATH_SCALES.to_array()) {
        Ok(unknowns) => Settled { states: at_rest.states(unknowns), shortcoming: None },
        Err(failure) => {
            let start = running(&at_rest.system, inputs, tank_pressure);
            let (states, followed) = follow_transient(parameters, inputs, start);
            Settled { states, shortcoming: Some(Shortcoming { failure, followed }) }
        }
    }
}

/// The settled states as a function of parameters, inputs and the tank's pressure.
pub fn follow_settled<T: Number>(
    parameters: &Parameters<T>,
    inputs: &Inputs<T>,
    settled: &States,
    tank_pressure: T,
) -> States<T> {
    let at_rest = AtRest::new(parameters, inputs, tank_pressure);
    let still = AtRest::new(
        &parameters.map(|parameter| Dual::from(parameter.value())),
        &inputs.map(|input| Dual::from(input.value())),
        tank_pressure.value().into(),
    );
    at_rest.states(steady_state::follow(
        GasPathStates::of(settled).to_array(),
        &GAS_PATH_SCALES.to_array(),
        |unknowns| at_rest.rates(unknowns),
        |unknowns| still.rates(unknowns),
    ))
}

/// Brings the plunger and the chamber to rest.
///
/// The closed form works where a search would meet a double root: at low duties the valve's target is ambient pressure
/// over a whole range.
fn settle_actuation<D: Number>(system: &System<D>, inputs: &Inputs<D>, mut states: States<D>) -> States<D> {
    let duty = system.command(inputs).1;
    states.valve.plunger_duty = duty;
    states.actuator.chamber_pressure =
        system.valve.chamber_pressure_at_rest(duty, inputs.ambient_pressure, states.tank.pressure);
    states
}

/// Simulates until everything is at rest, for at most [`LONGEST_TRANSIENT`]. Returns the states and the time in s, those
/// of the last whole second if the integration fails.
///
/// As its callers, it is compiled with the library that exports the model. Otherwise that library would have the model's
/// runtime twice: from this crate and from its own.
#[inline]
fn follow_transient(parameters: &Parameters, inputs: &Inputs, start: States) -> (States, f64) {
    let mut parameters = *parameters;
    parameters.initialization.mode = InitializationMode::Given;
    parameters.tank.frozen = true;
    parameters.valve.duty_latch = false;
    // The default, so that the start does not depend on integration settings.
    parameters.solver = Parameters::default().solver;
    let mut simulation = Simulation::<BoostPlant> {
        variables: Variables { parameters, inputs: *inputs, start, ..Variables::default() },
        ..Simulation::default()
    };
    if simulation.initialize().is_ok() {
        for second in 0..LONGEST_TRANSIENT {
            let states = simulation.variables.states;
            let derivatives = simulation.variables.derivatives.to_array();
            let is_at_rest = |(slope, start): (&f64, f64)| slope.abs() < AT_REST * start.abs().max(1.0);
            if derivatives.iter().zip(start.to_array()).all(is_at_rest) || simulation.step(1.0).is_err() {
                return (states, f64::from(second));
            }
        }
    }
    (simulation.variables.states, f64::from(LONGEST_TRANSIENT))
}
