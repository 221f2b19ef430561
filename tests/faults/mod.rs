//! Plant faults: the controller finds each within 2 s of the moment it can show, and limps home.

use boost_fmu::controller::variables as controller;
use boost_fmu::plant::variables as plant;

use crate::{Loop, Order};

/// When faults begin (s).
const BEGIN: f64 = 5.0;
/// The time in which they are found once they show (s).
const FOUND_WITHIN: f64 = 2.0;

const BOOST_SENSOR: f64 = 1.0;
const LOOP: f64 = 2.0;
const TANK_FILLING: f64 = 4.0;
const TANK_SENSOR: f64 = 8.0;
const SUPPLY_SENSOR: f64 = 16.0;

/// A settled loop at an operating point, with a tank that soon needs the pump, run until the faults begin.
fn at(engine_speed: f64, boost_reference: f64) -> Loop {
    let demand = controller::Inputs { engine_speed, boost_reference, ..controller::Inputs::default() };
    let mut control = Loop::settled(demand, Order::ControllerFirst, |_, _| {});
    control.run(BEGIN, |_| {});
    control
}

fn fault(control: &mut Loop) -> &mut plant::FaultParameters {
    &mut control.plant.variables.parameters.fault
}

fn code(control: &Loop) -> f64 {
    control.controller.variables.outputs.fault_code
}

/// The true pressure upstream of the throttle (Pa).
fn true_boost(control: &Loop) -> f64 {
    control.plant.variables.states.intercooler.outlet_pressure
}

/// Runs until something is found, for at most 2 s; asserts what, and returns the time taken.
#[track_caller]
fn assert_found(what: &str, control: &mut Loop, expected: f64) -> f64 {
    let begin = control.time();
    while code(control) == 0.0 {
        assert!(control.time() < begin + FOUND_WITHIN, "{what} is not found");
        control.step();
    }
    let found_after = control.time() - begin;
    println!("{what}: {found_after:.3} s");
    assert_eq!(code(control), expected, "{what}");
    found_after
}

/// Runs until a time (s) and returns the boost error (kPa) then.
fn deviation_at(control: &mut Loop, end: f64) -> f64 {
    control.run(end, |_| {});
    1e-3 * (true_boost(control) - control.demand.boost_reference)
}

/// It shows when the reference moves by more than `diagnosis.answer_error`.
#[test]
fn a_wastegate_stuck_where_it_is_is_found_by_the_next_step() {
    for (speed, from, to) in [
        (1500.0, 150e3, 170e3),
        (1500.0, 150e3, 130e3),
        (1500.0, 125e3, 134e3),
        (2000.0, 160e3, 200e3),
        (1250.0, 140e3, 125e3),
    ] {
        let mut control = at(speed, from);
        let position = control.plant.variables.outputs.hp_wastegate_position;
        (fault(&mut control).wastegate_stuck, fault(&mut control).wastegate_stuck_position) =
            (true, position);
        control.run(20.0, |control| assert_eq!(code(control), 0.0));
        control.demand.boost_reference = to;
        assert_found(&format!("stuck wastegate, {speed} rpm to {to} Pa"), &mut control, LOOP);
        // The lowest boost the other valves allow.
        let commands = control.controller.variables.outputs;
        control.step();
        assert_eq!(control.controller.variables.outputs.lp_wastegate, 1.0, "after {commands:?}");
        assert_eq!(control.controller.variables.outputs.hp_wastegate_pwm, 75.0);
        control.run(control.time() + 5.0, |_| {});
        assert!(true_boost(&control) < from, "{} Pa", true_boost(&control));
    }
}

/// It shows at once, as boost leaves its reference by `diagnosis.answer_error`. It would rise to 230 kPa.
#[test]
fn a_wastegate_stuck_shut_is_found_at_once() {
    let mut control = at(1500.0, 150e3);
    (fault(&mut control).wastegate_stuck, fault(&mut control).wastegate_stuck_position) = (true, 0.0);
    while true_boost(&control) < 158e3 {
        control.step();
    }
    assert_found("wastegate stuck shut", &mut control, LOOP);
    control.run(30.0, |_| {});
    assert!(true_boost(&control) < 190e3, "{} Pa", true_boost(&control));
}

/// Low boost could be due to the throttle, until the reference rises.
#[test]
fn a_wastegate_stuck_open_is_found_by_the_next_step_up() {
    let mut control = at(1500.0, 150e3);
    (fault(&mut control).wastegate_stuck, fault(&mut control).wastegate_stuck_position) = (true, 0.8);
    control.run(15.0, |control| assert_eq!(code(control), 0.0));
    control.demand.boost_reference = 170e3;
    assert_found("wastegate stuck open", &mut control, LOOP);
}

/// A stuck sensor shows when the reference moves, and then looks like a stuck wastegate.
#[test]
fn a_stuck_boost_sensor_is_found_by_the_next_step() {
    for reference in [170e3, 130e3] {
        let mut control = at(1500.0, 150e3);
        let shown = control.boost_pressure();
        let fault = fault(&mut control);
        (fault.boost_sensor_stuck, fault.boost_sensor_stuck_pressure) = (true, shown);
        control.run(10.0, |control| assert_eq!(code(control), 0.0));
        control.demand.boost_reference = reference;
        assert_found(&format!("stuck boost sensor, to {reference} Pa"), &mut control, LOOP);
        control.run(20.0, |_| {});
        assert!(true_boost(&control) < 115e3, "{} Pa", true_boost(&control));
    }
}

/// A stuck sensor also shows when engine speed has changed by `diagnosis.constant_over_speed`.
#[test]
fn a_stuck_boost_sensor_is_found_when_engine_speed_changes() {
    let mut control = at(1500.0, 150e3);
    control.controller.variables.parameters.diagnosis.constant_over_speed = 200.0;
    let shown = control.boost_pressure();
    let fault = fault(&mut control);
    (fault.boost_sensor_stuck, fault.boost_sensor_stuck_pressure) = (true, shown);
    control.run(10.0, |control| {
        assert_eq!(code(control), 0.0);
    });
    while control.surroundings.engine_speed < 1700.0 {
        control.surroundings.engine_speed += 2.5;
        control.step();
    }
    assert_found("stuck boost sensor, another speed", &mut control, BOOST_SENSOR);
    let deviation = deviation_at(&mut control, 30.0);
    assert!(deviation.abs() < 3.0, "{deviation} kPa with the feedforward alone");
}

/// An offset shows when it begins if it exceeds 40 kPa, the largest change a throttle can cause within a sample; a
/// smaller one looks like a different engine.
#[test]
fn an_offset_of_the_boost_sensor_is_found_when_it_begins() {
    for offset in [-45e3, 45e3, 80e3] {
        let mut control = at(2000.0, 170e3);
        fault(&mut control).boost_sensor_offset = offset;
        assert_found(&format!("boost sensor off by {offset} Pa"), &mut control, BOOST_SENSOR);
        // The map's accuracy: friction makes up to 1.8 kPa.
        let deviation = deviation_at(&mut control, 20.0);
        assert!(deviation.abs() < 3.0, "{deviation} kPa with the feedforward alone");
    }
}

#[test]
fn a_dead_boost_sensor_is_found() {
    for shown in [0.0, 500e3] {
        let mut control = at(2500.0, 150e3);
        let fault = fault(&mut control);
        (fault.boost_sensor_stuck, fault.boost_sensor_stuck_pressure) = (true, shown);
        assert_found(&format!("boost sensor shows {shown} Pa"), &mut control, BOOST_SENSOR);
        let deviation = deviation_at(&mut control, 20.0);
        assert!(deviation.abs() < 3.0, "{deviation} kPa with the feedforward alone");
    }
}

/// It shows when the measured voltage is outside 6 to 18 V.
#[test]
fn an_offset_of_the_supply_sensor_is_found_until_it_ends() {
    for offset in [-8.0, 8.0] {
        let mut control = at(1500.0, 150e3);
        fault(&mut control).supply_sensor_offset = offset;
        assert_found(&format!("supply sensor off by {offset} V"), &mut control, SUPPLY_SENSOR);
        control.step();
        assert_eq!(control.controller.variables.locals.voltage_compensation, 1.0);
        let deviation = deviation_at(&mut control, 20.0);
        assert!(deviation.abs() < 0.1, "{deviation} kPa");
        // Plausible again.
        fault(&mut control).supply_sensor_offset = 1.0;
        control.run(22.0, |_| {});
        assert_eq!(code(&control), 0.0);
    }
}

/// The pump is then timed, so that the tank keeps a vacuum for any wastegate position.
#[test]
fn a_dead_tank_sensor_is_found_and_the_pump_runs_by_time() {
    let mut control = at(1500.0, 150e3);
    fault(&mut control).tank_sensor_dead = true;
    assert_found("dead tank sensor", &mut control, TANK_SENSOR);
    let mut on = 0;
    control.run(305.0, |control| {
        on += u32::from(control.controller.variables.outputs.vacuum_pump > 0.0);
        let pressure = control.plant.variables.states.tank.pressure;
        assert!(pressure < 40e3, "the tank is at {pressure} Pa");
    });
    // A quarter of 300 s.
    assert!((5900..6200).contains(&on), "{on} samples with the pump");
    assert_eq!(code(&control), TANK_SENSOR);
}

/// It shows when the pump is switched on.
#[test]
fn a_pump_that_is_dead_and_a_leak_are_found_when_the_pump_runs() {
    let dead: fn(&mut plant::FaultParameters) = |fault| fault.pump_dead = true;
    let leaks: fn(&mut plant::FaultParameters) = |fault| fault.vacuum_leak_area = 4e-8;
    for (what, begin) in [("dead pump", dead), ("leak", leaks)] {
        let mut control = at(1500.0, 150e3);
        begin(fault(&mut control));
        while control.controller.variables.outputs.vacuum_pump == 0.0 {
            assert_eq!(code(&control), 0.0);
            control.step();
        }
        assert_found(what, &mut control, TANK_FILLING);
        control.step();
        assert_eq!(control.controller.variables.outputs.vacuum_pump, 0.0, "the pump is spared");
        // The vacuum lasts for a while; once it is lost, boost is the lowest the other valves allow.
        while control.plant.variables.states.tank.pressure < 49.9e3 {
            control.step();
            assert!((true_boost(&control) - 150e3).abs() < 500.0, "{} Pa", true_boost(&control));
        }
        control.run(control.time() + 5.0, |_| {});
        assert_eq!(control.controller.variables.outputs.lp_wastegate, 1.0);
        assert!(true_boost(&control) < 150e3, "{} Pa", true_boost(&control));
    }
}

/// Without limp-home, a finding does not switch the pump on.
#[test]
fn without_limp_home_a_finding_changes_nothing() {
    let pump = |limp_home: bool, sound: bool| {
        let mut control = at(1500.0, 150e3);
        control.controller.variables.parameters.diagnosis.limp_home = limp_home;
        fault(&mut control).tank_sensor_dead = !sound;
        control.run(8.0, |_| {});
        assert_eq!(code(&control), if sound { 0.0 } else { TANK_SENSOR });
        control.controller.variables.outputs.vacuum_pump
    };
    assert_eq!(pump(false, false), pump(false, true));
    assert_ne!(pump(true, false), pump(true, true));
}

/// References within and beyond reach, at all speeds, on the ground and at 3000 m, by both strategies: [`Loop::step`]
/// asserts that nothing is found.
#[test]
fn nothing_is_found_where_the_reference_is_out_of_reach() {
    for strategy in [controller::Strategy::SplitRange, controller::Strategy::BySpeed] {
        for ambient_pressure in [101_325.0, 70e3] {
            for engine_speed in [1000.0, 1500.0, 2000.0, 2750.0, 3500.0, 4500.0, 5500.0] {
                let surroundings =
                    plant::Inputs { ambient_pressure, engine_speed, ..plant::Inputs::default() };
                let demand = controller::Inputs { engine_speed, ..controller::Inputs::default() };
                let mut control =
                    Loop::settled_in(surroundings, demand, Order::ControllerFirst, |controller, _| {
                        controller.strategy = strategy;
                    });
                for reference in [90e3, 240e3, 125e3, 185e3, 80e3, 150e3, 240e3, 200e3, 240e3] {
                    control.demand.boost_reference = reference;
                    control.run(control.time() + 4.0, |_| {});
                }
            }
        }
    }
}

/// The driver lifts the foot and accelerates again, and the supply is far from nominal.
#[test]
fn nothing_is_found_in_what_disturbs_a_sound_engine() {
    for (engine_speed, reference) in [(1500.0, 150e3), (2000.0, 200e3), (3000.0, 180e3), (4500.0, 170e3)] {
        let mut control = at(engine_speed, reference);
        for throttle in [0.3, 1.0, 0.1, 0.5, 0.05, 1.0] {
            control.surroundings.throttle = throttle;
            control.run(control.time() + 3.0, |_| {});
        }
        for supply_voltage in [8.0, 16.0, 7.0, 13.5] {
            control.surroundings.supply_voltage = supply_voltage;
            control.run(control.time() + 3.0, |_| {});
        }
        // The drop while the pump runs, as in Fig. 8.
        control.plant.variables.parameters.pump.voltage_drop = 0.4;
        control.run(control.time() + 100.0, |_| {});
    }
}
