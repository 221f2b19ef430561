//! The start of an experiment, in its modes and at extreme inputs.

use boost_fmu::plant::variables::{InitializationMode, Inputs, Parameters, States};

use crate::bench::Bench;
use crate::random::Random;

/// Inputs at their bounds and between.
fn unusual_inputs() -> Vec<(&'static str, Inputs)> {
    let usual = Inputs::default();
    vec![
        ("engine at rest", Inputs { engine_speed: 0.0, ..usual }),
        ("throttle shut", Inputs { throttle: 0.0, ..usual }),
        ("engine at rest, throttle shut", Inputs { engine_speed: 0.0, throttle: 0.0, ..usual }),
        ("idle", Inputs { engine_speed: 700.0, throttle: 0.02, ..usual }),
        ("everything open", Inputs { lp_wastegate: 1.0, hp_bypass: 1.0, surge_valve: 1.0, ..usual }),
        ("overspeed", Inputs { engine_speed: 8000.0, ..usual }),
        ("overspeed, wastegate open", Inputs { engine_speed: 8000.0, hp_wastegate_pwm: 100.0, ..usual }),
        ("no supply", Inputs { supply_voltage: 0.0, ..usual }),
        ("high supply, pump on", Inputs { supply_voltage: 32.0, vacuum_pump: 1.0, ..usual }),
        ("mountain, cold", Inputs { ambient_pressure: 5e4, ambient_temperature: 230.0, ..usual }),
        ("mine, hot", Inputs { ambient_pressure: 1.1e5, ambient_temperature: 330.0, ..usual }),
    ]
}

#[test]
fn every_start_is_finite_and_the_next_20_s_are() {
    for (name, inputs) in unusual_inputs() {
        let mut bench = Bench::new(inputs, |_, _| {});
        assert!(bench.is_finite(), "{name}: at the start");
        assert!(bench.restlessness() < 1.0, "{name}: {} 1/s", bench.restlessness());
        bench.run(20.0);
        assert!(bench.is_finite(), "{name}: after 20 s");
    }
}

#[test]
fn a_missing_steady_state_is_reported() {
    let inputs = Inputs { engine_speed: 0.0, throttle: 0.0, ..Inputs::default() };
    let bench = Bench::new(inputs, |_, _| {});
    assert_eq!(bench.messages.len(), 1, "{:?}", bench.messages);
    let warning = &bench.messages[0].1;
    assert!(warning.contains("engine_speed = 0 rpm") && warning.contains("throttle = 0 "), "{warning}");
}

#[test]
fn a_valve_that_asks_for_less_than_a_vacuum_is_reported_once() {
    let with = |coefficients: [f64; 4]| {
        let inputs = Inputs { hp_wastegate_pwm: 100.0, ..Inputs::default() };
        let mut bench =
            Bench::new(inputs, |parameters, _| parameters.valve.pressure_coefficient = coefficients);
        bench.run(1.0);
        bench.messages.iter().map(|(_, text)| text.clone()).collect::<Vec<_>>()
    };
    let message = |pressure, duty| {
        format!(
            "at 0 s: valve.pressure is {pressure} Pa at a plunger duty of {duty} %: with these \
             valve.pressure_coefficient, the valve asks for less than a vacuum"
        )
    };
    let [k1, k2, k3, k4] = Parameters::default().valve.pressure_coefficient;
    assert_eq!(with([k1, 2.0 * k2, k3, k4]), [message("-40519", 100)]);
    // At 100 %, k2 takes 65,767 Pa, which leaves 25,248 Pa: 0.3839 of it.
    assert_eq!(with([k1, 1.3839 * k2, k3, k4]), [] as [String; 0]);
    assert_eq!(with([k1, 1.384 * k2, k3, k4]), [message("-6.528", 100)]);
    // 0 Pa at 100 %, and lowest where 0.9·u² = 80·u.
    assert_eq!(with([0.3, -40.0, 0.0, 1e5]), [message("-5349.3", 89)]);
}

#[test]
fn random_starts_are_steady() {
    let mut random = Random(1);
    for _ in 0..300 {
        let inputs = Inputs {
            hp_wastegate_pwm: random.between(0.0, 100.0),
            vacuum_pump: random.between(0.0, 1.0).round(),
            lp_wastegate: random.between(0.0, 1.0),
            hp_bypass: random.between(-1.0, 1.0).max(0.0),
            surge_valve: random.between(-1.0, 1.0).max(0.0),
            throttle: random.between(0.0, 1.0),
            supply_voltage: random.between(6.0, 16.0),
            engine_speed: random.between(600.0, 8000.0),
            ambient_pressure: random.between(5e4, 1.1e5),
            ambient_temperature: random.between(230.0, 330.0),
        };
        let exhaust_area = random.between(0.0, 2e-4);
        let bench = Bench::new(inputs, |parameters, start| {
            parameters.tank.frozen = true;
            parameters.actuator.exhaust_area = exhaust_area;
            start.tank.pressure = random.between(2e4, 5e4);
        });
        assert!(bench.is_finite(), "{inputs:?}");
        assert_eq!(bench.messages, []);
        // Rounding at the stop, as in the table of steady states.
        let restlessness = bench.restlessness();
        assert!(restlessness < 1e-10, "{inputs:?}: {restlessness:e} 1/s");
    }
}

#[test]
fn a_running_start_follows_ambient_and_the_tank() {
    let inputs =
        Inputs { ambient_pressure: 9e4, supply_voltage: 13.0, vacuum_pump: 1.0, ..Inputs::default() };
    let bench = Bench::new(inputs, |parameters, start| {
        parameters.initialization.mode = InitializationMode::Running;
        parameters.pump.voltage_drop = 0.4;
        start.tank.pressure = 31_000.0;
    });
    let states = &bench.variables.states;
    let near =
        |value: f64, expected: f64| assert!((value - expected).abs() < 1e-9, "{value} is not {expected}");
    near(states.tank.pressure, 31_000.0);
    near(states.actuator.chamber_pressure, 9e4);
    near(states.air_filter.pressure, 89_800.0);
    near(states.hp_compressor.outlet_pressure, 90_500.0);
    near(states.intake_manifold.pressure, 88_200.0);
    near(states.exhaust_manifold.pressure, 1e5);
    near(states.supply_sensor.voltage, 12.6);
    near(states.hp_shaft.speed, 6000.0);
    assert!(bench.messages.is_empty(), "{:?}", bench.messages);
}

#[test]
fn the_default_start_values_are_the_running_start() {
    let bench = Bench::running(Inputs::default(), false);
    for (i, (running, start)) in
        bench.variables.states.to_array().into_iter().zip(States::default().to_array()).enumerate()
    {
        // Only the factor 0.98 may round.
        assert!((running - start).abs() <= 1e-15 * start.abs(), "{}: {running}, {start}", States::NAMES[i]);
    }
}

#[test]
fn start_values_hold_in_mode_given_and_are_reported_otherwise() {
    let change = |start: &mut States| {
        start.hp_shaft.speed = 9000.0;
        start.actuator.position = 0.004;
        start.tank.pressure = 33_000.0;
    };
    let given = Bench::new(Inputs::default(), |parameters, start| {
        parameters.initialization.mode = InitializationMode::Given;
        change(start);
    });
    assert!(given.variables.states == given.variables.start);
    assert!(given.messages.is_empty(), "{:?}", given.messages);

    let settled = Bench::new(Inputs::default(), |_, start| change(start));
    assert_eq!(settled.messages.len(), 1, "{:?}", settled.messages);
    let warning = &settled.messages[0].1;
    assert!(warning.contains("hp_shaft.speed") && warning.contains("actuator.position"), "{warning}");
    assert!(!warning.contains("tank.pressure"), "{warning}");
    assert!((settled.variables.states.tank.pressure - 33_000.0).abs() < 1e-9);
}

#[test]
fn a_running_pump_never_empties_the_tank_below_zero() {
    let mut bench = Bench::new(Inputs { vacuum_pump: 1.0, ..Inputs::default() }, |_, _| {});
    bench.run(120.0);
    let pressure = bench.variables.outputs.tank_pressure;
    assert!((0.0..1000.0).contains(&pressure), "{pressure} Pa");
}

#[test]
fn a_frozen_tank_keeps_its_pressure_and_a_released_one_fills() {
    let mut bench = Bench::new(Inputs::default(), |parameters, _| parameters.tank.frozen = true);
    let pressure = bench.variables.outputs.tank_pressure;
    bench.run(1.0);
    assert!((bench.variables.outputs.tank_pressure - pressure).abs() < f64::EPSILON);
    bench.variables.parameters.tank.frozen = false;
    bench.run(1.0);
    assert!(bench.variables.outputs.tank_pressure > pressure + 10.0);
}

#[test]
fn a_tank_frozen_during_the_run_keeps_its_pressure() {
    for exhaust_area in [0.0, 1e-4] {
        let mut bench = Bench::new(Inputs { vacuum_pump: 1.0, ..Inputs::default() }, |parameters, _| {
            parameters.actuator.exhaust_area = exhaust_area;
        });
        bench.variables.inputs.hp_wastegate_pwm = 80.0;
        bench.run(0.05);
        let pressure = bench.variables.outputs.tank_pressure;
        bench.variables.parameters.tank.frozen = true;
        bench.run(1.0);
        assert!((bench.variables.outputs.tank_pressure - pressure).abs() < f64::EPSILON);
    }
}
