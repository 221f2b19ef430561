//! Experiments integrated by independent implementations with a tolerance of 1e-11: a recorded one of 40 s with
//! closed loop, steps of voltage, a ramp of speed, duty between its limits and a step of the throttle, and ten of
//! 20 s with random inputs (tests/data/experiments/make.py).

use boost_fmu::plant::variables::Inputs;

use crate::bench::{
    Bench, FULL_SCALES, OUTPUT_FULL_SCALES, initial_states, inputs_of, numbers, reference_outputs,
    reference_states,
};
use crate::random_experiment::{RandomExperiment, STEP};

/// Indices of states in the order of the reference.
const ROD_SPEED: usize = 3;
const FRICTION: usize = 4;

/// The largest errors of states and outputs so far, relative to their full scales.
struct Errors([f64; 36]);

impl Errors {
    /// Compares a plant with states and outputs of the reference.
    fn add(&mut self, bench: &Bench, expected: &[f64]) {
        let found = [&reference_states(&bench.variables.states)[..], &reference_outputs(&bench.variables)];
        let scales = FULL_SCALES.iter().chain(&OUTPUT_FULL_SCALES);
        for (i, ((found, expected), scale)) in found.concat().iter().zip(expected).zip(scales).enumerate() {
            self.0[i] = self.0[i].max((found - expected).abs() / scale);
        }
    }

    /// Prints the errors, and asserts that they are within 0.01 % of full scale. The rod's speed and friction force are
    /// fast and small, and lose the order of the method at kinks (stops, reversals).
    fn assert_small(&self, experiment: &str) {
        let others = self.0.iter().enumerate().filter(|&(i, _)| i != ROD_SPEED && i != FRICTION);
        println!(
            "{experiment}: largest errors in % of full scale: rod speed {:.3}, friction {:.3}, all others {:.4}",
            100.0 * self.0[ROD_SPEED],
            100.0 * self.0[FRICTION],
            100.0 * others.fold(0.0, |most: f64, (_, &error)| most.max(error))
        );
        for (i, &error) in self.0.iter().enumerate() {
            let tolerance = match i {
                ROD_SPEED => 1e-3,
                FRICTION => 5e-3,
                _ => 1e-4,
            };
            assert!(error < tolerance, "{experiment}: quantity {i} deviates by {error:e} of its full scale");
        }
    }
}

#[test]
fn the_recorded_experiment_is_reproduced() {
    let mut lines = include_str!("../data/plant_trace.csv").lines();
    let states = initial_states(lines.next());
    let mut bench: Option<Bench> = None;
    let mut errors = Errors([0.0; 36]);
    // The header.
    for row in lines.map(|line| numbers(line, ',')).filter(|row| !row.is_empty()) {
        let inputs = inputs_of(&row[1..11]);
        let bench = bench.get_or_insert_with(|| Bench::given(inputs, states));
        bench.variables.inputs = inputs;
        bench.step(row[0] - bench.time);
        errors.add(bench, &row[11..]);
    }
    assert!((bench.expect("the trace has rows").time - 40.0).abs() < 1e-9);
    errors.assert_small("recorded");
}

#[test]
fn experiments_in_which_all_inputs_move_are_reproduced() {
    for number in RandomExperiment::NUMBERS {
        let experiment = RandomExperiment::read(number);
        let mut lines = experiment.reference.lines();
        let mut bench = Bench::given(experiment.inputs(0), initial_states(lines.next()));
        let mut rows = lines.map(|line| numbers(line, ','));
        let mut next = rows.next();
        let mut errors = Errors([0.0; 36]);
        let mut step = 0;
        while let Some(row) = next.take() {
            while bench.time < row[0] - 1e-9 {
                bench.variables.inputs = experiment.inputs(step);
                step += 1;
                bench.step(f64::from(step) * STEP - bench.time);
            }
            errors.add(&bench, &row[1..]);
            next = rows.next();
        }
        assert_eq!(step, RandomExperiment::STEPS);
        errors.assert_small(&format!("experiment {number}"));
    }
}

#[test]
fn the_smaller_tolerance_counts() {
    let run = |parameter: f64, importer: Option<f64>| {
        let mut bench = Bench::new(Inputs::default(), |parameters, _| {
            parameters.solver.relative_tolerance = parameter;
        });
        bench.experiment.tolerance = importer;
        bench.variables.inputs.hp_wastegate_pwm = 80.0;
        bench.run(0.5);
        bench.variables.states.to_array().map(f64::to_bits)
    };
    let fine = run(1e-6, None);
    assert_eq!(run(1e-3, Some(1e-6)), fine);
    assert_eq!(run(1e-6, Some(1e-3)), fine);
    assert_ne!(run(1e-3, None), fine);
}
