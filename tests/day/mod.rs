//! The strategy `split_range` off reference conditions: the benefit of each optional measurement of the controller.

use boost_fmu::controller::variables as controller;
use boost_fmu::plant::variables as plant;

use crate::boost_steps::{BOOST_STEPS, pairs};
use crate::random::Random;
use crate::{Answer, END_OF_FIGURE_13, Loop, Order, STEP, follow};

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

/// Time from any start to rest (s).
const SETTLING: f64 = 10.0;

/// Results of the steps of Fig. 13 between 120 and 170 kPa.
#[derive(Debug)]
struct Result {
    /// Overshoot in steps between references that the loop holds at rest (kPa).
    overshoot: f64,
    /// The same from a reference that it cannot hold to one that it can (kPa).
    overshoot_from_out_of_reach: f64,
    /// The maximum high-pressure shaft speed in transients and at rest (krpm).
    fastest: f64,
    fastest_at_rest: f64,
}

fn steps(pressure: f64, temperature: f64, engine_speed: f64, measured: Measured) -> Result {
    let mut control = on_a_day(pressure, temperature, 125e3, engine_speed, measured);
    if measured == NOTHING {
        // At 80 kPa and below, a controller unaware of the thin air takes an unreachable reference for a fault.
        control.controller.variables.parameters.diagnosis.answer_error = 1e6;
    }
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
    let overshoot = |from_within_reach: bool| {
        let [before, after] = [0, 1].map(|k| move |pair: &[Answer]| pair[k].end_error < 50.0);
        let steps = answers.windows(2).filter(|pair| before(pair) == from_within_reach && after(pair));
        1e-3 * steps.map(|pair| pair[1].overshoot).fold(0.0, f64::max)
    };
    Result {
        overshoot: overshoot(true),
        overshoot_from_out_of_reach: overshoot(false),
        fastest: 1e-3 * fastest,
        fastest_at_rest: 1e-3 * fastest_at_rest,
    }
}

const SPEEDS: [f64; 6] = [1500.0, 2000.0, 2500.0, 3500.0, 4500.0, 5500.0];

/// Reference steps at an ambient pressure, from -20 to +40 degC, without and with the measurements: at most 1 kPa of
/// overshoot if the plant holds both references, and 2 kPa, the bound of the study of random plants and ambient
/// conditions, from a reference that it cannot hold.
///
/// With its speed measured, the shaft turns at 210 krpm at most at rest, or 211 with all valves at their limits and the
/// references unreachable.
fn steps_at(pressure: f64, at_all_limits: &[(f64, f64)]) {
    for temperature in [253.0, 298.0, 313.0] {
        for engine_speed in SPEEDS {
            let [without, ambient, all] =
                [NOTHING, AMBIENT, ALL].map(|measured| steps(pressure, temperature, engine_speed, measured));
            let of_all = |value: fn(&Result) -> f64| [&without, &ambient, &all].map(value);
            println!(
                "{pressure} Pa, {temperature} K, {engine_speed} rpm, nothing, ambient, and shaft measured: overshoot \
                 {:.2?} kPa, from out of reach {:.2?} kPa, shaft {:.0?} krpm on the way, {:.0?} krpm at rest",
                of_all(|found| found.overshoot),
                of_all(|found| found.overshoot_from_out_of_reach),
                of_all(|found| found.fastest),
                of_all(|found| found.fastest_at_rest)
            );
            assert!(ambient.overshoot <= 1.0 && all.overshoot <= 1.0, "{ambient:?} {all:?}");
            for found in [&ambient, &all] {
                assert!(found.overshoot_from_out_of_reach <= 2.0, "{found:?}");
            }
            let bound = if at_all_limits.contains(&(temperature, engine_speed)) { 211.0 } else { 210.0 };
            assert!(all.fastest_at_rest <= bound, "{all:?}");
        }
    }
}

#[test]
fn steps_of_the_reference_at_sea_level() {
    steps_at(101_325.0, &[]);
}

#[test]
fn steps_of_the_reference_at_1000_m() {
    steps_at(90e3, &[]);
}

#[test]
fn steps_of_the_reference_at_2000_m() {
    steps_at(80e3, &[]);
}

#[test]
fn steps_of_the_reference_at_3000_m() {
    steps_at(70e3, &[(253.0, 5500.0)]);
}

/// Down from an unreachable reference: boost stays where it is until the reference falls below it.
#[test]
fn an_unreachable_reference_leaves_no_dip() {
    for engine_speed in [1500.0, 5500.0] {
        let mut control = on_a_day(70e3, 298.0, 170e3, engine_speed, AMBIENT);
        control.run(2.0 * SETTLING, |_| {});
        let (before, mut least) = (control.boost_pressure(), f64::INFINITY);
        control.demand.boost_reference = 150e3;
        control.run(3.0 * SETTLING, |control| least = least.min(control.boost_pressure()));
        println!("{engine_speed} rpm: {before:.0} Pa before, {least:.0} Pa at least");
        assert!(before < 150e3 && least > before - 500.0, "{least} Pa after {before} Pa");
    }
}

/// Engine speed ramps near reference conditions and at altitude: the largest boost deviation (kPa), within the bound of the
/// study of random plants and ambient conditions.
#[test]
fn ramps_at_altitude() {
    let ramps = |ambient_pressure, measured| {
        let mut worst: f64 = 0.0;
        for boost_reference in [120e3, 130e3, 145e3] {
            let mut control = on_a_day(ambient_pressure, 298.0, boost_reference, 2500.0, measured);
            control.run(SETTLING, |_| {});
            for (target, end) in [(4500.0, 20.0), (2500.0, 30.0)] {
                while control.time() < end {
                    let speed = &mut control.surroundings.engine_speed;
                    *speed += (target - *speed).clamp(-2000.0 * STEP, 2000.0 * STEP);
                    control.demand.engine_speed = *speed;
                    control.step();
                    worst = worst.max((control.boost_pressure() - boost_reference).abs());
                }
            }
        }
        1e-3 * worst
    };
    let near = ramps(99.9e3, AMBIENT);
    let [without, with] = [NOTHING, AMBIENT].map(|measured| ramps(90e3, measured));
    println!(
        "ramps of 2000 rpm/s at 90 kPa: {without:.2} kPa, {with:.2} kPa with the ambient measured, and {near:.2} kPa at \
         99.9 kPa"
    );
    assert!(near <= 2.0 && with <= 2.0 && with < without, "{near}, {with}, {without} kPa");
}

/// The ambient changes faster than on any road, up and down by 60 K at once and by 20 kPa within seconds: the reference
/// is constant, although it moves at reference conditions. `Loop` rejects any alarm.
#[test]
fn a_change_of_the_ambient_is_no_fault() {
    for (boost_reference, engine_speed) in [(150e3, 1500.0), (170e3, 1500.0), (170e3, 4500.0)] {
        for (from, to) in [(253.0, 313.0), (268.0, 328.0), (313.0, 253.0)] {
            for duration in [5.0, 20.0] {
                let mut control = on_a_day(80e3, from, boost_reference, engine_speed, ALL);
                control.run(SETTLING, |_| {});
                while control.time() < 40.0 {
                    let share = ((control.time() - SETTLING) / duration).clamp(0.0, 1.0);
                    let pressure = 80e3 + share * 21e3;
                    let (ambient, demand) = (&mut control.surroundings, &mut control.demand);
                    (ambient.ambient_pressure, ambient.ambient_temperature) = (pressure, to);
                    (demand.ambient_pressure, demand.ambient_temperature) = (pressure, to);
                    control.step();
                }
            }
        }
    }
}

/// A step from a just reachable reference to an unreachable one, in thin and hot air, is no fault.
#[test]
fn the_end_of_the_reach_is_no_fault() {
    let mut control = on_a_day(70e3, 313.0, 119.9e3, 1500.0, ALL);
    control.run(SETTLING, |_| {});
    control.demand.boost_reference = 140e3;
    control.run(2.0 * SETTLING, |_| {});
}

/// The boost error at the start of the loop, with the feedforward alone (kPa).
fn first_error(pressure: f64, temperature: f64, engine_speed: f64, measured: Measured) -> f64 {
    let boost = 1.43 * pressure;
    1e-3 * (on_a_day(pressure, temperature, boost, engine_speed, measured).boost_pressure() - boost).abs()
}

/// The schedule's feedforward at a pressure ratio of 1.43. The bounds are the largest measured errors plus 10 %, due to
/// the derivation, which neglects that exhaust is cooler at lower flow.
#[test]
fn the_feedforward_holds_off_reference_conditions() {
    for (pressure, temperature, with, without) in [
        (90e3, 298.0, 1.5, 80.0),
        (80e3, 298.0, 2.0, 50.0),
        (70e3, 298.0, 2.3, 35.0),
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

/// Steps up to the reference limit: without the measurement the shaft reaches 310 krpm.
#[test]
fn the_shaft_keeps_its_limit_while_boost_rises() {
    let mut saved: f64 = 0.0;
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
        saved = saved.max(fastest[0] - fastest[1]);
        println!(
            "{engine_speed} rpm, {from} to {to} Pa: {fastest:.1?} krpm without and with the measurement"
        );
        assert!(fastest[1] <= 214.0 && fastest[1] <= fastest[0], "{fastest:?}");
    }
    assert!(saved > 40.0, "{saved} krpm: the measurement changes little here");
}

/// The shaft speed at rest at an unreachable reference (krpm).
fn speed_at_limit(pressure: f64, temperature: f64, engine_speed: f64, measured: Measured) -> f64 {
    let mut control = on_a_day(pressure, temperature, 150e3, engine_speed, measured);
    control.run(SETTLING, |_| {});
    control.demand.boost_reference = 220e3;
    control.run(4.0 * SETTLING, |_| {});
    1e-3 * control.plant.variables.outputs.hp_turbo_speed
}

/// If the schedule's limit is too low for the ambient conditions, the shaft reaches 206.5 krpm and no more. The 0.5
/// krpm are less than 1 kPa.
#[test]
fn the_limit_is_that_of_the_shaft() {
    let mut farthest: f64 = 0.0;
    for (pressure, temperature, engine_speed) in [(95.6e3, 257.0, 4551.0), (70.2e3, 275.0, 3600.0)] {
        let [without, with] =
            [AMBIENT, ALL].map(|measured| speed_at_limit(pressure, temperature, engine_speed, measured));
        println!(
            "{pressure} Pa, {temperature} K, {engine_speed} rpm: {without:.1} krpm without the speed, {with:.1} with it"
        );
        farthest = farthest.max((without - 206.5).abs());
        assert!((with - 206.5).abs() <= 0.5, "{with} krpm at {engine_speed} rpm and {pressure} Pa");
    }
    assert!(farthest > 10.0, "{farthest} krpm: the measurement changes nothing here");
}

/// The throttle shuts to 2 % in one step: the compressors' minimum flow (kg/s) within 10 s.
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

/// The start values mean no measurements; measured reference conditions change nothing either.
#[test]
fn reference_conditions_change_no_bit() {
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

/// Boost pressure (Pa) over Fig. 13 and over the laboratory's engine speed ramps at reference conditions, where the
/// ambient sensors measure a pressure (Pa) and a temperature (K), or 0 if they are not connected.
fn boost_over_steps_and_ramps(ambient: (f64, f64)) -> [Vec<f64>; 2] {
    let start = |boost_reference, engine_speed| {
        let mut control = on_a_day(101_325.0, 298.0, boost_reference, engine_speed, NOTHING);
        (control.demand.ambient_pressure, control.demand.ambient_temperature) = ambient;
        control
    };
    let mut boost = [vec![], vec![]];
    let steps: Vec<_> = BOOST_STEPS.iter().map(|&(time, pressure)| (time, 1e-3 * pressure)).collect();
    follow(&mut start(125e3, 1500.0), &steps, END_OF_FIGURE_13, |control| {
        boost[0].push(control.boost_pressure());
    });
    let mut control = start(145e3, 2500.0);
    let scenario = include_str!("../../boost/lab/scenarios/ramps.toml");
    let ramps = pairs(scenario, |inputs| &inputs["engine_speed"]["points"]);
    for ((begin, from), (end, to)) in ramps.iter().copied().zip(ramps[1..].iter().copied()) {
        while control.time() < end {
            let share = (control.time() - begin) / (end - begin);
            let speed = from + share * (to - from);
            (control.surroundings.engine_speed, control.demand.engine_speed) = (speed, speed);
            control.step();
            boost[1].push(control.boost_pressure());
        }
    }
    boost
}

/// Sensors never measure exactly the reference conditions: deviations below their resolution must not matter.
#[test]
fn the_law_is_continuous_at_reference_conditions() {
    let at_reference = boost_over_steps_and_ramps((0.0, 0.0));
    for ambient in [(101_325.1, 298.001), (101_324.9, 297.999)] {
        let beside = boost_over_steps_and_ramps(ambient);
        let largest = [0, 1].map(|experiment| {
            let pairs = at_reference[experiment].iter().zip(&beside[experiment]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        });
        println!("{ambient:?}: {largest:.3?} Pa in Fig. 13 and along ramps");
        assert!(largest.iter().all(|&pressure| pressure < 1.0), "{largest:?} Pa at {ambient:?}");
    }
}

/// At 75 kPa the duty that opens the wastegate at reference conditions, 75 %, leaves it half shut: by paper, eq. (7),
/// the chamber is at 49 kPa, and the difference to ambient is 26 kPa instead of 52 kPa.
#[test]
fn the_limp_home_opens_the_wastegate_at_altitude() {
    for (ambient_pressure, expected) in [(101_325.0, 75.0), (75e3, 100.0)] {
        let mut control = on_a_day(ambient_pressure, 298.0, 150e3, 1500.0, AMBIENT);
        control.run(SETTLING, |_| {});
        let position = control.plant.variables.outputs.hp_wastegate_position;
        let fault = &mut control.plant.variables.parameters.fault;
        (fault.wastegate_stuck, fault.wastegate_stuck_position) = (true, position);
        control.demand.boost_reference = 115e3;
        // A measurement that is constant to the last bit would look like a stuck sensor.
        control.noise = Some(Random(1));
        control.noise_deviation = 10.0;
        control.run(SETTLING + 5.0, |_| {});
        let controller::Outputs { fault_code, hp_wastegate_pwm, .. } = control.controller.variables.outputs;
        assert_eq!((fault_code, hp_wastegate_pwm), (2.0, expected), "{ambient_pressure} Pa");
    }
}
