//! The clock: the controller depends only on the samples, not on the master's steps.

use std::ptr;

use boost_fmu::BoostController;
use boost_fmu::controller::variables::{ControlMode, Inputs, Locals, Outputs, Parameters, Variables};
use fmu_export::Described as _;
use fmu_export::fmi2::{c_api, c_types};

use crate::bench::Bench;
use crate::random::Random;

const SAMPLE_TIME: f64 = 0.0125;

/// Inputs of a sample: around a step of the reference, so that every part of the law acts.
fn inputs_of_sample(number: u32) -> Inputs {
    let phase = f64::from(number) * SAMPLE_TIME;
    Inputs {
        boost_reference: if number.is_multiple_of(160) { 150e3 } else { 135e3 },
        boost_pressure: 140e3 + 8e3 * (3.0 * phase).sin(),
        tank_pressure: 32.5e3 + 4e3 * phase.sin(),
        supply_voltage_measured: 12.0 + (7.0 * phase).cos(),
        engine_speed: 2500.0 + 1200.0 * (0.7 * phase).sin(),
        ..Inputs::default()
    }
}

/// The outputs and diagnostics after each of the first samples, in steps of the sample time.
fn at_own_pace(samples: u32) -> Vec<(Outputs, Locals)> {
    let mut bench = Bench::new(&inputs_of_sample(0), |_| {});
    (0..samples)
        .map(|number| (bench.sample(number, &inputs_of_sample(number)), bench.variables.locals))
        .collect()
}

#[test]
fn shorter_steps_change_nothing() {
    let expected = at_own_pace(800);
    for division in [2_u32, 3, 7] {
        let mut bench = Bench::new(&inputs_of_sample(0), |_| {});
        let size = SAMPLE_TIME / f64::from(division);
        for step in 0..800 * division {
            let number = step / division;
            bench.step(f64::from(step) * size, size, &inputs_of_sample(number));
            assert_eq!((bench.variables.outputs, bench.variables.locals), expected[number as usize]);
        }
    }
}

#[test]
fn uneven_steps_change_nothing() {
    let expected = at_own_pace(800);
    let mut random = Random(7);
    let mut bench = Bench::new(&inputs_of_sample(0), |_| {});
    for (number, expected) in (0..).zip(&expected) {
        let begin = f64::from(number) * SAMPLE_TIME;
        let end = f64::from(number + 1) * SAMPLE_TIME;
        let mut time = begin;
        while time < end {
            let next = (time + random.between(1e-5, 0.006)).min(end);
            bench.step(time, next - time, &inputs_of_sample(number));
            time = next;
            assert_eq!((bench.variables.outputs, bench.variables.locals), *expected, "sample {number}");
        }
    }
}

#[test]
fn longer_steps_change_only_how_often_inputs_are_sampled() {
    let held = |number: u32| inputs_of_sample(number / 5 * 5);
    let mut fine = Bench::new(&held(0), |_| {});
    let mut coarse = Bench::new(&held(0), |_| {});
    for step in 0..160 {
        for number in 5 * step..5 * step + 5 {
            fine.sample(number, &held(number));
        }
        coarse.step(f64::from(step) * 5.0 * SAMPLE_TIME, 5.0 * SAMPLE_TIME, &held(5 * step));
        assert_eq!(coarse.variables, fine.variables);
    }
}

/// Steps of 17.5 ms, 7/5 of a sample: after i of them the samples k with 5 k < 7 i have been executed.
#[test]
fn steps_that_are_no_multiple_execute_the_samples_that_fall_in_them() {
    let mut bench = Bench::new(&Inputs::default(), |_| {});
    for step in 0..10_000_i32 {
        bench.step(f64::from(step) * 0.0175, 0.0175, &Inputs::default());
        assert_eq!(bench.variables.locals.sample_count, (7 * (step + 1) + 4) / 5);
    }
}

#[test]
fn a_step_without_a_sample_changes_nothing() {
    let mut bench = Bench::new(&inputs_of_sample(0), |_| {});
    bench.step(0.0, 0.005, &inputs_of_sample(0));
    let after = Variables { inputs: inputs_of_sample(99), ..bench.variables.clone() };
    assert_eq!(after.locals.sample_count, 1);
    bench.step(0.005, 0.0075, &inputs_of_sample(99));
    assert_eq!(bench.variables, after);
    // A sample 0.1 ms before the step's end is executed in it.
    bench.step(0.0125, 0.0126, &inputs_of_sample(1));
    assert_eq!(bench.variables.locals.sample_count, 3);
}

/// 1e5 s at 80 Hz: each step executes one sample, however the master computes its communication points.
#[test]
fn the_clock_keeps_in_step_for_a_hundred_thousand_seconds() {
    let passing_on = |parameters: &mut Parameters| parameters.mode = ControlMode::OpenLoop;
    for start_time in [0.0, -20.0, 1e6] {
        let inputs = Inputs::default();
        let mut multiplied = Bench::starting_at(start_time, &inputs, passing_on);
        let mut summed = Bench::starting_at(start_time, &inputs, passing_on);
        let mut time = start_time;
        let steps = if start_time == 0.0 { 8_000_000 } else { 1_000_000 };
        for number in 0..steps {
            multiplied.step(start_time + f64::from(number) * SAMPLE_TIME, SAMPLE_TIME, &inputs);
            summed.step(time, SAMPLE_TIME, &inputs);
            time += SAMPLE_TIME;
            let expected = number + 1;
            assert_eq!(multiplied.variables.locals.sample_count, expected, "from {start_time} s");
            assert_eq!(summed.variables.locals.sample_count, expected, "from {start_time} s, summed");
        }
    }
}

/// The same with steps of a third of a sample: the samples fall on every third communication point.
#[test]
fn short_steps_keep_in_step() {
    let passing_on = |parameters: &mut Parameters| parameters.mode = ControlMode::OpenLoop;
    let inputs = Inputs::default();
    let mut summed = Bench::new(&inputs, passing_on);
    let size = SAMPLE_TIME / 3.0;
    let mut time = 0.0;
    for step in 0..2_000_000 {
        summed.step(time, size, &inputs);
        time += size;
        assert_eq!(summed.variables.locals.sample_count, step / 3 + 1);
    }
}

#[test]
fn the_first_sample_is_at_the_start_time() {
    let inputs = Inputs { pwm_reference: 30.0, ..Inputs::default() };
    let mut bench = Bench::starting_at(3.0, &inputs, |parameters| parameters.mode = ControlMode::OpenLoop);
    assert_eq!(bench.variables.locals.sample_count, 0);
    let outputs = bench.step(3.0, 1e-4, &Inputs { pwm_reference: 60.0, ..inputs });
    assert_eq!((outputs.hp_wastegate_pwm, bench.variables.locals.sample_count), (60.0, 1));
    let outputs = bench.step(3.0 + 1e-4, 0.0124, &Inputs { pwm_reference: 70.0, ..inputs });
    assert_eq!((outputs.hp_wastegate_pwm, bench.variables.locals.sample_count), (60.0, 1));
}

#[test]
fn other_sample_times() {
    for (sample_time, expected) in [(1e-3, 1000), (0.01, 100), (1.0 / 3.0, 3), (1.0, 1)] {
        let mut bench =
            Bench::by_speed(&Inputs::default(), |parameters| parameters.sample_time = sample_time);
        bench.step(0.0, 1.0, &Inputs::default());
        assert_eq!(bench.variables.locals.sample_count, expected, "every {sample_time} s");
    }
}

/// Through the C interface, with derivatives of inputs: each sample of a long step uses the inputs of its time.
#[test]
fn a_long_step_interpolates_the_inputs_to_each_sample() {
    let reference = |name: &str| {
        Variables::described().find(|(_, variable)| variable.name() == name).expect("a variable").0
    };
    let pwm_reference = reference("pwm_reference");
    let duty = reference("hp_wastegate_pwm");
    let count = reference("sample_count");
    let callbacks = c_types::CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: ptr::null_mut(),
    };
    let guid = std::ffi::CString::new(Variables::DESCRIPTION.guid).expect("no NUL");
    let mut value = 0.0;
    let mut samples = 0;
    // SAFETY: a component from instantiate, used here alone, with pointers to single elements that live on.
    unsafe {
        let component = c_api::fmi2Instantiate::<BoostController>(
            c"controller".as_ptr(),
            c_types::CO_SIMULATION,
            guid.as_ptr(),
            ptr::null(),
            &raw const callbacks,
            0,
            0,
        );
        assert!(!component.is_null());
        let mode = reference("mode");
        let (open_loop, twenty, rising, first) = (ControlMode::OpenLoop as i32, 20.0, 100.0, 1);
        let ok = |status: c_types::Status| assert_eq!(status, c_types::Status::Ok);
        ok(c_api::fmi2SetInteger::<BoostController>(component, &raw const mode, 1, &raw const open_loop));
        ok(c_api::fmi2SetupExperiment::<BoostController>(component, 0, 0.0, 0.0, 0, 0.0));
        ok(c_api::fmi2EnterInitializationMode::<BoostController>(component));
        ok(c_api::fmi2ExitInitializationMode::<BoostController>(component));
        ok(c_api::fmi2SetReal::<BoostController>(component, &raw const pwm_reference, 1, &raw const twenty));
        ok(c_api::fmi2SetRealInputDerivatives::<BoostController>(
            component,
            &raw const pwm_reference,
            1,
            &raw const first,
            &raw const rising,
        ));
        ok(c_api::fmi2DoStep::<BoostController>(component, 0.0, 0.05, 1));
        ok(c_api::fmi2GetReal::<BoostController>(component, &raw const duty, 1, &raw mut value));
        ok(c_api::fmi2GetInteger::<BoostController>(component, &raw const count, 1, &raw mut samples));
        c_api::fmi2FreeInstance::<BoostController>(component);
    }
    // Samples at 0, 12.5, 25 and 37.5 ms; the last took 20 % + 100 %/s · 37.5 ms, to rounding.
    assert_eq!(samples, 4);
    assert!((value - 23.75).abs() < 1e-12, "{value}");
}
