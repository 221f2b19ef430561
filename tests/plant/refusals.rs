//! Inconsistent parameters of the plant, and their messages.

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{Inputs, Parameters, Variables};
use fmu_export::Model;

use crate::bench::Bench;

/// The message when parameters are refused.
fn refusal(change: impl FnOnce(&mut Parameters)) -> String {
    let mut variables = Variables::default();
    change(&mut variables.parameters);
    BoostPlant::check_parameters(&variables).err().map_or(String::new(), |error| error.to_string())
}

#[test]
fn the_defaults_are_consistent() {
    assert_eq!(refusal(|_| {}), "");
}

#[test]
fn friction_that_is_too_stiff_for_the_step_is_refused() {
    // The default is at the limit; rounding must not exceed it.
    assert_eq!(refusal(|p| (p.actuator.coulomb_friction, p.actuator.friction_stiffness) = (0.3, 600.0)), "");
    let message = refusal(|p| p.actuator.friction_stiffness = 401.0);
    assert!(message.contains("actuator.friction_stiffness = 401.0"), "{message}");
    assert!(message.contains("actuator.coulomb_friction = 0.2"), "{message}");
}

#[test]
fn a_chamber_that_the_membrane_fills_is_refused() {
    let message = refusal(|p| p.actuator.chamber_volume = 15e-6);
    assert!(message.contains("actuator.chamber_volume") && message.contains("actuator.stroke"), "{message}");
}

#[test]
fn parameters_that_just_agree_are_accepted() {
    assert_eq!(refusal(|p| p.actuator.chamber_volume = 15.01e-6), "");
    assert_eq!(refusal(|p| (p.air.gas_constant, p.air.specific_heat) = (999.0, 1000.0)), "");
}

#[test]
fn a_gas_without_heat_capacity_at_constant_volume_is_refused() {
    let message = refusal(|p| p.exhaust_gas.specific_heat = 500.0);
    assert_eq!(message, "", "500 J/(kg K) is little but consistent with 290");
    let message = refusal(|p| p.air.gas_constant = 1005.0);
    assert!(
        message.contains("air.gas_constant = 1005.0") && message.contains("air.specific_heat"),
        "{message}"
    );
}

#[test]
fn the_lightest_rod_against_the_stiffest_stops_is_integrated() {
    // It oscillates at 1e5 rad/s.
    let mut bench = Bench::new(Inputs::default(), |p, _| {
        p.actuator.mass = 1e-3;
        p.actuator.stop_stiffness = 1e7;
    });
    bench.variables.inputs.hp_wastegate_pwm = 0.0;
    bench.run(1.0);
    let states = &bench.variables.states;
    // The spring's preload of 19 N presses it 1.9 um into the stop.
    assert!((states.actuator.position + 1.9e-6).abs() < 1e-7, "{} m", states.actuator.position);
}
