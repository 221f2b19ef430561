//! The strategy `split_range` on the plant while engine speed changes, as in a drive cycle.
//!
//! The bounds, in kPa, are what the law has to hold; results are 10 to 50 % below.

use std::fs;
use std::path::Path;

use boost_fmu::controller::variables as controller;
use boost_fmu::plant::variables as plant;
use fmu_export::{Accessed as _, Described as _};
use fmu_package::{ParameterSet, Value};

use crate::random::Random;
use crate::{Loop, Order, STEP, follow, on_reference_day};

const PRESSURES: [f64; 5] = [120e3, 130e3, 145e3, 155e3, 165e3];

/// Ramps of engine speed (rpm/s).
const RATES: [f64; 5] = [100.0, 250.0, 500.0, 1000.0, 2000.0];

/// The largest deviations (kPa) on these ramps; the paper allows 5 kPa. At 120 and 130 kPa, where boost responds little to
/// the duty, what the pump sustains with noise costs 0.2 kPa.
const RAMPS: [f64; 5] = [0.4, 0.7, 1.0, 1.2, 1.6];

/// The same with the shaft's sensor: its limit takes more than the ramp.
const WITH_SHAFT_SENSOR: [f64; 5] = [0.4, 0.7, 1.0, 1.2, 2.1];

/// Time from any start to rest (s).
const SETTLING: f64 = 10.0;

/// What disturbs the loop.
#[derive(Clone, Copy)]
enum Disturbance {
    None,
    /// The shaft's limit: the controller measures its speed and ambient conditions.
    ShaftLimit,
    /// Of the measured boost pressure.
    Noise,
    /// Supply voltage steps as in Fig. 14, every 5 s from the start of the ramp.
    Supply,
}

fn assert_within(what: &str, kilopascal: f64, most: f64) {
    println!("{what}: {kilopascal:.3} kPa, {most} kPa at most");
    assert!(kilopascal <= most, "{what}: {kilopascal} kPa, {most} kPa at most");
}

fn at(boost_reference: f64, engine_speed: f64, plant: &plant::Parameters) -> Loop {
    let demand = controller::Inputs { boost_reference, engine_speed, ..controller::Inputs::default() };
    let mut control = Loop::settled(demand, Order::ControllerFirst, |_, parameters| *parameters = *plant);
    control.run(SETTLING, |_| {});
    control
}

/// The largest deviation of boost (kPa) over a ramp to an engine speed at a rate (rpm/s), and 5 s after.
fn ramp(control: &mut Loop, to: f64, rate: f64, disturbance: Disturbance) -> f64 {
    let begin = control.time();
    let mut worst: f64 = 0.0;
    let mut left = 5.0;
    while left > 0.0 {
        let speed = &mut control.surroundings.engine_speed;
        if (to - *speed).abs() > 0.0 {
            *speed += (to - *speed).clamp(-rate * STEP, rate * STEP);
        } else {
            left -= STEP;
        }
        if let Disturbance::Supply = disturbance {
            control.surroundings.supply_voltage = supply(control.time() - begin);
        }
        control.step();
        worst = worst.max((control.boost_pressure() - control.demand.boost_reference).abs());
    }
    1e-3 * worst
}

/// The supply voltage of Fig. 14 at a time (s), 12 V from 35 s.
fn supply(time: f64) -> f64 {
    let steps = [12.0, 11.1, 11.9, 12.6, 11.5, 13.5, 11.1, 12.0];
    let ends = (1..).map(|step| 5.0 * f64::from(step) - 0.5 * STEP);
    steps.into_iter().zip(ends).find(|(_, end)| time < *end).map_or(12.0, |(voltage, _)| voltage)
}

/// The largest deviation (kPa) at all pressures between 2500 and 4500 rpm and back.
fn worst_between_2500_and_4500_rpm(rate: f64, disturbance: Disturbance, plant: &plant::Parameters) -> f64 {
    let mut worst: f64 = 0.0;
    for (seed, pressure) in (1..).zip(PRESSURES) {
        let mut control = if let Disturbance::ShaftLimit = disturbance {
            on_reference_day(2500.0, pressure)
        } else {
            at(pressure, 2500.0, plant)
        };
        if let Disturbance::Noise = disturbance {
            control.noise = Some(Random(seed));
        }
        control.run(SETTLING, |_| {});
        for to in [4500.0, 2500.0] {
            worst = worst.max(ramp(&mut control, to, rate, disturbance));
        }
    }
    worst
}

fn assert_ramps(what: &str, disturbance: Disturbance, most: [f64; 5]) {
    for (rate, most) in RATES.into_iter().zip(most) {
        let worst = worst_between_2500_and_4500_rpm(rate, disturbance, &plant::Parameters::default());
        assert_within(&format!("{what} at {rate} rpm/s"), worst, most);
    }
}

#[test]
fn ramps_of_engine_speed() {
    assert_ramps("ramps", Disturbance::None, RAMPS);
}

/// At 165 kPa the fastest ramps bring the shaft to its limit, which takes boost.
#[test]
fn ramps_of_engine_speed_with_the_shafts_sensor() {
    assert_ramps("ramps with the shaft's sensor", Disturbance::ShaftLimit, WITH_SHAFT_SENSOR);
}

#[test]
fn ramps_of_engine_speed_with_measurement_noise() {
    assert_ramps("ramps with noise", Disturbance::Noise, RAMPS);
}

#[test]
fn ramps_of_engine_speed_with_steps_of_the_supply() {
    // On slow ramps the supply deviates most, as in Fig. 14.
    assert_ramps("ramps with a varying supply", Disturbance::Supply, [0.6, 0.8, 1.0, 1.2, 1.6]);
}

/// The plants of `parameters/`, with the maps of the default one.
#[test]
fn ramps_of_engine_speed_on_other_plants() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("parameters");
    let mut plants = vec![];
    for file in fs::read_dir(folder).unwrap() {
        let set = ParameterSet::read(&file.unwrap().path()).unwrap();
        let mut variables = plant::Variables::default();
        for parameter in &set.parameters {
            let known = plant::Variables::described().find(|(_, variable)| variable.name() == parameter.name);
            if let (Some((reference, _)), &Value::Real(value, _)) = (known, &parameter.value) {
                variables.set_real(reference, value);
            }
        }
        if variables.parameters != plant::Parameters::default() {
            plants.push((set.name, variables.parameters));
        }
    }
    assert_eq!(plants.len(), 10);
    for (rate, most) in RATES.into_iter().zip([0.7, 1.2, 1.75, 2.1, 2.7]) {
        let worst = plants
            .iter()
            .map(|(name, plant)| {
                let worst = worst_between_2500_and_4500_rpm(rate, Disturbance::None, plant);
                println!("{name} at {rate} rpm/s: {worst:.3} kPa");
                worst
            })
            .fold(0.0, f64::max);
        assert_within(&format!("other plants at {rate} rpm/s"), worst, most);
    }
}

/// Engine speed varies by 100 rpm around 3500 rpm, where the bypass takes part.
#[test]
fn dither_of_engine_speed() {
    for frequency in [0.2, 0.5, 1.0] {
        for pressure in PRESSURES {
            let mut control = at(pressure, 3500.0, &plant::Parameters::default());
            let begin = control.time();
            let (mut worst, mut bypass): (f64, Vec<f64>) = (0.0, vec![]);
            while control.time() < begin + 20.0 {
                let phase = std::f64::consts::TAU * frequency * (control.time() - begin);
                control.surroundings.engine_speed = 3500.0 + 100.0 * phase.sin();
                control.step();
                worst = worst.max((control.boost_pressure() - pressure).abs());
                bypass.push(control.controller.variables.outputs.hp_bypass);
            }
            assert_within(&format!("{frequency} Hz at {pressure} Pa"), 1e-3 * worst, 0.8);
            let most = bypass.iter().copied().fold(0.0, f64::max);
            let least = bypass.iter().copied().fold(1.0, f64::min);
            println!("the bypass moves by {:.3}", most - least);
            // At 120 kPa it is 0.18: the bypass is asked for half of its opening, and 0.1 more or less.
            let expected = if pressure < 145e3 { 0.18 } else { 0.11 };
            assert!(most - least <= 1.1 * expected, "the bypass moves by {}", most - least);
        }
    }
}

/// The steps of Fig. 13 at speeds where the low-pressure wastegate takes part; above 175 kPa, the limit at 5500 rpm,
/// none end at their reference.
#[test]
fn steps_of_the_reference_at_high_speeds() {
    for speed in [2250.0, 2500.0, 3000.0, 3500.0, 4000.0, 4750.0, 5500.0] {
        let mut control = at(125e3, speed, &plant::Parameters::default());
        let begin = control.time();
        let references = [125.0, 135.0, 150.0, 170.0, 150.0, 130.0, 120.0, 140.0, 125.0];
        let steps: Vec<_> =
            references.iter().zip(0..).map(|(&r, k)| (begin + 10.0 * f64::from(k), r)).collect();
        let answers = follow(&mut control, &steps, begin + 90.0, |_| {});
        for answer in &answers[1..] {
            assert_within(&format!("{speed} rpm to {} Pa", answer.to), 1e-3 * answer.overshoot, 1.1);
            // 0.02 kPa between two solvers.
            assert!(answer.end_error <= 20.0, "{speed} rpm: {answer:?}");
        }
    }
}
