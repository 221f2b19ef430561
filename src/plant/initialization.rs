//! The states at the start of an experiment.
//!
//! [`running`] is an engine just started: no boost, both shafts turning slowly, the wastegate shut. [`settled`] is the
//! steady state for the initial inputs, so that an experiment starts at rest: the actuation is solved in closed form,
//! the gas path with the steady-state solver. In both, the vacuum tank has its start pressure: it leaks and is never in
//! equilibrium.

use std::array;

use fmu_export::{Dual, Number, Simulation};

use super::BoostPlant;
use super::system::{GAS_PATH_SCALES, System};
use super::variables::{
    ActuationStates, GasPathStates, InitializationMode, Inputs, Parameters, StateGroups, States, Variables,
};
use crate::solver::linear;
use crate::solver::steady_state::{self, NoSteadyState};

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
    /// Why they are not a steady state, if so.
    pub shortcoming: Option<Shortcoming>,
}

/// Why an experiment does not start in a steady state.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortcoming {
    /// The solver's outcome.
    pub failure: NoSteadyState,
    /// The time in s for which the transient from [`running`] was simulated instead.
    pub followed: f64,
}

/// The steady state for the inputs, with the vacuum tank held at a pressure in Pa.
///
/// If none is found, the states at the end of the transient from [`running`].
pub fn settled(parameters: &Parameters, inputs: &Inputs, tank_pressure: f64) -> Settled {
    let mut system = System::new(parameters);
    system.freeze_tank(true);
    let start = running(&system, inputs, tank_pressure);
    let actuated = settle_actuation(&system, inputs, start);
    let chamber_pressure = actuated.actuator.chamber_pressure;
    let rates = |unknowns: &[f64; GAS_PATH]| settled_rates(&system, inputs, chamber_pressure, unknowns);
    let differentiated = System::new(&parameters.map(Dual::from));
    let constant_inputs = inputs.map(Dual::from);
    let rates_along = |unknowns: &[f64; GAS_PATH], position: usize| {
        settled_rates_along(&differentiated, &constant_inputs, chamber_pressure, unknowns, position)
    };
    let guess = GasPathStates::of(&actuated).to_array();
    match steady_state::find(rates, rates_along, guess, &GAS_PATH_SCALES.to_array()) {
        Ok(unknowns) => {
            let gas_path = GasPathStates::from_array(unknowns);
            Settled { states: settle_gas_path(&system, inputs, actuated, gas_path), shortcoming: None }
        }
        Err(failure) => {
            let (states, followed) = follow_transient(parameters, inputs, start);
            Settled { states, shortcoming: Some(Shortcoming { failure, followed }) }
        }
    }
}

/// The rates of the gas path with the rod at rest at the chamber pressure in Pa.
fn settled_rates<D: Number>(
    system: &System<D>,
    inputs: &Inputs<D>,
    chamber_pressure: D,
    unknowns: &[D; GAS_PATH],
) -> [D; GAS_PATH] {
    let gas_path = GasPathStates::from_array(*unknowns);
    let position = position_at_rest(system, inputs, chamber_pressure, &gas_path);
    system.gas_path(inputs, &gas_path, system.actuator.opening(position)).derivatives.to_array()
}

/// Their derivatives with respect to the unknown at a position.
fn settled_rates_along(
    system: &System<Dual>,
    inputs: &Inputs<Dual>,
    chamber_pressure: f64,
    unknowns: &[f64; GAS_PATH],
    position: usize,
) -> [f64; GAS_PATH] {
    let mut unknowns = unknowns.map(Dual::from);
    unknowns[position].derivative = 1.0;
    settled_rates(system, inputs, chamber_pressure.into(), &unknowns).map(|rate| rate.derivative)
}

/// The settled states as a function of parameters, inputs and the tank's pressure, by the implicit function theorem:
/// the unknowns keep their values, and change such that the rates along them stay 0.
pub fn follow_settled<D: Number>(
    parameters: &Parameters<D>,
    inputs: &Inputs<D>,
    settled: &States,
    tank_pressure: D,
) -> States<D> {
    let system = System::new(parameters);
    let actuated = settle_actuation(&system, inputs, running(&system, inputs, tank_pressure));
    let chamber_pressure = actuated.actuator.chamber_pressure;
    let (found, scales) = (GasPathStates::of(settled).to_array(), GAS_PATH_SCALES.to_array());
    let mut unknowns = found.map(D::from);
    let along = settled_rates(&system, inputs, chamber_pressure, &unknowns);
    if along.iter().any(|rate| !rate.is_constant(rate.value())) {
        // The same without the changes, so that only the unknowns change.
        let still = System::new(&parameters.map(|parameter| Dual::from(parameter.value())));
        let still_inputs = inputs.map(|input| Dual::from(input.value()));
        let mut jacobian = [[0.0; GAS_PATH]; GAS_PATH];
        for column in 0..GAS_PATH {
            let slopes = settled_rates_along(&still, &still_inputs, chamber_pressure.value(), &found, column);
            for row in 0..GAS_PATH {
                jacobian[row][column] = slopes[row] / scales[row] * scales[column];
            }
        }
        for (rate, (along, scale)) in along.iter().zip(scales).enumerate() {
            let right = array::from_fn(|i| if i == rate { -1.0 / scale } else { 0.0 });
            // A steady state that was found is isolated.
            let change = linear::solve(jacobian, right).unwrap_or([f64::NAN; GAS_PATH]);
            for (unknown, (change, scale)) in unknowns.iter_mut().zip(change.into_iter().zip(scales)) {
                *unknown += along.mapped(0.0, change * scale);
            }
        }
    }
    settle_gas_path(&system, inputs, actuated, GasPathStates::from_array(unknowns))
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

/// The position in m at which the rod rests without friction: membrane and exhaust forces balance spring and stops.
fn position_at_rest<D: Number>(
    system: &System<D>,
    inputs: &Inputs<D>,
    chamber_pressure: D,
    gas_path: &GasPathStates<D>,
) -> D {
    let exhaust_difference = System::exhaust_difference(gas_path);
    let (position, velocity) = (0.0.into(), 0.0.into());
    let forces = system.actuator.evaluate(
        position,
        velocity,
        inputs.ambient_pressure,
        chamber_pressure,
        exhaust_difference,
    );
    system.actuator.position_at_rest(forces.membrane_force + forces.exhaust_force)
}

/// The states with the gas path at rest, and with it the rod.
fn settle_gas_path<D: Number>(
    system: &System<D>,
    inputs: &Inputs<D>,
    actuated: States<D>,
    gas_path: GasPathStates<D>,
) -> States<D> {
    let mut states = States::from_groups(StateGroups { actuation: ActuationStates::of(&actuated), gas_path });
    states.actuator.position =
        position_at_rest(system, inputs, actuated.actuator.chamber_pressure, &gas_path);
    states
}

/// Simulates until everything is at rest, for at most [`LONGEST_TRANSIENT`]. Returns the states and the time in s, those
/// of the last whole second if the integration fails.
fn follow_transient(parameters: &Parameters, inputs: &Inputs, start: States) -> (States, f64) {
    let mut parameters = *parameters;
    parameters.initialization.mode = InitializationMode::Given;
    parameters.tank.frozen = true;
    parameters.valve.duty_latch = false;
    // The default, so that the start does not depend on integration settings.
    parameters.solver = Parameters::default().solver;
    let mut simulation = Simulation::<BoostPlant> {
        variables: Variables { parameters, start, ..Variables::default() },
        inputs: *inputs,
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
