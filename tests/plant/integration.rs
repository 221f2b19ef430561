//! The integration with ramps of the inputs, steps of any length, and exhaust pressure on the wastegate, against the
//! classical Runge-Kutta method with short steps.

use boost_fmu::plant::system::System;
use boost_fmu::plant::variables::{InitializationMode, Inputs, Parameters, States, Variables};
use fmu_export::description::ScalarVariable;
use fmu_export::{Described as _, InputSignal, Inputs as _};

use crate::bench::{
    Bench, FULL_SCALES, OUTPUT_FULL_SCALES, inputs_of, numbers, reference_outputs, reference_states,
    states_of,
};
use crate::dependencies::reference;
use crate::random::Random;

/// The step of the Runge-Kutta method in s. With 1/2400 s, four times as long, its error on the recorded experiment is
/// 0.002 % of full scale; with this one it is negligible.
const SHORT_STEP: f64 = 1.0 / 9600.0;

/// The states after a duration in s of inputs that are functions of time, by the Runge-Kutta method.
fn runge_kutta(
    parameters: &Parameters,
    inputs: impl Fn(f64) -> Inputs,
    states: &States,
    duration: f64,
) -> States {
    let system = System::new(parameters);
    let slopes = |time: f64, x: &[f64; States::COUNT]| {
        system.evaluate(&inputs(time), &States::from_array(*x)).derivatives().to_array()
    };
    let count = (duration / SHORT_STEP).round();
    let step = duration / count;
    let mut x = states.to_array();
    let mut done = 0.0;
    while done < count {
        let time = done * step;
        let moved = |by: f64, k: &[f64; States::COUNT]| std::array::from_fn(|i| x[i] + by * k[i]);
        let k1 = slopes(time, &x);
        let k2 = slopes(time + 0.5 * step, &moved(0.5 * step, &k1));
        let k3 = slopes(time + 0.5 * step, &moved(0.5 * step, &k2));
        let k4 = slopes(time + step, &moved(step, &k3));
        x = std::array::from_fn(|i| x[i] + step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        done += 1.0;
    }
    States::from_array(x)
}

/// Compares states within 0.01 % of full scale, the aim of the default tolerance; the rod's speed and friction force
/// are fast and small, and have larger errors at kinks, as in the recorded experiment.
fn assert_near(found: &States, expected: &States, context: &str) {
    let (found, expected) = (reference_states(found), reference_states(expected));
    for (i, scale) in FULL_SCALES.iter().enumerate() {
        let tolerance = match i {
            3 => 1e-3,
            4 => 5e-3,
            _ => 1e-4,
        };
        let deviation = (found[i] - expected[i]).abs() / scale;
        assert!(deviation < tolerance, "{context}: state {i} deviates by {deviation:e} of its full scale");
    }
}

/// A running engine, almost at rest.
fn settled(change: impl FnOnce(&mut Parameters)) -> Bench {
    Bench::new(Inputs::default(), |parameters, _| {
        parameters.initialization.mode = InitializationMode::Settled;
        change(parameters);
    })
}

/// The position of a Real input.
fn input(name: &str) -> usize {
    Variables::description(reference(name)).and_then(ScalarVariable::real_input).expect("a Real input")
}

/// Value and first to third derivative of each changing input, at the start: speed rises, the throttle opens to its
/// bound, the wastegate shuts to its bound, supply and ambient follow curves.
const MOVING: [(&str, [f64; 4]); 6] = [
    ("throttle", [0.4, 0.5, 0.0, 0.0]),
    ("engine_speed", [1500.0, 800.0, -200.0, 0.0]),
    ("supply_voltage", [12.0, 1.5, -1.0, 0.0]),
    ("lp_wastegate", [0.1, -0.08, 0.0, 0.0]),
    ("ambient_pressure", [101_325.0, -2000.0, 0.0, 0.0]),
    ("ambient_temperature", [298.0, 0.0, 0.0, 8.0]),
];

/// The same at a time in s.
fn later([value, first, second, third]: [f64; 4], time: f64) -> [f64; 4] {
    let rise = time * (first + time / 2.0 * (second + time / 3.0 * third));
    [value + rise, first + time * (second + time / 2.0 * third), second + time * third, third]
}

#[test]
fn ramps_within_steps_are_integrated() {
    let inputs_at = |time: f64| {
        // The duty has just risen as well.
        let mut inputs = Inputs { hp_wastegate_pwm: 60.0, ..Inputs::default() };
        for (name, begin) in MOVING {
            let bounds = &Inputs::REALS[input(name)];
            inputs.set_real(input(name), later(begin, time)[0].clamp(bounds.min, bounds.max));
        }
        inputs
    };
    let begin = settled(|_| {});
    let duration = 2.0;
    let expected = runge_kutta(&begin.variables.parameters, inputs_at, &begin.variables.states, duration);
    for steps in [2_u32, 20, 160] {
        let mut bench = begin.clone();
        let size = duration / f64::from(steps);
        for step in 0..steps {
            let time = f64::from(step) * size;
            let mut signal = InputSignal::constant(&inputs_at(time));
            for (name, begin) in MOVING {
                // At a bound they lead beyond it, where the input is limited.
                for order in 1..=3 {
                    signal.set_derivative(input(name), order, later(begin, time)[order]);
                }
            }
            bench.step_with(size, &signal).expect("the step succeeds");
        }
        assert_near(&bench.variables.states, &expected, &format!("{steps} steps"));
        // Outputs belong to the inputs at the end, not at the start.
        let there = Bench::given(inputs_at(duration), bench.variables.states);
        let (found, expected) = (reference_outputs(&bench.variables), reference_outputs(&there.variables));
        for (i, scale) in OUTPUT_FULL_SCALES.iter().enumerate() {
            // Rounding of the inputs.
            assert!((found[i] - expected[i]).abs() < 1e-9 * scale, "output {i} after {steps} steps");
        }
    }
}

#[test]
fn one_step_of_an_hour_executes_as_many_samples_as_short_steps() {
    // The tank fills by its leak and the speed rises all the time.
    let ramp =
        |time: f64| Inputs { engine_speed: 1500.0 + 0.5 * time, hp_wastegate_pwm: 60.0, ..Inputs::default() };
    let begin = settled(|_| {});
    let after = |seconds: u32| {
        let mut bench = begin.clone();
        for step in 0..3600 / seconds {
            let mut signal = InputSignal::constant(&ramp(f64::from(step * seconds)));
            signal.set_derivative(input("engine_speed"), 1, 0.5);
            bench.step_with(f64::from(seconds), &signal).expect("the step succeeds");
        }
        bench.variables.states
    };
    let (once, often) = (after(3600), after(1));
    assert_near(&once, &often, "one step");
    assert!(once.tank.pressure > begin.variables.states.tank.pressure + 1e4, "nothing happened");
}

#[test]
fn uneven_steps_follow_the_recorded_experiment() {
    let mut lines = include_str!("../data/plant_trace.csv").lines();
    let first = lines.next().and_then(|line| line.strip_prefix("# x0: ")).expect("the initial state");
    // The header.
    let rows: Vec<_> = lines.map(|line| numbers(line, ',')).filter(|row| !row.is_empty()).collect();
    let mut bench = Bench::given(inputs_of(&rows[0][1..11]), states_of(&numbers(first, ' ')));
    let mut random = Random(5);
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
    let mut row = 0;
    while row < rows.len() {
        bench.variables.inputs = inputs_of(&rows[row][1..11]);
        // Several of the experiment's steps at once while the inputs are constant, up to 1.5 s; or one in parts.
        let most = random.between(0.0, 1.5);
        let mut last = row;
        while last + 1 < rows.len()
            && rows[last + 1][1..11] == rows[row][1..11]
            && rows[last + 1][0] < bench.time + most
        {
            last += 1;
        }
        let end = rows[last][0];
        while last == row && random.between(0.0, 1.0) < 0.7 {
            let part = (end - bench.time) * random.between(0.0, 1.0).powi(8);
            if part > 1e-9 {
                (shortest, longest) = (shortest.min(part), longest.max(part));
                bench.step(part);
            }
        }
        (shortest, longest) = (shortest.min(end - bench.time), longest.max(end - bench.time));
        bench.step(end - bench.time);
        assert_near(&bench.variables.states, &states_of(&rows[last][11..27]), &format!("at {end} s"));
        row = last + 1;
    }
    assert!(shortest < 1e-7 && longest > 0.5, "{shortest} s to {longest} s");
}

#[test]
fn exhaust_pressure_on_the_wastegate_is_integrated() {
    let begin = settled(|parameters| parameters.actuator.exhaust_area = 1e-4);
    let mut bench = begin.clone();
    let mut expected = begin.variables.states;
    for (duty, engine_speed) in [(70.0, 1500.0), (0.0, 2500.0), (45.0, 3500.0)] {
        let inputs = Inputs { hp_wastegate_pwm: duty, engine_speed, ..Inputs::default() };
        bench.variables.inputs = inputs;
        for step in 0..5 {
            bench.run(0.1);
            expected = runge_kutta(&begin.variables.parameters, |_| inputs, &expected, 0.1);
            assert_near(&bench.variables.states, &expected, &format!("{duty} %, {step}"));
        }
    }
    let push = bench.variables.locals.actuator.exhaust_force;
    assert!(push > 1.0, "{push} N");
}
