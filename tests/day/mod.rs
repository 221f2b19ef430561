//! The strategy `split_range` off the standard day: what each optional measurement of the controller buys.

use boost_fmu::controller::variables as controller;
use boost_fmu::plant::variables as plant;

use crate::{Loop, Order, follow};

/// The optional measurements that a loop connects.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Measured {
    ambient: bool,
    shaft: bool,
}

fn on_a_day(
    pressure: f64,
    temperature: f64,
    boost_reference: f64,
    engine_speed: f64,
    measured: Measured,
) -> Loop {
    let surroundings = plant::Inputs {
        ambient_pressure: pressure,
        ambient_temperature: temperature,
        engine_speed,
        ..plant::Inputs::default()
    };
    let mut demand = controller::Inputs { boost_reference, engine_speed, ..controller::Inputs::default() };
    if measured.ambient {
        (demand.ambient_pressure, demand.ambient_temperature) = (pressure, temperature);
    }
    let mut control = Loop::settled_in(surroundings, demand, Order::ControllerFirst, |_, _| {});
    control.measures_shaft = measured.shaft;
    control
}

const NOTHING: Measured = Measured { ambient: false, shaft: false };
const AMBIENT: Measured = Measured { ambient: true, shaft: false };
const ALL: Measured = Measured { ambient: true, shaft: true };

/// From any start to rest (s).
const SETTLING: f64 = 10.0;

/// What the steps of Fig. 13 between 120 and 170 kPa lead to.
#[derive(Debug)]
struct Result {
    /// Beyond the new reference, in steps between references that the loop holds at rest (kPa).
    overshoot: f64,
    /// The largest speed of the high-pressure shaft on the way and at rest (krpm).
    fastest: f64,
    fastest_at_rest: f64,
}

fn steps(pressure: f64, temperature: f64, engine_speed: f64, measured: Measured) -> Result {
    let mut control = on_a_day(pressure, temperature, 125e3, engine_speed, measured);
    control.run(SETTLING, |_| {});
    let references = [125.0, 135.0, 150.0, 170.0, 150.0, 130.0, 120.0, 140.0, 125.0];
    let steps: Vec<_> = references.iter().zip(1..).map(|(&r, k)| (SETTLING * f64::from(k), r)).collect();
    let (mut fastest, mut fastest_at_rest): (f64, f64) = (0.0, 0.0);
    let answers = follow(&mut control, &steps, 100.0, |control| {
        let speed = control.plant.variables.outputs.hp_turbo_speed;
        fastest = fastest.max(speed);
        if control.time() % SETTLING > SETTLING - 0.1 {
            fastest_at_rest = fastest_at_rest.max(speed);
        }
    });
    let held = answers.windows(2).filter(|pair| pair.iter().all(|answer| answer.end_error < 50.0));
    let overshoot = held.map(|pair| pair[1].overshoot).fold(0.0, f64::max);
    let [overshoot, fastest, fastest_at_rest] =
        [overshoot, fastest, fastest_at_rest].map(|value| 1e-3 * value);
    println!(
        "{pressure} Pa, {temperature} K, {engine_speed} rpm, {measured:?}: overshoot {overshoot:.2} kPa, \
         shaft {fastest:.0} krpm, {fastest_at_rest:.0} krpm at rest"
    );
    Result { overshoot, fastest, fastest_at_rest }
}

const SPEEDS: [f64; 6] = [1500.0, 2000.0, 2500.0, 3500.0, 4500.0, 5500.0];

/// At most 1 kPa of overshoot at 298 K, where the plant holds both references; without the measurement 3 to 11 kPa.
#[test]
fn steps_of_the_reference_at_altitude() {
    for pressure in [101_325.0, 90e3, 80e3, 70e3] {
        for engine_speed in SPEEDS {
            let with = steps(pressure, 298.0, engine_speed, AMBIENT);
            assert!(with.overshoot <= 1.0, "{with:?}");
        }
    }
    let without = [90e3, 80e3, 70e3].map(|pressure| steps(pressure, 298.0, 2000.0, NOTHING).overshoot);
    assert!(without.iter().all(|overshoot| *overshoot > 3.0), "{without:?}");
}

/// The same from -20 to +40 degC. Beyond 1 kPa only at 1500 rpm: on the schedule's day that is 1400 and 1800 rpm,
/// between its columns, with 1.8 kPa on that day, too.
#[test]
fn steps_of_the_reference_in_cold_and_heat() {
    for temperature in [253.0, 273.0, 313.0] {
        for engine_speed in SPEEDS {
            let with = steps(101_325.0, temperature, engine_speed, AMBIENT);
            let bound = if engine_speed < 2000.0 { 2.8 } else { 1.0 };
            assert!(with.overshoot <= bound, "{with:?}");
        }
    }
}

/// How far boost is from the reference where the loop starts, with the feedforward alone (kPa).
fn first_error(pressure: f64, temperature: f64, engine_speed: f64, measured: Measured) -> f64 {
    let boost = 1.43 * pressure;
    1e-3 * (on_a_day(pressure, temperature, boost, engine_speed, measured).boost_pressure() - boost).abs()
}

/// The schedule's feedforward at a ratio of pressures of 1.43. The bounds are the largest errors that were measured,
/// and 10 %: of the derivation, which neglects that less flow makes less hot exhaust.
#[test]
fn the_feedforward_holds_on_other_days() {
    for (pressure, temperature, with, without) in [
        (90e3, 298.0, 3.2, 80.0),
        (80e3, 298.0, 4.8, 50.0),
        (70e3, 298.0, 6.4, 35.0),
        (101_325.0, 253.0, 17.5, 75.0),
        (101_325.0, 313.0, 4.2, 9.0),
    ] {
        let worst = |measured| {
            SPEEDS
                .map(|speed| first_error(pressure, temperature, speed, measured))
                .into_iter()
                .fold(0.0, f64::max)
        };
        let (found, before) = (worst(AMBIENT), worst(NOTHING));
        println!("{pressure} Pa, {temperature} K: {found:.2} kPa, {before:.2} kPa without the measurements");
        assert!(found <= 1.1 * with, "{found} kPa at {pressure} Pa, {temperature} K");
        assert!(before >= without, "{before} kPa at {pressure} Pa, {temperature} K");
    }
}

/// Steps up to the limit of the reference: without the measurement the shaft reaches 310 krpm.
#[test]
fn the_shaft_keeps_its_limit_while_boost_rises() {
    for (engine_speed, from, to) in
        [(3500.0, 180e3, 230e3), (4000.0, 150e3, 215e3), (5000.0, 170e3, 185e3), (5500.0, 130e3, 174e3)]
    {
        let fastest = [NOTHING, Measured { shaft: true, ..NOTHING }].map(|measured| {
            let mut control = on_a_day(101_325.0, 298.0, from, engine_speed, measured);
            control.run(SETTLING, |_| {});
            control.demand.boost_reference = to;
            let mut fastest: f64 = 0.0;
            control.run(25.0, |control| {
                fastest = fastest.max(1e-3 * control.plant.variables.outputs.hp_turbo_speed);
            });
            assert!((control.boost_pressure() - to).abs() < 50.0, "{engine_speed} rpm");
            fastest
        });
        println!(
            "{engine_speed} rpm, {from} to {to} Pa: {fastest:.1?} krpm without and with the measurement"
        );
        assert!(fastest[1] <= 214.0 && fastest[1] < fastest[0], "{fastest:?}");
    }
}

/// The shaft at rest on any day: at most 210 krpm, where less boost would slow it down. In the cold at 5500 rpm it would
/// not: the engine alone swallows so much that the shaft runs at 219 krpm at any boost pressure.
#[test]
fn the_shaft_keeps_its_limit_at_rest_on_other_days() {
    for (pressure, temperature) in
        [(90e3, 298.0), (80e3, 298.0), (70e3, 298.0), (101_325.0, 313.0), (80e3, 253.0)]
    {
        for engine_speed in [3500.0, 4500.0, 5500.0] {
            let found = steps(pressure, temperature, engine_speed, ALL);
            let bound = if temperature < 273.0 && engine_speed > 5000.0 { 220.0 } else { 210.0 };
            assert!(found.fastest_at_rest <= bound, "{found:?}");
            assert!(found.fastest <= bound + 10.0, "{found:?}");
        }
    }
}

/// The throttle shuts to 2 % in one step: the compressors' least flow (kg/s) within 10 s.
fn least_flow(boost: f64, engine_speed: f64, has_valve: bool) -> f64 {
    let mut control = on_a_day(101_325.0, 298.0, boost, engine_speed, NOTHING);
    if !has_valve {
        control.controller.variables.parameters.surge_protection.rate = 1e9;
    }
    control.run(SETTLING, |_| {});
    control.surroundings.throttle = 0.02;
    let mut least = f64::INFINITY;
    control.run(20.0, |control| {
        let locals = &control.plant.variables.locals;
        least = least.min(locals.hp_compressor.mass_flow).min(locals.lp_compressor.mass_flow);
    });
    least
}

/// No compressor's flow reverses, which it does at 3500 rpm without the valve.
#[test]
fn the_surge_valve_opens_where_the_throttle_shuts() {
    for (boost, engine_speed) in [(180e3, 1500.0), (200e3, 2500.0), (200e3, 3500.0), (180e3, 5000.0)] {
        let [without, with] = [false, true].map(|has_valve| least_flow(boost, engine_speed, has_valve));
        println!("{engine_speed} rpm: {without:.4} kg/s without the surge valve, {with:.4} kg/s with it");
        assert!(with > 0.0, "{with} kg/s at {engine_speed} rpm");
    }
    assert!(least_flow(200e3, 3500.0, false) < 0.0);
}

/// The start values mean that nothing is measured; the schedule's own day changes nothing, either.
#[test]
fn the_standard_day_changes_no_bit() {
    let run = |measured: Measured| {
        let mut control = on_a_day(101_325.0, 298.0, 125e3, 3000.0, measured);
        let mut seen = vec![];
        follow(&mut control, &[(0.0, 125.0), (2.0, 150.0), (5.0, 120.0)], 8.0, |control| {
            seen.push(control.controller.variables.outputs);
        });
        seen
    };
    assert!(run(AMBIENT) == run(NOTHING));
}
