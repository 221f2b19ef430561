//! The strategy by speed: the active turbocharger, and boost control by the low-pressure wastegate.

use boost_fmu::controller::variables::{ControlMode, Inputs};

use crate::bench::Bench;

#[test]
fn the_low_pressure_wastegate_opens_with_speed_and_the_bypass_has_a_hysteresis() {
    for mode in [ControlMode::Boost, ControlMode::Position, ControlMode::OpenLoop] {
        let mut inputs = Inputs { boost_reference: 200e3, ..Inputs::default() };
        let mut bench = Bench::by_speed(&inputs, |parameters| parameters.mode = mode);
        let speeds =
            [0.0, 2000.0, 2375.0, 3499.0, 3500.0, 3499.0, 3401.0, 3400.0, 3450.0, 3500.0, 8000.0, 2000.0];
        let lp_wastegate =
            [0.0, 0.0, 0.25, 1499.0 / 1500.0, 0.0, 0.0, 0.0, 14.0 / 15.0, 14.5 / 15.0, 0.0, 0.0, 0.0];
        let bypass = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0];
        for (number, speed) in (0..).zip(speeds) {
            inputs.engine_speed = speed;
            let outputs = bench.sample(number, &inputs);
            let at = number as usize;
            assert_eq!(
                (outputs.lp_wastegate, outputs.hp_bypass),
                (lp_wastegate[at], bypass[at]),
                "{mode:?} at {speed} rpm, sample {number}"
            );
        }
    }
}

#[test]
fn bypassing_opens_the_high_pressure_wastegate_in_mode_boost_only() {
    let inputs = Inputs {
        engine_speed: 4000.0,
        supply_voltage_measured: 10.0,
        pwm_reference: 50.0,
        ..Inputs::default()
    };
    let duty = |mode| {
        let mut bench = Bench::by_speed(&inputs, |parameters| parameters.mode = mode);
        let initial = bench.variables.outputs;
        assert_eq!(bench.sample(0, &inputs).hp_wastegate_pwm, initial.hp_wastegate_pwm);
        assert_eq!((initial.lp_wastegate, initial.hp_bypass), (0.0, 1.0));
        initial.hp_wastegate_pwm
    };
    assert_eq!(duty(ControlMode::Boost), 75.0 * 1.2);
    assert_eq!(duty(ControlMode::OpenLoop), 50.0 * 1.2);
    let weak = Inputs { supply_voltage_measured: 7.0, ..inputs };
    assert_eq!(Bench::by_speed(&weak, |_| {}).variables.outputs.hp_wastegate_pwm, 100.0);
}

/// 10 kPa above the reference: it enters shut, then opens by k Ts/T e = 2e-5 · 0.0125 / 1.5 · 1e4 a sample.
#[test]
fn the_low_pressure_loop_by_hand() {
    let mut inputs =
        Inputs { engine_speed: 4000.0, boost_reference: 140e3, boost_pressure: 150e3, ..Inputs::default() };
    let mut bench = Bench::by_speed(&inputs, |_| {});
    let rate = 2e-5 * 0.0125 / 1.5 * 1e4;
    for number in 0..400 {
        let opening = bench.sample(number, &inputs).lp_wastegate;
        // Sums of up to 400 terms.
        assert!((opening - f64::from(number) * rate).abs() < 1e-12, "sample {number}: {opening}");
    }
    // Far below the reference it is shut, without windup: it opens after a few tracking times of 1.5 s.
    inputs.boost_pressure = 100e3;
    for number in 400..288_400 {
        bench.sample(number, &inputs);
    }
    assert_eq!(bench.variables.outputs.lp_wastegate, 0.0);
    inputs.boost_pressure = 150e3;
    assert!(bench.sample(288_400, &inputs).lp_wastegate > 0.1, "0.2 from the proportional term at once");
}

/// Below a sample's length the integral time must not make the tracking overshoot.
#[test]
fn the_low_pressure_loop_survives_an_integral_time_below_the_sample_time() {
    let mut inputs = Inputs { engine_speed: 4000.0, boost_reference: 120e3, ..Inputs::default() };
    let mut bench = Bench::by_speed(&inputs, |parameters| {
        parameters.sample_time = 1.0;
        parameters.low_pressure_integral_time = 1e-3;
        parameters.low_pressure_gain = 1e-2;
    });
    for number in 0..10_000 {
        inputs.boost_pressure = if number % 3 == 0 { 1e6 } else { 20e3 };
        let opening = bench.sample(number, &inputs).lp_wastegate;
        assert!((0.0..=1.0).contains(&opening), "sample {number}: {opening}");
    }
}

/// Each handover resets both loops.
#[test]
fn a_handover_resets_both_loops() {
    let mut inputs = Inputs { boost_reference: 150e3, boost_pressure: 140e3, ..Inputs::default() };
    let mut bench = Bench::by_speed(&inputs, |_| {});
    for number in 0..100 {
        bench.sample(number, &inputs);
    }
    assert!(bench.variables.locals.integral_term != 0.0);
    inputs.engine_speed = 4000.0;
    bench.sample(100, &inputs);
    assert_eq!(bench.variables.locals.integral_term, 0.0);
    assert_eq!(bench.variables.locals.reference_model_pressure, 140e3);
    inputs.engine_speed = 1500.0;
    inputs.boost_pressure = 145e3;
    bench.sample(101, &inputs);
    let locals = bench.variables.locals;
    // As at a first sample, except for the pressure derivative, which is already known.
    assert_eq!((locals.proportional_term, locals.integral_term), (0.0, 0.0));
    assert!(locals.derivative_term > 0.0);
    assert_eq!(locals.reference_model_pressure, 140e3);

    inputs.engine_speed = 4000.0;
    inputs.boost_pressure = 190e3;
    assert_eq!(bench.sample(102, &inputs).lp_wastegate, 0.0, "it enters shut each time");
    assert!(bench.sample(103, &inputs).lp_wastegate > 0.0);
}
