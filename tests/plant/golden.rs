//! Right-hand side, outputs and a short trajectory against an independent implementation.

use boost_fmu::plant::variables::Inputs;

use crate::bench::{
    Bench, FULL_SCALES, OUTPUT_FULL_SCALES, inputs_of, numbers, reference_outputs, reference_states,
    states_of,
};

/// The reference prints 13 digits; 1e-9 allows for another order of operations (differences of nearly equal flows lose
/// up to three digits), and detects any wrong term or constant.
const PRECISION: f64 = 1e-9;

/// The numbers of a row of the data, by case and quantity.
fn golden(case: &str, quantity: &str) -> Vec<f64> {
    let heading = format!("{case} {quantity} ");
    let mut rows = include_str!("../data/golden.txt").lines();
    let row = rows.find_map(|line| line.strip_prefix(&heading)).expect("the case exists");
    numbers(&row.split_whitespace().collect::<Vec<_>>().join(" "), ' ')
}

fn assert_close(what: &str, found: &[f64], expected: &[f64], absolute: impl Fn(usize) -> f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        let tolerance = PRECISION * expected.abs() + absolute(i);
        assert!((found - expected).abs() <= tolerance, "{what}[{i}] is {found:e} instead of {expected:e}");
    }
}

#[test]
fn derivatives_and_outputs_match_the_reference() {
    for case in ["G1", "G2", "G3"] {
        let bench = Bench::given(inputs_of(&golden(case, "u")), states_of(&golden(case, "x")));
        let exactly = |_| 0.0;
        assert_close(
            &format!("{case} dx"),
            &reference_states(&bench.variables.derivatives),
            &golden(case, "dx"),
            exactly,
        );
        assert_close(&format!("{case} y"), &reference_outputs(&bench.variables), &golden(case, "y"), exactly);
    }
}

#[test]
fn the_trajectory_matches_the_reference() {
    let phase = |pwm, voltage| Inputs { hp_wastegate_pwm: pwm, supply_voltage: voltage, ..Inputs::default() };
    let mut bench = Bench::running(phase(20.0, 12.0), false);
    for (case, inputs) in [("T1", phase(20.0, 12.0)), ("T2", phase(50.0, 11.1))] {
        bench.variables.inputs = inputs;
        bench.run(2.0);
        let found =
            [&reference_states(&bench.variables.states)[..], &reference_outputs(&bench.variables)].concat();
        let expected = [golden(case, "x"), golden(case, "y")].concat();
        let scales = FULL_SCALES.iter().chain(&OUTPUT_FULL_SCALES);
        for (i, ((found, expected), scale)) in found.iter().zip(&expected).zip(scales).enumerate() {
            // Two different integrators: 0.01 % of full scale; more for the rod's speed and the friction force,
            // which are fast and small.
            let tolerance = match i {
                3 => 1e-3,
                4 => 5e-3,
                _ => 1e-4,
            };
            let deviation = (found - expected).abs() / scale;
            assert!(deviation < tolerance, "{case}[{i}] deviates by {deviation:e} of its full scale");
        }
    }
}
