//! Initialization: outputs of the mode without memory, with the declared dependencies; and the wait for the first
//! measurement.

use std::collections::BTreeSet;

use boost_fmu::controller::BoostController;
use boost_fmu::controller::actuator_inverse;
use boost_fmu::controller::variables::{ControlMode, Inputs, Outputs, Parameters, Variables};
use fmu_export::description::{Causality, DataType};
use fmu_export::{Inputs as _, Model as _, Variables as _};

use crate::bench::Bench;

fn initial_outputs(inputs: &Inputs, mode: ControlMode) -> Outputs {
    Bench::new(inputs, |parameters| parameters.mode = mode).variables.outputs
}

#[test]
fn the_outputs_are_those_of_the_mode_without_memory() {
    let inputs = Inputs {
        wastegate_reference: 0.3,
        pwm_reference: 55.0,
        supply_voltage_measured: 10.0,
        ..Inputs::default()
    };
    let boost = initial_outputs(&inputs, ControlMode::Boost);
    assert_eq!(boost.hp_wastegate_pwm, 43.9864 * 1.2);
    let inverse = actuator_inverse::duty(&Variables::default().parameters.actuator_inverse, 0.3);
    assert_eq!(initial_outputs(&inputs, ControlMode::Position).hp_wastegate_pwm, inverse * 1.2);
    assert_eq!(initial_outputs(&inputs, ControlMode::OpenLoop).hp_wastegate_pwm, 55.0 * 1.2);
    assert_eq!((boost.vacuum_pump, boost.lp_wastegate, boost.hp_bypass), (0.0, 0.0, 0.0));
    let faster = initial_outputs(&Inputs { engine_speed: 2750.0, ..inputs }, ControlMode::Boost);
    assert_eq!((faster.lp_wastegate, faster.hp_bypass), (0.5, 0.0));
    let fast = initial_outputs(&Inputs { engine_speed: 3500.0, ..inputs }, ControlMode::Boost);
    assert_eq!((fast.hp_wastegate_pwm, fast.lp_wastegate, fast.hp_bypass), (75.0 * 1.2, 0.0, 1.0));
}

/// In mode boost the duty is limited: 110 kPa at 2000 rpm needs 100 %, and `pwm_max` is 75 %.
#[test]
fn the_limits_hold_in_initialization() {
    let inputs = Inputs { boost_reference: 110e3, engine_speed: 2000.0, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |_| {});
    assert_eq!(bench.variables.outputs.hp_wastegate_pwm, 75.0);
    assert_eq!(bench.variables.locals.unsaturated_pwm, 100.0);
    assert!(bench.variables.locals.saturated);
    bench.variables.parameters.pwm_max = 60.0;
    bench.initialize(&inputs);
    assert_eq!(bench.variables.outputs.hp_wastegate_pwm, 60.0);
}

/// Masters repeat the initialization, with other inputs each time.
#[test]
fn initialization_forgets() {
    let inputs = Inputs { boost_reference: 150e3, boost_pressure: 130e3, ..Inputs::default() };
    let run = |bench: &mut Bench| -> Vec<Outputs> { (0..50).map(|k| bench.sample(k, &inputs)).collect() };
    let mut fresh = Bench::new(&inputs, |_| {});
    let expected = (fresh.variables.outputs, run(&mut fresh));
    let mut used = Bench::new(&Inputs { engine_speed: 5000.0, ..inputs }, |_| {});
    for number in 0..10 {
        used.sample(number, &Inputs { engine_speed: 4000.0, tank_pressure: 5e4, ..inputs });
    }
    used.initialize(&inputs);
    let again = (used.variables.outputs, run(&mut used));
    assert_eq!(again, expected);
}

#[test]
fn before_the_first_measurement_the_outputs_are_those_of_initialization() {
    let inputs = Inputs { boost_reference: 150e3, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |_| {});
    let initial = bench.variables.outputs;
    let nothing = Inputs {
        boost_pressure: 0.0,
        boost_reference: 0.0,
        tank_pressure: 4e4,
        supply_voltage_measured: 0.0,
        engine_speed: 4000.0,
        ..inputs
    };
    for number in 0..5 {
        let almost = Inputs { boost_pressure: 4999.0 * f64::from(number), ..nothing };
        assert_eq!(bench.sample(number, &almost), initial);
        assert_eq!(bench.variables.locals.sample_count, i32::try_from(number).unwrap() + 1);
    }
    // From there on it behaves as a controller that has just started.
    let mut fresh = Bench::new(&inputs, |_| {});
    for number in 0..100 {
        let measured = Inputs { boost_pressure: 20e3 + 1e3 * f64::from(number), ..inputs };
        assert_eq!(bench.sample(number + 5, &measured), fresh.sample(number, &measured));
    }
    // After the start, a lower pressure is a measurement like any other.
    let before = bench.variables.locals.unsaturated_pwm;
    bench.sample(105, &Inputs { boost_pressure: 0.0, ..inputs });
    assert!(bench.variables.locals.unsaturated_pwm != before);
}

/// Masters set connected inputs to zero; compensation for 0 V would double the duty. An engine's start lowers the
/// supply to 3 V (ISO 16750-2), not further.
#[test]
fn a_voltage_below_3_v_is_not_compensated_before_the_first_measurement() {
    for mode in [ControlMode::Boost, ControlMode::Position, ControlMode::OpenLoop] {
        let nominal = Inputs { wastegate_reference: 0.3, pwm_reference: 35.0, ..Inputs::default() };
        let at = |supply_voltage_measured| Inputs { supply_voltage_measured, ..nominal };
        for nothing in [0.0, 2.999] {
            assert_eq!(initial_outputs(&at(nothing), mode), initial_outputs(&nominal, mode));
            // Initialization leaves no memory: some masters pass start values there, and zeros later.
            for start in [at(nothing), nominal] {
                let change = |parameters: &mut Parameters| parameters.mode = mode;
                let (mut bench, mut expected) = (Bench::new(&start, change), Bench::new(&nominal, change));
                for number in 0..3 {
                    assert_eq!(bench.sample(number, &at(nothing)), expected.sample(number, &nominal));
                    assert_eq!(bench.variables.locals.voltage_compensation, 1.0);
                }
                // The first measurement is used at once; from then on 0 V is a measurement, too.
                for (number, voltage, factor) in [(3, 3.0, 2.0), (4, 10.0, 1.2), (5, nothing, 2.0)] {
                    bench.sample(number, &at(voltage));
                    assert_eq!(bench.variables.locals.voltage_compensation, factor);
                }
            }
        }
    }
    assert_eq!(
        initial_outputs(&Inputs { supply_voltage_measured: 3.0, ..Inputs::default() }, ControlMode::Boost)
            .hp_wastegate_pwm,
        43.9864 * 2.0
    );
}

#[test]
fn the_other_modes_do_not_wait_for_a_measurement() {
    for mode in [ControlMode::Position, ControlMode::OpenLoop] {
        let inputs = Inputs { boost_pressure: 0.0, tank_pressure: 4e4, ..Inputs::default() };
        let mut bench = Bench::new(&inputs, |parameters| parameters.mode = mode);
        assert_eq!(bench.sample(0, &inputs).vacuum_pump, 1.0);
    }
}

/// The dependencies that `InitialUnknowns` declares for each output, as names.
fn declared_dependencies() -> Vec<(&'static str, BTreeSet<&'static str>)> {
    let description = Variables::DESCRIPTION;
    // Indices of the XML begin at 1.
    let name = |index: &str| {
        let index: usize = index.parse().expect("an index");
        description.variables[index - 1].name
    };
    let attribute = |element: &'static str, key: &str| {
        let begin = element.find(key).expect("the attribute") + key.len();
        &element[begin..begin + element[begin..].find('"').expect("a quote")]
    };
    let unknowns =
        Variables::MODEL_DESCRIPTION_XML.split_once("<InitialUnknowns>").expect("InitialUnknowns").1;
    let unknowns = unknowns.split_once("</InitialUnknowns>").expect("an end").0;
    unknowns
        .split("<Unknown ")
        .skip(1)
        .map(|element| {
            let dependencies = attribute(element, "dependencies=\"").split_whitespace().map(name).collect();
            (name(attribute(element, "index=\"")), dependencies)
        })
        .collect()
}

/// Changes every input and Real parameter, one by one, at operating points that exercise all branches: the outputs
/// depend on exactly what is declared.
#[test]
fn initialization_depends_on_what_is_declared() {
    let description = Variables::DESCRIPTION;
    let mut moved: Vec<(&str, BTreeSet<&str>)> = Vec::new();
    for variable in description.variables {
        if variable.causality == Causality::Output {
            moved.push((variable.name, BTreeSet::new()));
        }
    }
    let outputs = |variables: &Variables, inputs: &Inputs| {
        let mut bench = Bench::new(inputs, |_| {});
        bench.variables = variables.clone();
        bench.initialize(inputs);
        let outputs = bench.variables.outputs;
        [outputs.hp_wastegate_pwm, outputs.vacuum_pump, outputs.lp_wastegate, outputs.hp_bypass]
    };
    let mut note = |name: &'static str, before: [f64; 4], after: [f64; 4]| {
        for ((_, names), (before, after)) in moved.iter_mut().zip(before.into_iter().zip(after)) {
            if before.to_bits() != after.to_bits() {
                names.insert(name);
            }
        }
    };
    for (mode, boost_reference, engine_speed, map) in operating_points() {
        let inputs =
            Inputs { boost_reference, engine_speed, supply_voltage_measured: 11.0, ..Inputs::default() };
        let inputs = Inputs { wastegate_reference: 0.6, ..inputs };
        let mut variables = Variables::default();
        variables.parameters.mode = mode;
        if let Some(duty) = map {
            variables.parameters.schedule.feedforward = [[duty; 7]; 16];
        }
        let before = outputs(&variables, &inputs);
        for (reference, variable) in (0..).zip(description.variables) {
            let changed_to = |value: f64| [value * 1.001, value * 0.999, value * 1.5, value * 0.5];
            if let Some(position) = variable.real_input {
                for value in changed_to(inputs.real(position)) {
                    let mut changed = inputs;
                    changed.set_real(position, value.clamp(variable.min, variable.max));
                    note(variable.name, before, outputs(&variables, &changed));
                }
            } else if variable.causality == Causality::Parameter {
                for value in changed_to(variables.real(reference)) {
                    let mut changed = variables.clone();
                    match variable.data_type {
                        DataType::Real => {
                            changed.set_real(reference, value.clamp(variable.min, variable.max));
                        }
                        DataType::Boolean => changed.set_boolean(reference, !variables.boolean(reference)),
                        _ => changed.set_integer(reference, variables.integer(reference) % 2 + 1),
                    }
                    if BoostController::check_parameters(&changed).is_ok() {
                        note(variable.name, before, outputs(&changed, &inputs));
                    }
                }
            }
        }
    }
    assert_eq!(moved, declared_dependencies());
}

/// Modes, boost references, engine speeds and, for some, a constant map: the high-pressure stage bypassed and just
/// not, a reference above the boost limit, a duty below the least and one above the largest, and a point in each
/// cell of the map with a duty between.
fn operating_points() -> Vec<(ControlMode, f64, f64, Option<f64>)> {
    let schedule = Variables::default().parameters.schedule;
    let mut points = vec![
        (ControlMode::Boost, 200e3, 3600.0, None),
        (ControlMode::Boost, 200e3, 3499.0, None),
        (ControlMode::Boost, 300e3, 2900.0, None),
        (ControlMode::Boost, 125e3, 1500.0, Some(10.0)),
        (ControlMode::Boost, 125e3, 1500.0, Some(90.0)),
        (ControlMode::Position, 125e3, 1500.0, None),
        (ControlMode::OpenLoop, 125e3, 1500.0, None),
    ];
    for pressures in schedule.boost_reference.windows(2) {
        for speeds in schedule.engine_speed.windows(2) {
            let (pressure, speed) =
                (f64::midpoint(pressures[0], pressures[1]), f64::midpoint(speeds[0], speeds[1]));
            points.push((ControlMode::Boost, pressure, speed, None));
            points.push((ControlMode::Boost, pressure, speed, Some(50.0)));
        }
    }
    points
}
