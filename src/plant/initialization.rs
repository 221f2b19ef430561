//! The states at the start of an experiment.
//!
//! [`running`] is an engine that has just been started: no boost, both shafts turning slowly, the
//! wastegate shut. [`settled`] is the steady state for the inputs at the start, so that an experiment
//! begins at rest: the actuation is solved in closed form, the gas path with the solver of steady states.
//! In both the vacuum tank has its start pressure; a tank is never in equilibrium, since it leaks.

use num_dual::Dual64;

use super::scalar::Scalar;
use super::system::System;
use super::variables::{Inputs, Parameters, States};
use crate::solver::steady_state::{self, Failure};
use crate::solver::{linear, runge_kutta};

/// For how long at most the transient is followed when there is no steady state to solve for, in s.
const LONGEST_TRANSIENT: u32 = 60;
/// The rate of change in 1/s of the scaled states below which a transient has come to rest.
const AT_REST: f64 = 1e-9;

/// The rate of change in 1/s of the scaled states up to which they are a steady state: rounding leaves
/// some 1e-10, a transient that is being followed far more.
const SETTLED: f64 = 1e-8;

/// The settled unknowns: the pressures of the gas path in its order, and the speeds of the shafts.
const UNKNOWNS: usize = 10;
/// Their magnitudes in Pa and rad/s.
const SCALES: [f64; UNKNOWNS] = [1e5, 2e5, 2e5, 2e5, 2e5, 2e5, 1.5e5, 1e5, 2e4, 1e4];

/// The states of an engine that has just been started, with the vacuum tank at a pressure in Pa.
#[must_use]
pub fn running<D: Scalar>(system: &System<D>, inputs: &Inputs<D>, tank_pressure: D) -> States<D> {
    let ambient_pressure = inputs.ambient_pressure;
    // The speeds of the shafts and the rest of the actuator are those of the declared start values.
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
    /// Why they are no steady state, if they are none.
    pub shortcoming: Option<Shortcoming>,
}

/// Why an experiment does not start settled.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortcoming {
    /// What the solver found.
    pub failure: Failure,
    /// For how many seconds the transient of [`running`] was followed instead; 0 where it diverges.
    pub followed: f64,
}

/// The steady state for the inputs, with the vacuum tank held at a pressure in Pa.
///
/// Where there is none, or none is found, the states that the transient from [`running`] reaches.
#[must_use]
pub fn settled(parameters: &Parameters, inputs: &Inputs, tank_pressure: f64) -> Settled {
    let mut system = System::new(parameters);
    system.freeze_tank(true);
    let start = running(&system, inputs, tank_pressure);
    let actuated = settle_actuation(&system, inputs, start);
    let rates = |unknowns: &[f64; UNKNOWNS]| settled_rates(&system, inputs, actuated, unknowns);
    let mut differentiated = System::new(&parameters.map(Dual64::from));
    differentiated.freeze_tank(true);
    let (constant_inputs, constant_states) = (inputs.map(Dual64::from), actuated.map(Dual64::from));
    let rates_along = |unknowns: &[f64; UNKNOWNS], position: usize| {
        let mut unknowns = unknowns.map(Dual64::from);
        unknowns[position].eps = 1.0;
        settled_rates(&differentiated, &constant_inputs, constant_states, &unknowns).map(|rate| rate.eps)
    };
    match steady_state::find(rates, rates_along, unknowns_of(&actuated), &SCALES) {
        Ok(unknowns) => Settled {
            states: settle_rod(&system, inputs, with_unknowns(actuated, &unknowns)),
            shortcoming: None,
        },
        Err(failure) => {
            let (states, followed) = follow_transient(&system, inputs, start);
            Settled { states, shortcoming: Some(Shortcoming { failure, followed }) }
        }
    }
}

/// The rates of the unknowns where everything else is settled.
fn settled_rates<D: Scalar>(
    system: &System<D>,
    inputs: &Inputs<D>,
    actuated: States<D>,
    unknowns: &[D; UNKNOWNS],
) -> [D; UNKNOWNS] {
    let states = settle_rod(system, inputs, with_unknowns(actuated, unknowns));
    unknowns_of(&system.evaluate(inputs, &states).derivatives())
}

/// The settled states with their derivatives along the direction in which parameters, inputs and the
/// tank's pressure change, by the implicit function theorem.
///
/// `None` where the states are no steady state, or not an isolated one.
#[must_use]
pub fn differentiate_settled(
    parameters: &Parameters<Dual64>,
    inputs: &Inputs<Dual64>,
    settled: &States,
    tank_pressure: Dual64,
) -> Option<States<Dual64>> {
    let mut system = System::new(parameters);
    system.freeze_tank(true);
    let actuated = settle_actuation(&system, inputs, running(&system, inputs, tank_pressure));
    let found = unknowns_of(settled);
    let along = settled_rates(&system, inputs, actuated, &found.map(Dual64::from));
    if (0..UNKNOWNS).any(|i| along[i].re.abs() > SETTLED * SCALES[i]) {
        return None;
    }
    // The same without the direction, so that the unknowns alone change.
    let mut still = System::new(&parameters.map(|parameter| Dual64::from(parameter.re)));
    still.freeze_tank(true);
    let still_inputs = inputs.map(|input| Dual64::from(input.re));
    let still_actuated = actuated.map(|state| Dual64::from(state.re));
    let mut jacobian = [[0.0; UNKNOWNS]; UNKNOWNS];
    for column in 0..UNKNOWNS {
        let mut unknowns = found.map(Dual64::from);
        unknowns[column].eps = SCALES[column];
        let slopes = settled_rates(&still, &still_inputs, still_actuated, &unknowns);
        for row in 0..UNKNOWNS {
            jacobian[row][column] = slopes[row].eps / SCALES[row];
        }
    }
    let change = linear::solve(jacobian, std::array::from_fn(|i| -along[i].eps / SCALES[i]))?;
    let unknowns = std::array::from_fn(|i| Dual64::new(found[i], change[i] * SCALES[i]));
    Some(settle_rod(&system, inputs, with_unknowns(actuated, &unknowns)))
}

/// Brings the plunger and the chamber to rest.
///
/// The closed form holds where a search would meet a double root: at low duties the valve's target is
/// ambient pressure over a whole range.
fn settle_actuation<D: Scalar>(system: &System<D>, inputs: &Inputs<D>, mut states: States<D>) -> States<D> {
    let duty = system.command(inputs).1;
    states.valve.plunger_duty = duty;
    states.actuator.chamber_pressure =
        system.valve.chamber_pressure_at_rest(duty, inputs.ambient_pressure, states.tank.pressure);
    states
}

/// Brings the rod to rest without friction: there the forces of membrane and exhaust meet those of spring
/// and stops.
fn settle_rod<D: Scalar>(system: &System<D>, inputs: &Inputs<D>, mut states: States<D>) -> States<D> {
    let forces = system.actuator.forces(
        0.0.into(),
        0.0.into(),
        inputs.ambient_pressure,
        states.actuator.chamber_pressure,
        states.exhaust_manifold.pressure - states.interstage_exhaust.pressure,
    );
    states.actuator.position = system.actuator.position_at_rest(forces.membrane + forces.exhaust);
    states
}

/// The places of the unknowns among the states or their derivatives.
fn places<D>(states: &mut States<D>) -> [&mut D; UNKNOWNS] {
    [
        &mut states.air_filter.pressure,
        &mut states.lp_compressor.outlet_pressure,
        &mut states.hp_compressor.outlet_pressure,
        &mut states.intercooler.outlet_pressure,
        &mut states.intake_manifold.pressure,
        &mut states.exhaust_manifold.pressure,
        &mut states.interstage_exhaust.pressure,
        &mut states.exhaust.pressure,
        &mut states.hp_shaft.speed,
        &mut states.lp_shaft.speed,
    ]
}

/// The unknowns among the states or their derivatives.
fn unknowns_of<D: Copy>(states: &States<D>) -> [D; UNKNOWNS] {
    places(&mut states.clone()).map(|unknown| *unknown)
}

/// The states with other values of the unknowns.
fn with_unknowns<D: Copy>(mut states: States<D>, unknowns: &[D; UNKNOWNS]) -> States<D> {
    for (place, &unknown) in places(&mut states).into_iter().zip(unknowns) {
        *place = unknown;
    }
    states
}

/// Integrates until everything is at rest, for [`LONGEST_TRANSIENT`] at most. Returns the states and the
/// time in s; where the integration diverges the states it began with, and 0.
fn follow_transient(system: &System, inputs: &Inputs, start: States) -> (States, f64) {
    let rates = |x: &[f64; States::COUNT]| -> [f64; States::COUNT] {
        system.evaluate(inputs, &States::from_array(*x)).derivatives().to_array()
    };
    let scales = start.to_array().map(|x| x.abs().max(1.0));
    let mut x = start.to_array();
    for second in 0..LONGEST_TRANSIENT {
        let slopes = rates(&x);
        if (0..States::COUNT).all(|i| slopes[i].abs() < AT_REST * scales[i]) {
            return (States::from_array(x), f64::from(second));
        }
        for _ in 0..runge_kutta::substeps(1.0) {
            runge_kutta::step(|_, x| rates(x), &mut x, runge_kutta::LONGEST_STEP);
        }
        if x.iter().any(|x| !x.is_finite()) {
            return (start, 0.0);
        }
    }
    (States::from_array(x), f64::from(LONGEST_TRANSIENT))
}
