//! Initialization: outputs of the mode without memory, with the declared dependencies; and the wait for the first
//! measurement.

use std::collections::BTreeSet;

use boost_fmu::BoostController;
use boost_fmu::controller::actuator_inverse;
use boost_fmu::controller::variables::{ControlMode, Inputs, Outputs, Parameters, Strategy, Variables};
use fmu_export::description::{Causality, DataType, Name};
use fmu_export::{Accessed as _, Described as _, Inputs as _, Model as _};

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
    let by_speed =
        |engine_speed| Bench::by_speed(&Inputs { engine_speed, ..inputs }, |_| {}).variables.outputs;
    let faster = by_speed(2750.0);
    assert_eq!((faster.lp_wastegate, faster.hp_bypass), (0.5, 0.0));
    let fast = by_speed(3500.0);
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
    let variables = Variables::MODEL_DESCRIPTION_XML.split("<ScalarVariable name=\"").skip(1);
    let names: Vec<_> = variables.map(|element| element.split('"').next().expect("a name")).collect();
    // Indices of the XML begin at 1.
    let name = |index: &str| names[index.parse::<usize>().expect("an index") - 1];
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
    let mut moved: Vec<(String, BTreeSet<String>)> = Vec::new();
    for (_, variable) in Variables::described() {
        if variable.causality == Causality::Output {
            moved.push((variable.name().to_string(), BTreeSet::new()));
        }
    }
    let mut bench = Bench::new(&Inputs::default(), |_| {});
    let mut outputs = |variables: &Variables, inputs: &Inputs| {
        bench.variables.clone_from(variables);
        bench.initialize(inputs);
        let outputs = bench.variables.outputs;
        let Outputs { hp_wastegate_pwm, vacuum_pump, lp_wastegate, hp_bypass, surge_valve, fault_code } =
            outputs;
        [hp_wastegate_pwm, vacuum_pump, lp_wastegate, hp_bypass, fault_code, surge_valve]
    };
    let mut note = |name: Name, before: [f64; 6], after: [f64; 6]| {
        for ((_, names), (before, after)) in moved.iter_mut().zip(before.into_iter().zip(after)) {
            if before.to_bits() != after.to_bits() {
                names.insert(name.to_string());
            }
        }
    };
    let points = [points_by_speed(), points_of_split_range()].concat();
    for (boost_reference, engine_speed, parameters) in points {
        let inputs = Inputs {
            boost_reference,
            engine_speed,
            supply_voltage_measured: 11.0,
            wastegate_reference: 0.6,
            ambient_pressure: 99e3,
            ambient_temperature: 290.0,
            ..Inputs::default()
        };
        let variables = Variables { parameters, ..Variables::default() };
        assert_eq!(BoostController::check_parameters(&variables), Ok(()));
        let before = outputs(&variables, &inputs);
        for (reference, variable) in Variables::described() {
            let changed_to = |value: f64| [value * 1.001, value * 0.999, value * 1.5, value * 0.5];
            if let Some(position) = variable.real_input() {
                for value in changed_to(inputs.real(position)) {
                    let mut changed = inputs;
                    changed.set_real(position, value.clamp(variable.min, variable.max));
                    note(variable.name(), before, outputs(&variables, &changed));
                }
            } else if variable.causality == Causality::Parameter {
                // Of the many elements of maps small changes suffice.
                let changes = if variable.dimensions.is_empty() { 4 } else { 2 };
                for value in &changed_to(variables.real(reference))[..changes] {
                    let mut changed = variables.clone();
                    match variable.data_type {
                        DataType::Real => {
                            changed.set_real(reference, value.clamp(variable.min, variable.max));
                        }
                        DataType::Boolean => changed.set_boolean(reference, !variables.boolean(reference)),
                        _ => changed.set_integer(reference, variables.integer(reference) % 2 + 1),
                    }
                    if BoostController::check_parameters(&changed).is_ok() {
                        note(variable.name(), before, outputs(&changed, &inputs));
                    }
                }
            }
        }
    }
    // The description has them by value reference, the XML as in the JSON.
    let mut declared = declared_dependencies();
    declared.sort_unstable();
    moved.sort_unstable();
    for ((name, moved), (declared_name, declared)) in moved.iter().zip(declared) {
        assert_eq!(*name, declared_name);
        let moved: BTreeSet<_> = moved.iter().map(String::as_str).collect();
        let missing: Vec<_> = moved.difference(&declared).collect();
        let needless: Vec<_> = declared.difference(&moved).collect();
        assert!(
            missing.is_empty() && needless.is_empty(),
            "{name}: {missing:?} missing, {needless:?} needless"
        );
    }
}

/// A boost reference (Pa), an engine speed (rpm), and parameters.
type OperatingPoint = (f64, f64, Parameters);

/// The modes; in mode boost the high-pressure stage bypassed and just not, a reference above the boost limit, a duty
/// below the least and one above the largest, and a point in each cell of the map with a duty between.
fn points_by_speed() -> Vec<OperatingPoint> {
    let parameters = Parameters { strategy: Strategy::BySpeed, ..Parameters::default() };
    let in_mode = |mode| Parameters { mode, ..parameters };
    let with_map = |duty| {
        let mut parameters = parameters;
        parameters.schedule.feedforward = [[duty; 7]; 16];
        parameters
    };
    let mut points = vec![
        (200e3, 3600.0, parameters),
        (200e3, 3499.0, parameters),
        (300e3, 2900.0, parameters),
        (125e3, 1500.0, with_map(10.0)),
        (125e3, 1500.0, with_map(90.0)),
        (125e3, 1500.0, in_mode(ControlMode::Position)),
        (125e3, 1500.0, in_mode(ControlMode::OpenLoop)),
    ];
    let schedule = &parameters.schedule;
    for (pressure, speed) in middles(&schedule.boost_reference, &schedule.engine_speed) {
        points.push((pressure, speed, parameters));
        points.push((pressure, speed, with_map(50.0)));
    }
    points
}

/// With valves that take part from 500 or 600 rpm on: a point in each cell of the map and, beyond its limit, in each
/// column. Then the branches of the allocation, as each says.
fn points_of_split_range() -> Vec<OperatingPoint> {
    let mut early = Parameters { boost_limit: 1e6, ..Parameters::default() };
    let allocation = &mut early.allocation;
    (allocation.low_pressure_shut_below, allocation.low_pressure_free_above) = (500.0, 600.0);
    (allocation.bypass_shut_below, allocation.bypass_free_above) = (500.0, 600.0);
    early.range_schedule.boost_limit = [239e3; 12];
    for (i, row) in early.range_schedule.virtual_duty.iter_mut().enumerate() {
        for (j, duty) in row.iter_mut().enumerate() {
            // Between 64 and 74 %: no valve is at a limit.
            *duty = 64.0 + 0.4 * i as f64 + 0.3 * j as f64;
        }
    }
    let changed = |change: fn(&mut Parameters)| {
        let mut parameters = early;
        change(&mut parameters);
        parameters
    };
    let mut points = vec![
        // Speeds between shut and free, and the parameter boost_limit.
        (125e3, 550.0, early),
        (300e3, 1500.0, changed(|parameters| parameters.boost_limit = 150e3)),
        // Above the largest duty of the high-pressure wastegate, and below the least virtual duty.
        (125e3, 1500.0, changed(|parameters| parameters.pwm_max = 62.0)),
        (125e3, 1500.0, changed(|parameters| parameters.pwm_min = 74.5)),
        // The low-pressure wastegate fully open at 40 + 20/3 %.
        (
            125e3,
            520.0,
            changed(|parameters| {
                let allocation = &mut parameters.allocation;
                (allocation.low_pressure_start, allocation.low_pressure_span) = (40.0, 20.0);
                (allocation.low_pressure_shape, allocation.low_pressure_free_above) = (2.0, 1000.0);
                (allocation.bypass_start, allocation.bypass_end) = (42.0, 60.0);
            }),
        ),
    ];
    // The bypass open at a speed where the low-pressure wastegate is shut: up to the largest duty, or to full duty.
    for pwm_max in [70.0, 100.0] {
        let mut parameters = Parameters { pwm_max, ..early };
        parameters.range_schedule.virtual_duty = [[300.0; 12]; 16];
        parameters.allocation.low_pressure_shut_below = 2000.0;
        parameters.allocation.low_pressure_free_above = 2500.0;
        parameters.allocation.bypass_end = 200.0;
        points.push((125e3, 1500.0, parameters));
    }
    let schedule = &early.range_schedule;
    for (pressure, speed) in middles(&schedule.boost_reference, &schedule.engine_speed) {
        points.push((pressure, speed, early));
    }
    points.extend(schedule.engine_speed.map(|speed| (300e3, speed, early)));
    points
}

/// The middles of the cells of a grid.
fn middles(rows: &[f64], columns: &[f64]) -> Vec<(f64, f64)> {
    let middle = |pair: &[f64]| f64::midpoint(pair[0], pair[1]);
    rows.windows(2)
        .flat_map(|row| columns.windows(2).map(move |column| (middle(row), middle(column))))
        .collect()
}
