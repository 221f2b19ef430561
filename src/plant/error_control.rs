//! The plant's error control: the error that each state may have in an integration step, weighted by its effect on the
//! other quantities.

use super::system::GAS_PATH_SCALES;
use super::variables::{ActuationStates, States};

/// Extra weight of tank pressure errors, since they do not decay.
const TANK_STRICTNESS: f64 = 35.0;
/// Slack for rod speed, which is fast and tiny.
const ROD_SPEED_SLACK: f64 = 10.0;
/// Slack for the friction force, which kinks where the rod reverses.
const FRICTION_SLACK: f64 = 1.25;

/// The share of the tolerance for the error of a single step of the actuation: the errors of several steps and of kinks
/// add up, and the gas path amplifies rod position errors up to three times. Found by experiment, as is the gas path's.
const ACTUATION_SHARE: f64 = 0.1;
const GAS_PATH_SHARE: f64 = 0.28;

/// Flows through a compressor or wastegate depend steeply on the pressures of its volumes, so these pressures have a
/// smaller scale, with which flows reach 0.01 % of their full scale too. These fractions of the full scales count as
/// 100 %.
const BEFORE_LP_COMPRESSOR: f64 = 0.6;
const BETWEEN_COMPRESSORS: f64 = 0.3;
const BEHIND_HP_COMPRESSOR: f64 = 0.75;
const BEFORE_HP_WASTEGATE: f64 = 0.6;
const BETWEEN_WASTEGATES: f64 = 2.0 / 3.0;

/// The error that a tolerance of 1 allows in each state, in the order of the states.
pub const ERROR_SCALES: [f64; States::COUNT] = {
    let mut actuation = ActuationStates::NOMINAL;
    actuation.tank.pressure /= TANK_STRICTNESS;
    actuation.actuator.velocity *= ROD_SPEED_SLACK;
    actuation.actuator.friction_force *= FRICTION_SLACK;
    let mut gas_path = GAS_PATH_SCALES;
    gas_path.air_filter.pressure *= BEFORE_LP_COMPRESSOR;
    gas_path.lp_compressor.outlet_pressure *= BETWEEN_COMPRESSORS;
    gas_path.hp_compressor.outlet_pressure *= BEHIND_HP_COMPRESSOR;
    gas_path.exhaust_manifold.pressure *= BEFORE_HP_WASTEGATE;
    gas_path.interstage_exhaust.pressure *= BETWEEN_WASTEGATES;
    let (actuation, gas_path) = (actuation.to_array(), gas_path.to_array());
    let mut scales = [0.0; States::COUNT];
    let mut i = 0;
    while i < States::COUNT {
        scales[i] = if i < ActuationStates::COUNT {
            actuation[i] * ACTUATION_SHARE
        } else {
            gas_path[i - ActuationStates::COUNT] * GAS_PATH_SHARE
        };
        i += 1;
    }
    scales
};
