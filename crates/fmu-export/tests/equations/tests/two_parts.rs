//! Linear systems in two parts, forced by time and an input, by each integrator, with the model's capabilities and
//! without.

use std::array::from_fn;
use std::cell::Cell;

use fmu_export::integrator::Integrator;
use fmu_export::{
    Accessed as _, Described as _, Equations, InputSignal, Inputs as _, Integrate, Integrated, Numbered as _,
    Simulation, TwoRates,
};
use fmu_export_equations::{
    KeptTwoParts, KeptTwoPartsWithoutCapabilities, PARTS_EVALUATIONS, TwoParts, TwoPartsWithoutCapabilities,
};

/// A system of two parts and how it is driven.
#[derive(Clone, Copy, Debug)]
struct Case {
    /// The rates of the first part, of the second, and of the first one's effect on it.
    rates: [[[f64; 2]; 2]; 3],
    forcing: [f64; 2],
    /// The amplitude of the forcing over time.
    swing: f64,
    /// The input and its slope, up in one communication step and down in the next.
    input: [f64; 2],
}

impl Case {
    /// x' = −a·(x − cos t), y' = −a·(y − x); z' = y − z twice.
    fn chain(a: f64) -> Self {
        Self {
            rates: [[[-a, 0.0], [a, -a]], [[-1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0]; 2]],
            forcing: [a, 0.0],
            swing: 1.0,
            input: [0.0; 2],
        }
    }

    /// Stable systems: their rows' diagonals outweigh the rest, up to ten thousand times as fast as the forcing.
    fn random(number: u32) -> Self {
        // A linear congruential generator (Knuth, The Art of Computer Programming, volume 2, section 3.3.4).
        let mut bits = u64::from(number);
        let mut unit = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            2.0 * ((bits >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
        };
        let mut stable = |fastest: f64| -> [[f64; 2]; 2] {
            from_fn(|row| {
                let rate = fastest.powf(0.5 + 0.5 * unit());
                from_fn(|column| if row == column { -rate } else { 0.8 * rate * unit() })
            })
        };
        let (fast, slow) = (stable(1e4), stable(10.0));
        let rate = fast[0][0].abs();
        Self {
            rates: [fast, slow, from_fn(|_| from_fn(|_| unit()))],
            forcing: [rate * unit(), rate * unit()],
            // Each alone, and both.
            swing: if number.is_multiple_of(3) { 0.0 } else { unit() },
            input: if number % 3 == 1 { [0.0; 2] } else { [unit(), unit()] },
        }
    }
}

/// Runs a model of two parts for 10 s, by communication steps of 0.1 s. Returns the states after each, and the number of
/// evaluations.
fn run<E: Equations, I: Integrate<E>>(case: &Case, tolerance: f64) -> (Vec<[f64; 4]>, u32) {
    run_from(&mut Simulation::<Integrated<E, I>>::default(), case, tolerance, |_| {})
}

/// The same with a model as it is left by `between`, which is called after half of the time.
fn run_from<E: Equations, I: Integrate<E>>(
    simulation: &mut Simulation<Integrated<E, I>>,
    case: &Case,
    tolerance: f64,
    between: impl Fn(&mut Simulation<Integrated<E, I>>),
) -> (Vec<[f64; 4]>, u32) {
    *simulation = Simulation { model: simulation.model.clone(), ..Simulation::default() };
    let values = |name: &str| match name {
        "fast_rates" => case.rates[0].concat(),
        "slow_rates" => case.rates[1].concat(),
        "drive" => case.rates[2].concat(),
        "forcing" => case.forcing.to_vec(),
        "swing" => vec![case.swing],
        _ => vec![],
    };
    for variable in E::Variables::DESCRIPTION.variables {
        for (reference, value) in (variable.value_reference..).zip(values(variable.base_name)) {
            simulation.variables.set_real(reference, value);
        }
    }
    simulation.experiment.tolerance = Some(tolerance);
    simulation.initialize().unwrap();
    PARTS_EVALUATIONS.with(|count| count.set(0));
    let mut step = |number: u32| {
        if number == 50 {
            between(simulation);
        }
        let [value, slope] = case.input;
        let [rise, slope] = if number.is_multiple_of(2) { [0.0, slope] } else { [0.1 * slope, -slope] };
        let mut inputs = simulation.variables.inputs().clone();
        inputs.set_real(0, value + rise);
        let mut inputs = InputSignal::constant(&inputs);
        inputs.set_derivative(0, 1, slope);
        simulation.step_with(0.1, &inputs).unwrap();
        let mut states = [0.0; 4];
        E::Variables::each_state(&simulation.variables, |state, value: f64| states[state] = value);
        states
    };
    ((0..100).map(&mut step).collect(), PARTS_EVALUATIONS.with(Cell::get))
}

/// The largest error of any state at any time, relative to the sum of the state and its nominal value.
fn error(found: &[[f64; 4]], expected: &[[f64; 4]]) -> f64 {
    let states = found.as_flattened().iter().zip(expected.as_flattened());
    states.map(|(found, expected)| (found - expected).abs() / (1.0 + expected.abs())).fold(0.0, f64::max)
}

#[test]
fn steps_do_not_depend_on_capabilities() {
    for case in
        [Case::chain(10.0), Case::chain(1e6), Case { swing: 0.0, input: [1.0, 0.5], ..Case::chain(100.0) }]
    {
        for tolerance in [1e-6, 1e-8] {
            let by_integrator = [
                [run::<TwoParts, Integrator>, run::<TwoPartsWithoutCapabilities, Integrator>],
                [run::<KeptTwoParts, Integrator>, run::<KeptTwoPartsWithoutCapabilities, Integrator>],
                [run::<TwoParts, TwoRates<2, 2>>, run::<TwoPartsWithoutCapabilities, TwoRates<2, 2>>],
            ];
            for (number, [with, without]) in by_integrator.into_iter().enumerate() {
                assert_eq!(
                    with(&case, tolerance),
                    without(&case, tolerance),
                    "integrator {number}, {case:?}"
                );
            }
        }
    }
}

#[test]
fn a_fast_part_that_follows_the_time_takes_long_steps() {
    let (_, evaluations) = run::<TwoPartsWithoutCapabilities, Integrator>(&Case::chain(1e6), 1e-8);
    // A step takes eight evaluations, a Jacobian with the derivatives with respect to time five.
    assert!(evaluations <= 13 * 250, "{evaluations} evaluations");
}

/// The methods differ in what a tolerance means: the error of a run is some ten times that of a step, as states forget
/// earlier errors within a few steps.
const RUN: f64 = 10.0;

#[test]
fn two_rates_keep_the_tolerance_of_every_state() {
    let chains = [1.0, 10.0, 100.0, 1000.0, 1e4, 1e6, 1e9, 1e12].map(Case::chain);
    for case in chains.into_iter().chain((0..60).map(Case::random)) {
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let (expected, _) = run::<TwoParts, Integrator>(&case, 0.1 * tolerance);
            let (found, _) = run::<TwoParts, TwoRates<2, 2>>(&case, tolerance);
            let error = error(&found, &expected);
            assert!(error < RUN * tolerance, "{error:e} with {tolerance:e}: {case:?}");
        }
    }
}

#[test]
fn a_restored_model_and_one_that_ran_before_take_the_same_steps() {
    fn check<E: Equations, I: Integrate<E>>(case: &Case) {
        let once = run::<E, I>(case, 1e-6);
        let mut simulation = Simulation::default();
        let restored = run_from::<E, I>(&mut simulation, case, 1e-6, |simulation| {
            let saved = simulation.model.clone();
            // What comes after it is forgotten.
            simulation.clone().step(0.3).unwrap();
            simulation.model.clone_from(&saved);
        });
        assert_eq!(once.0, restored.0, "restored");
        assert_eq!(once, run_from::<E, I>(&mut simulation, case, 1e-6, |_| {}), "again");
    }
    for case in [Case::chain(10.0), Case::chain(1e6), Case::random(2)] {
        check::<TwoPartsWithoutCapabilities, Integrator>(&case);
        check::<KeptTwoPartsWithoutCapabilities, Integrator>(&case);
        check::<TwoPartsWithoutCapabilities, TwoRates<2, 2>>(&case);
    }
}
