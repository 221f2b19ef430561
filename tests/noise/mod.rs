//! Noise of the measured boost pressure: each movement of the wastegate that it causes costs vacuum.
//!
//! [`Loop`] rejects any alarm, also that of a tank that does not fill.

use boost_fmu::controller::variables as controller;

use crate::random::Random;
use crate::{Loop, Order, STEP};

/// Engine speeds (rpm) and references (Pa).
const POINTS: [(f64, f64); 12] = [
    (1000.0, 115e3),
    (1250.0, 130e3),
    (1500.0, 150e3),
    (2000.0, 130e3),
    (2000.0, 180e3),
    (2500.0, 150e3),
    (3000.0, 145e3),
    (3500.0, 145e3),
    (3500.0, 180e3),
    (4500.0, 160e3),
    (5500.0, 130e3),
    (6000.0, 145e3),
];

/// Time from any start to rest (s).
const SETTLING: f64 = 10.0;

/// A loop whose measurement has noise of a standard deviation (Pa).
fn with_noise(engine_speed: f64, boost_reference: f64, deviation: f64, seed: u64) -> Loop {
    let demand = controller::Inputs { boost_reference, engine_speed, ..controller::Inputs::default() };
    let mut control = Loop::settled(demand, Order::ControllerFirst, |_, _| {});
    control.noise = Some(Random(seed));
    control.noise_deviation = deviation;
    control
}

/// At rest for 300 s, with 100 Pa: boost stays within 1 kPa, and the pump rests at least a twentieth of the time, and a
/// fifth on average.
#[test]
fn the_pump_sustains_noise_at_rest() {
    let mut mean = 0.0;
    for ((engine_speed, boost_reference), seed) in POINTS.into_iter().zip(1..) {
        let mut control = with_noise(engine_speed, boost_reference, 100.0, seed);
        control.run(SETTLING, |_| {});
        let (mut on, mut worst): (f64, f64) = (0.0, 0.0);
        control.run(SETTLING + 300.0, |control| {
            on += STEP / 300.0 * control.controller.variables.outputs.vacuum_pump;
            worst = worst.max((control.boost_pressure() - boost_reference).abs());
        });
        println!(
            "{engine_speed} rpm, {boost_reference} Pa: pump on for {:.0} % of the time, boost within {worst:.0} Pa",
            100.0 * on
        );
        assert!(on <= 0.95 && worst <= 1e3, "{on}, {worst} Pa at {engine_speed} rpm");
        mean += on / POINTS.len() as f64;
    }
    println!("on average the pump is on for {:.0} % of the time", 100.0 * mean);
    assert!(mean <= 0.8, "{mean}");
}

/// At rest for 300 s, with 100 Pa, 10 rpm and 0.2 V: the pump keeps 40 kPa in the tank and rests 15 % of the time.
#[test]
fn the_pump_sustains_noise_of_all_measurements() {
    for ((engine_speed, boost_reference), seed) in
        [(1000.0, 112e3), (1500.0, 150e3), (3500.0, 145e3), (5000.0, 150e3)].into_iter().zip(21..)
    {
        let mut control = with_noise(engine_speed, boost_reference, 100.0, seed);
        (control.speed_deviation, control.supply_deviation) = (10.0, 0.2);
        control.run(SETTLING, |_| {});
        let (mut on, mut tank): (f64, f64) = (0.0, 0.0);
        control.run(SETTLING + 300.0, |control| {
            on += STEP / 300.0 * control.controller.variables.outputs.vacuum_pump;
            tank = tank.max(control.plant.variables.states.tank.pressure);
        });
        println!("{engine_speed} rpm, {boost_reference} Pa: pump {:.0} %, tank {tank:.0} Pa", 100.0 * on);
        assert!(on <= 0.85 && tank <= 40e3, "{on}, {tank} Pa at {engine_speed} rpm");
    }
}

/// Ramps of 700 rpm/s between 2000 and 5000 rpm without end, with 50 Pa.
#[test]
fn the_pump_sustains_noise_on_endless_ramps() {
    for (boost_reference, seed) in [(125e3, 1), (145e3, 2), (165e3, 3)] {
        let mut control = with_noise(2000.0, boost_reference, 50.0, seed);
        let (mut rate, mut tank): (f64, f64) = (700.0, 0.0);
        while control.time() < 120.0 {
            let speed = &mut control.surroundings.engine_speed;
            *speed += rate * STEP;
            if *speed >= 5000.0 || *speed <= 2000.0 {
                rate = -rate;
            }
            control.step();
            tank = tank.max(control.plant.variables.states.tank.pressure);
        }
        println!("{boost_reference} Pa: the tank is at {tank:.0} Pa at most");
        // Above 50 kPa the vacuum cannot open the wastegate fully.
        assert!(tank < 50e3, "{tank} Pa at {boost_reference} Pa");
    }
}
