//! For any parameters and inputs within their ranges, and any step size, every value of the plant is physically
//! possible, or the call is an error.

use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{InitializationMode, Inputs, Parameters, Variables};
use fmu_export::description::{Causality, DataType, Initial};
use fmu_export::{Accessed as _, Described as _, Inputs as _, Model as _, Simulation};

use crate::bench::Bench;
use crate::random::Random;

/// The number of plants, unless `PHYSICAL_BOUNDS_CASES` gives another one.
const CASES: u64 = 20;
/// Flows in kg/s below this are rounding and the integration's error, 1e-4 of full scale.
const NO_FLOW: f64 = 2e-5;

/// A value between two bounds, in half of the cases a bound. Ranges over decades are logarithmic.
fn within(random: &mut Random, min: f64, max: f64) -> f64 {
    let kind = random.between(0.0, 4.0);
    if kind < 1.0 {
        min
    } else if kind < 2.0 {
        max
    } else if min > 0.0 && max > 100.0 * min {
        (min.ln() + (max / min).ln() * random.between(0.0, 1.0)).exp().clamp(min, max)
    } else {
        random.between(min, max)
    }
}

/// Inputs within their ranges.
fn random_inputs(random: &mut Random) -> Inputs {
    let mut inputs = Inputs::default();
    for (position, input) in Inputs::REALS.iter().enumerate() {
        inputs.set_real(position, within(random, input.min, input.max));
    }
    inputs
}

/// Changes a share of the Real parameters to other consistent ones.
fn random_parameters(random: &mut Random, share: f64) -> Variables {
    loop {
        let mut variables = Variables::default();
        for (reference, variable) in Variables::described() {
            let is_parameter = variable.causality == Causality::Parameter
                || variable.initial == Some(Initial::Exact) && variable.causality == Causality::Local;
            if is_parameter && variable.data_type == DataType::Real && random.between(0.0, 1.0) < share {
                let value = within(random, variable.min.max(-1e6), variable.max.min(1e6));
                variables.set_real(reference, value);
            }
        }
        let parameters = &mut variables.parameters;
        parameters.valve.duty_latch = random.between(0.0, 1.0) < 0.3;
        parameters.tank.frozen = random.between(0.0, 1.0) < 0.2;
        if random.between(0.0, 1.0) < 0.5 {
            parameters.initialization.mode = InitializationMode::Running;
        }
        if BoostPlant::check_parameters(&variables).is_ok() {
            return variables;
        }
    }
}

/// Collects physically impossible values in `impossible`.
fn check(bench: &Bench, context: &str, impossible: &mut Vec<String>) {
    check_values(bench, context, impossible);
    check_flows(bench, context, impossible);
}

/// Adds to `impossible` every value that is out of its physical bounds.
fn check_values(bench: &Bench, context: &str, impossible: &mut Vec<String>) {
    let Variables { states, locals, outputs, parameters: p, .. } = &bench.variables;
    let mut check = |name: &str, value: f64, least: f64, most: f64| {
        if !(least..=most).contains(&value) {
            impossible.push(format!("{context}: {name} = {value:e} is not between {least:e} and {most:e}"));
        }
    };
    let all = f64::MAX;
    for (reference, variable) in Variables::described() {
        let value = bench.variables.real(reference);
        let calculated = matches!(variable.causality, Causality::Output | Causality::Local);
        let name = variable.name().to_string();
        if calculated && !name.starts_with("der(") {
            if name.ends_with("pressure")
                && !name.starts_with("valve.")
                && !name.contains("effective_pressure")
            {
                check(&name, value, 0.0, all);
            }
            if name.ends_with("temperature") {
                check(&name, value, 0.0, all);
            }
            if name.ends_with("efficiency") && !name.contains("volumetric") {
                // The smooth maximum of two efficiencies exceeds the larger by up to half its width, 0.02.
                check(&name, value, 0.0, 1.01);
            }
            if name.ends_with("power") {
                check(&name, value, 0.0, all);
            }
        }
    }
    // Actuation.
    check("valve.plunger_duty", states.valve.plunger_duty, -0.01, 100.01);
    check("valve.commanded_duty", locals.valve.commanded_duty, 0.0, 100.0);
    check("valve.opening", locals.valve.opening, -1.0, 1.0);
    check("valve.voltage", locals.valve.voltage, 0.0, 32.0);
    check("supply_sensor.voltage", states.supply_sensor.voltage, -0.002, 32.002);
    check("pump.drawn_mass_flow", locals.pump.drawn_mass_flow, 0.0, p.pump.mass_flow);
    check("hp_wastegate_position", outputs.hp_wastegate_position, 0.0, 1.0);
    check("actuator.volume", locals.actuator.volume, f64::MIN_POSITIVE, all);
    let coulomb = p.actuator.coulomb_friction;
    check(
        "actuator.friction_force",
        states.actuator.friction_force,
        -1.01 * coulomb - 2e-3,
        1.01 * coulomb + 2e-3,
    );
    let a = &p.actuator;
    let push = a.membrane_area * largest_membrane_pressure(bench)
        + a.exhaust_area * outputs.exhaust_manifold_pressure;
    let force = push + a.spring_preload + a.spring_stiffness * a.stroke + coulomb;
    // The stop's spring absorbs the work of the largest force over the stroke.
    let static_depth = force / a.stop_stiffness;
    let depth = static_depth + (static_depth * (static_depth + 2.0 * a.stroke)).sqrt();
    check("actuator.position", states.actuator.position, -depth, a.stroke + depth);

    // Flows and work of the engine are not negative.
    for (name, flow) in [
        ("cylinders.air_mass_flow", locals.cylinders.air_mass_flow),
        ("cylinders.fuel_mass_flow", locals.cylinders.fuel_mass_flow),
        ("cylinders.exhaust_mass_flow", locals.cylinders.exhaust_mass_flow),
        ("air_mass_flow", outputs.air_mass_flow),
        ("cylinders.indicated_work", locals.cylinders.indicated_work),
        ("cylinders.friction_mean_effective_pressure", locals.cylinders.friction_mean_effective_pressure),
    ] {
        check(name, flow, 0.0, all);
    }
    let c = &p.cylinders;
    let filled = c.volumetric_efficiency_factor * c.compression_ratio / (c.compression_ratio - 1.0);
    check("cylinders.volumetric_efficiency", locals.cylinders.volumetric_efficiency, 0.0, filled);
    check("hp_shaft.speed", states.hp_shaft.speed, 0.0, all);
    check("lp_shaft.speed", states.lp_shaft.speed, 0.0, all);
}

/// Adds to `impossible` every flow against the pressure difference.
fn check_flows(bench: &Bench, context: &str, impossible: &mut Vec<String>) {
    let Variables { states, locals, .. } = &bench.variables;
    let mut downhill = |name: &str, flow: f64, from: f64, to: f64| {
        if flow.abs() > NO_FLOW && flow.signum() * (from - to).signum() < 0.0 {
            impossible.push(format!("{context}: {name} = {flow:e} from {from:e} Pa to {to:e} Pa"));
        }
    };
    let ambient = bench.variables.inputs.ambient_pressure;
    downhill(
        "valve.tank_mass_flow",
        locals.valve.tank_mass_flow,
        states.actuator.chamber_pressure,
        states.tank.pressure,
    );
    downhill(
        "valve.ambient_mass_flow",
        locals.valve.ambient_mass_flow,
        ambient,
        states.actuator.chamber_pressure,
    );
    downhill("valve.leakage_mass_flow", locals.valve.leakage_mass_flow, ambient, states.tank.pressure);
    downhill("air_filter.mass_flow", locals.air_filter.mass_flow, ambient, states.air_filter.pressure);
    let (before, after) = (states.hp_compressor.outlet_pressure, states.intercooler.outlet_pressure);
    downhill("intercooler.mass_flow", locals.intercooler.mass_flow, before, after);
    downhill(
        "throttle_body.mass_flow",
        locals.throttle_body.mass_flow,
        after,
        states.intake_manifold.pressure,
    );
    let (p_em, p_it) = (states.exhaust_manifold.pressure, states.interstage_exhaust.pressure);
    downhill("hp_turbine.mass_flow", locals.hp_turbine.mass_flow, p_em, p_it);
    downhill("hp_wastegate_port.mass_flow", locals.hp_wastegate_port.mass_flow, p_em, p_it);
    downhill("lp_turbine.mass_flow", locals.lp_turbine.mass_flow, p_it, states.exhaust.pressure);
    downhill(
        "lp_wastegate_port.mass_flow",
        locals.lp_wastegate_port.mass_flow,
        p_it,
        states.exhaust.pressure,
    );
    downhill("exhaust.mass_flow", locals.exhaust.mass_flow, states.exhaust.pressure, ambient);
}

/// Whether all values are finite. In the runtime, getting other values is an error.
fn is_finite(variables: &Variables) -> bool {
    Variables::described().all(|(reference, _)| variables.real(reference).is_finite())
}

/// The largest pressure difference in Pa on the membrane.
fn largest_membrane_pressure(bench: &Bench) -> f64 {
    1.1e5_f64.max(bench.variables.states.actuator.chamber_pressure)
}

#[test]
fn a_running_pump_reaches_its_ultimate_vacuum() {
    for mass_flow in [6.84e-6, 1e-3] {
        let inputs = Inputs { vacuum_pump: 1.0, hp_wastegate_pwm: 0.0, ..Inputs::default() };
        let mut bench =
            Bench::new(inputs, |parameters: &mut Parameters, _| parameters.pump.mass_flow = mass_flow);
        for _ in 0..12 {
            bench.step(200.0);
            // 10 Pa, reached from above; the tolerance of the tank's pressure is 0.1 Pa.
            assert!(bench.variables.states.tank.pressure > 9.9, "{}", bench.variables.states.tank.pressure);
        }
        assert!(bench.variables.states.tank.pressure < 11.0, "{}", bench.variables.states.tank.pressure);
    }
}

/// What happened to some plants: the steps that succeeded, the calls that were refused, and impossible values.
#[derive(Default)]
struct Outcome {
    steps: u32,
    refused: u32,
    impossible: Vec<String>,
}

/// Runs the plant of a case.
fn run(case: u64, outcome: &mut Outcome) {
    let mut random = Random(case);
    // From plants with few unusual parameters to those with only such.
    let share = [0.0, 0.02, 0.1, 0.3, 1.0][usize::try_from(case % 5).expect("below 5")];
    let variables = random_parameters(&mut random, share);
    let inputs = random_inputs(&mut random);
    let mut bench = Bench::new(inputs, |parameters: &mut Parameters, start| {
        (*parameters, *start) = (variables.parameters, variables.start);
    });
    if !is_finite(&bench.variables) {
        outcome.refused += 1;
        return;
    }
    check(&bench, &format!("case {case} at the start"), &mut outcome.impossible);
    for step in 0..8 {
        bench.variables.inputs = random_inputs(&mut random);
        let size = 10.0_f64.powf(random.between(-6.0, 3.0));
        let result = Simulation::step(&mut bench, size);
        if result.is_err() || !is_finite(&bench.variables) {
            outcome.refused += 1;
            return;
        }
        outcome.steps += 1;
        check(&bench, &format!("case {case} after step {step} of {size} s"), &mut outcome.impossible);
    }
}

#[test]
fn every_value_is_physically_possible_or_the_call_is_an_error() {
    let cases =
        std::env::var("PHYSICAL_BOUNDS_CASES").map_or(CASES, |cases| cases.parse().expect("a number"));
    // Some cases take far longer than others: each thread takes the next one.
    let next = AtomicU64::new(0);
    let work = || {
        let mut outcome = Outcome::default();
        loop {
            let case = next.fetch_add(1, Ordering::Relaxed);
            if case >= cases {
                return outcome;
            }
            run(case, &mut outcome);
        }
    };
    let count = thread::available_parallelism().map_or(1, NonZero::get);
    let outcomes: Vec<Outcome> = thread::scope(|scope| {
        let threads: Vec<_> = (0..count).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let steps: u32 = outcomes.iter().map(|outcome| outcome.steps).sum();
    let refused: u32 = outcomes.iter().map(|outcome| outcome.refused).sum();
    let impossible: Vec<String> = outcomes.into_iter().flat_map(|outcome| outcome.impossible).collect();
    println!("{steps} steps, {refused} refused");
    assert!(
        impossible.is_empty(),
        "{} values, the first of them\n{}",
        impossible.len(),
        impossible[..impossible.len().min(20)].join("\n")
    );
    assert!(steps > 4 * refused, "{refused} calls were errors, {steps} were not");
}
