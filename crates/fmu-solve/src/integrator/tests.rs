//! The integrator on systems with known solutions, and with patterns of their Jacobians.

mod chosen;
mod networks;

use super::work::LargestError;
use super::*;
use crate::number::{Dual, Number};
use crate::tape::{Recorded, Tape};

/// A system given by its derivatives over time and states.
#[derive(Clone, Copy)]
struct Given<const N: usize>(fn(Dual, [Dual; N]) -> [Dual; N]);

impl<const N: usize> Given<N> {
    /// The derivatives at a time and states, along a direction of both.
    fn along(self, time: Dual, states: &[f64], component: impl Fn(usize) -> f64) -> [Dual; N] {
        self.0(time, core::array::from_fn(|state| Dual::new(states[state], component(state))))
    }
}

impl<const N: usize> System for Given<N> {
    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
        derivatives.copy_from_slice(&self.along(time.into(), states, |_| 0.0).map(|rate| rate.value));
    }

    fn linearize(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) {
        let count = directions.count();
        for direction in 0..count {
            let rates = self.along(time.into(), states, |state| directions.component(direction, state));
            for (row, rate) in rates.into_iter().enumerate() {
                products[row * count + direction] = rate.derivative;
            }
        }
        by_time
            .copy_from_slice(&self.along(Dual::new(time, 1.0), states, |_| 0.0).map(|rate| rate.derivative));
    }
}

/// x' = x·cos t, y' = −y², from 1 at t = 1.
const NONLINEAR: Given<2> = Given(|time, [x, y]| [x * time.cos(), -(y * y)]);

fn exact(time: f64) -> [f64; 2] {
    [(time.sin() - 1.0_f64.sin()).exp(), time.recip()]
}

/// A system integrated by another method.
macro_rules! by {
    ($($name:ident: $method:ident),*) => {$(
        struct $name<S>(S);

        impl<S: System> System for $name<S> {
            const METHOD: &'static Method = &$method;
            const MAY_BE_SPARSE: bool = S::MAY_BE_SPARSE;

            fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
                self.0.derivatives(time, states, derivatives);
            }

            fn linearize(
                &mut self,
                time: f64,
                states: &[f64],
                directions: &impl Directions,
                products: &mut [f64],
                by_time: &mut [f64],
            ) {
                self.0.linearize(time, states, directions, products, by_time);
            }

            fn gradients(
                &mut self,
                time: f64,
                states: &[f64],
                rows: &[usize],
                take: impl FnMut(usize, &dyn Fn(usize) -> f64),
            ) {
                self.0.gradients(time, states, rows, take);
            }

            fn pattern(&mut self, time: f64, states: &[f64]) -> Pattern {
                self.0.pattern(time, states)
            }
        }
    )*};
}
by!(Kept: ROS34PW2, Explicit: DOP853, Automatic: AUTOMATIC);

/// The errors of one step from 1: at its end, the estimate there, and at its middle.
fn errors<S: System>(mut system: S, length: f64) -> [[f64; 2]; 3] {
    let mut integrator = Integrator::new(2);
    integrator.steps.next = length;
    let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
    integrator.step(&mut system, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
    let stages = &integrator.work.as_ref().unwrap().stages;
    let (count, weights) = if S::METHOD.is_explicit(false) {
        (explicit::END, explicit::FIFTH_ORDER)
    } else {
        (S::METHOD.stages.len(), S::METHOD.error)
    };
    let estimate = [0, 1].map(|state| {
        let last = stages[..count].iter().rev().zip(weights.iter().rev());
        last.map(|(stage, weight)| weight * stage[state]).sum::<f64>()
    });
    let mut error_at = |time: f64| {
        let mut states = [0.0; 2];
        integrator.states_at(&mut system, time, &mut states);
        [states[0] - exact(time)[0], states[1] - exact(time)[1]]
    };
    [error_at(1.0 + length), estimate, error_at(1.0 + 0.5 * length)]
}

#[test]
fn errors_fall_with_their_orders() {
    // The error of one step of a method of order p falls at least with the power p + 1: a wrong coefficient loses
    // a whole power. Half a power is for terms of higher order.
    fn check<S: System>(system: fn() -> S, length: f64, states: usize, powers: [f64; 3]) {
        let (long, short) = (errors(system(), length), errors(system(), 0.5 * length));
        for ((long, short), power) in long.into_iter().zip(short).zip(powers) {
            for (long, short) in long.iter().zip(short).take(states) {
                let found = (long / short).abs().log2();
                assert!(found > power - 0.5, "the error falls with the power {found}, not {power}");
            }
        }
    }
    check(|| NONLINEAR, 0.05, 2, [6.0, 5.0, 5.0]);
    check(|| Kept(NONLINEAR), 0.05, 2, [4.0, 3.0, 4.0]);
    // Steps that are short enough for the second state are as exact as numbers. The estimate is not yet multiplied by the
    // length.
    check(|| Explicit(NONLINEAR), 0.3, 1, [9.0, 5.0, 8.0]);
}

/// Another trial of the last step, of another length.
fn trial<S: System>(
    integrator: &mut Integrator,
    system: &mut S,
    length: f64,
    tolerance: &Tolerance<'_>,
) -> LargestError {
    let Integrator { last, work, jacobian, .. } = integrator;
    let last = last.as_mut().unwrap();
    last.length = length;
    work.as_mut().unwrap().trial(last, system, jacobian, tolerance)
}

/// Takes a step from t = 1 with an initial length and a distant end. Returns the number of trials.
fn step_from(integrator: &mut Integrator, length: f64, tolerance: &Tolerance<'_>) -> u32 {
    let mut trials = 0;
    integrator.steps.next = length;
    integrator.step(&mut { NONLINEAR }, (1.0, 1e4), &exact(1.0), tolerance, &mut trials).unwrap();
    trials
}

#[test]
fn the_next_step_just_meets_the_tolerance() {
    let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
    let mut integrator = Integrator::new(2);
    assert_eq!(step_from(&mut integrator, 0.03, &tolerance), 1);
    let proposed = integrator.steps.next;
    // Its error is the fifth power of the safety factor, up to terms of higher order.
    let error = trial(&mut integrator, &mut { NONLINEAR }, proposed, &tolerance).largest;
    assert!(error > 0.4 && error < 0.8, "{error}");
    // The error of a step half as long again is about 4 tolerances: it is rejected.
    assert_eq!(step_from(&mut integrator, 1.5 * proposed, &tolerance), 2);
}

#[test]
fn the_next_step_does_not_grow_at_once_after_a_rejection() {
    // x' = 1, until t = 1.
    let mut wall =
        Given(|time, [_]| [if time.value <= 1.0 { Dual::from(1.0) } else { Dual::from(f64::NAN) }]);
    let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0] };
    let mut integrator = Integrator::new(1);
    let mut trials = 0;
    integrator.steps.next = 2.0;
    integrator.step(&mut wall, (0.0, 1e4), &[0.0], &tolerance, &mut trials).unwrap();
    assert_eq!(trials, 2);
    // A fifth of 2, up to the division of the time to the end into equal steps.
    assert!((integrator.steps.next - 0.4).abs() < 1e-3, "{}", integrator.steps.next);
}

#[test]
fn lengths_that_are_far_off_take_few_trials() {
    let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
    let mut integrator = Integrator::new(2);
    // From 1e3 to about 0.05, by a fifth each time plus two.
    let trials = step_from(&mut integrator, 1e3, &tolerance);
    assert!(trials <= 9, "{trials} trials");
    // From 1e-9 to 1e-2, sixfold each time.
    let mut length = 1e-9;
    let mut steps = 0;
    while length < 1e-2 {
        step_from(&mut integrator, length, &tolerance);
        (length, steps) = (integrator.steps.next, steps + 1);
    }
    assert_eq!(steps, 9);
}

#[test]
fn the_error_of_the_dense_output_is_estimated() {
    fn check<S: System>(mut system: S, length: f64) {
        let mut integrator = Integrator::new(2);
        integrator.steps.next = length;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
        let span = Span { begin: 1.0, end: 1.0 + 0.1 * length, limit: 1.0 + length, rounding: 0.0 };
        let reached = integrator.step(&mut system, span, &exact(1.0), &tolerance, &mut 0).unwrap();
        assert_eq!(reached.to_bits(), span.end.to_bits());
        let mut largest = 0.0_f64;
        for part in 1..20 {
            let time = 1.0 + f64::from(part) / 20.0 * length;
            let mut states = [0.0; 2];
            integrator.states_at(&mut system, time, &mut states);
            for (state, exact) in states.iter().zip(exact(time)) {
                largest = largest.max((state - exact).abs() / (1.0 + state.abs()));
            }
        }
        let Integrator { last, work, .. } = &mut integrator;
        let last = last.as_ref().unwrap();
        let estimate = work.as_mut().unwrap().dense_error(last, &mut system, &tolerance).largest;
        // Neither too low, but for terms of higher order, nor so high that steps would be much shorter than the method's.
        assert!((0.5..10.0).contains(&(estimate / largest)), "{estimate:e} for {largest:e}, length {length}");
    }
    for length in [0.05, 0.1, 0.2, 0.4] {
        check(NONLINEAR, length);
        check(Kept(NONLINEAR), length);
    }
    for length in [0.2, 0.4, 0.8] {
        check(Explicit(NONLINEAR), length);
    }
}

/// The largest error of the dense output of the explicit method in one step from t = 0, and that of its slope at
/// [`explicit::RESIDUAL_AT`], times the step.
fn dense_errors<const N: usize>(given: Given<N>, length: f64, exact: fn(f64) -> [f64; N]) -> [f64; 2] {
    let (mut system, mut integrator) = (Explicit(given), Integrator::new(N));
    integrator.steps.next = length;
    let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; N] };
    integrator.step(&mut system, (0.0, length), &exact(0.0), &tolerance, &mut 0).unwrap();
    let mut states = [0.0; N];
    let mut largest = 0.0_f64;
    for part in 1..1000 {
        let time = f64::from(part) / 1000.0 * length;
        integrator.states_at(&mut system, time, &mut states);
        for (state, exact) in states.iter().zip(exact(time)) {
            largest = largest.max((state - exact).abs());
        }
    }
    let time = explicit::RESIDUAL_AT * length;
    integrator.states_at(&mut system, time, &mut states);
    let mut rates = [0.0; N];
    system.derivatives(time, &states, &mut rates);
    let last = integrator.last.as_ref().unwrap();
    let residuals = (0..N).map(|state| (rates[state] - last.slope(state, explicit::RESIDUAL_AT)).abs());
    [largest, length * residuals.fold(0.0, f64::max)]
}

#[test]
fn the_slope_of_the_explicit_dense_output_tells_its_error() {
    let decay = dense_errors(Given(|_, [x]| [-x]), 1.0, |time| [(-time).exp()]);
    let wave = dense_errors(Given(|_, [x, v]| [v, -x]), 1.0, |time| [time.cos(), -time.sin()]);
    let square = dense_errors(Given(|_, [x]| [-(x * x)]), 0.3, |time| [(1.0 + time).recip()]);
    for [largest, slope] in [decay, wave, square] {
        let found = slope / largest;
        // Terms of higher order are some percent.
        assert!((found / explicit::ERROR_SLOPE - 1.0).abs() < 0.05, "{found}");
    }
}

#[test]
fn the_explicit_method_is_stable_up_to_its_limit() {
    // One step of x' = -r·x from 1.
    let stepped = |rate: f64| {
        let mut stages: Vec<f64> = vec![];
        let sum = |weights: &[f64], stages: &[f64]| {
            1.0 + weights.iter().zip(stages).map(|(weight, stage)| weight * stage).sum::<f64>()
        };
        for weights in &explicit::STATES[..explicit::END] {
            stages.push(-rate * sum(weights, &stages));
        }
        sum(explicit::STATES[explicit::END], &stages)
    };
    let limit =
        (0..10_000).map(|step| 1e-3 * f64::from(step)).find(|&rate| stepped(rate).abs() > 1.0).unwrap();
    assert!((limit - 6.394).abs() < 1e-3 && limit > explicit::STABILITY, "{limit}");
}

#[test]
fn a_step_that_the_end_cuts_short_leaves_the_length_of_the_next() {
    let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
    let mut integrator = Integrator::new(2);
    integrator.steps.next = 0.1;
    let end = integrator.step(&mut { NONLINEAR }, (1.0, 1.001), &exact(1.0), &tolerance, &mut 0).unwrap();
    assert_eq!([end, integrator.steps.next].map(f64::to_bits), [1.001, 0.1].map(f64::to_bits));
}

#[test]
fn a_step_to_the_end_ends_there() {
    let (begin, end): (f64, f64) = (0.3, 0.9);
    assert_ne!((begin + (end - begin)).to_bits(), end.to_bits(), "rounding would end it elsewhere");
    let tolerance = Tolerance { relative: 1e6, nominals: &[1.0; 2] };
    let mut integrator = Integrator::new(2);
    integrator.steps.next = 10.0;
    let reached =
        integrator.step(&mut { NONLINEAR }, (begin, end), &exact(begin), &tolerance, &mut 0).unwrap();
    assert_eq!(reached.to_bits(), end.to_bits());
}

#[test]
fn the_error_is_relative_to_the_larger_of_both_ends_and_the_nominal_value() {
    let mut rising = Given(|time, [_, _]| [Dual::from(1000.0), time.cos()]);
    let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0, 0.25] };
    let mut integrator = Integrator::new(2);
    integrator.steps.next = 0.5;
    for (from, larger) in [(0.0, 0.5_f64.sin()), (2.0, 2.0 + 0.5_f64.sin()), (-2.0, 2.0)] {
        integrator.step(&mut rising, (0.0, 0.5), &[0.0, from], &tolerance, &mut 0).unwrap();
        let error = trial(&mut integrator, &mut rising, 0.5, &tolerance);
        let expected = integrator.work.as_ref().unwrap().stages[7][1].abs() / (1e-3 * (larger + 0.25));
        assert_eq!(error.state, 1);
        // The error of the step is far less than a thousandth.
        assert!((error.largest / expected - 1.0).abs() < 1e-3, "{} instead of {expected}", error.largest);
    }
}

#[test]
fn a_failure_names_the_state_without_a_linearization() {
    let mut broken = Given(|_, [_, y]| [Dual::from(1.0), y.mapped(1.0, f64::NAN)]);
    let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
    let result = Integrator::new(2).step(&mut broken, (0.0, 1.0), &[0.0; 2], &tolerance, &mut 0);
    assert_eq!(result, Err(StepFailure { time: 0.0, state: 1 }));
}

#[test]
fn within_a_step_the_error_is_less_than_at_its_end() {
    let length = 0.1;
    let mut integrator = Integrator::new(2);
    integrator.steps.next = length;
    let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
    integrator.step(&mut { NONLINEAR }, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
    for eighth in 1..8 {
        let time = 1.0 + f64::from(eighth) / 8.0 * length;
        let mut states = [0.0; 2];
        integrator.states_at(&mut { NONLINEAR }, time, &mut states);
        for (i, (state, exact)) in states.iter().zip(exact(time)).enumerate() {
            // The largest is a third.
            let error = ((state - exact) / integrator.work.as_ref().unwrap().stages[7][i]).abs();
            assert!(error < 0.5, "after {eighth} eighths, {error} of the error estimated for the end");
        }
    }
}

#[test]
fn a_mode_a_million_times_as_fast_as_the_step_is_damped() {
    let mut stiff = Given(|_, [x]| [x * -1e6]);
    let mut integrator = Integrator::new(1);
    integrator.steps.next = 1.0;
    let tolerance = Tolerance { relative: 1.0, nominals: &[1.0] };
    integrator.step(&mut stiff, (0.0, 1.0), &[1.0], &tolerance, &mut 0).unwrap();
    // An L-stable method with a few stages leaves a multiple of 1e-6; an explicit one would have 1e48.
    assert!(
        integrator.last.as_ref().unwrap().to[0].abs() < 1e-4,
        "{}",
        integrator.last.as_ref().unwrap().to[0]
    );
}

/// The derivatives of a system over any number type.
trait Rates {
    fn rates<T: Number>(&self, time: f64, states: &[T]) -> Vec<T>;
}

/// A system with the pattern of its Jacobian or without, which counts what is computed.
struct Counted<R, const PATTERN: bool> {
    rates: R,
    /// The Jacobians, patterns, derivatives with respect to time, right-hand sides, derivatives along directions, and rows
    /// of Jacobians that were computed.
    counts: [u32; 6],
}

impl<R: Rates, const PATTERN: bool> Counted<R, PATTERN> {
    fn new(rates: R) -> Self {
        Self { rates, counts: [0; 6] }
    }

    /// The states on an empty tape, and their derivatives.
    fn record<'t>(
        &self,
        time: f64,
        states: &[f64],
        tape: &'t Tape,
    ) -> (Vec<Recorded<'t>>, Vec<Recorded<'t>>) {
        let states: Vec<_> = states.iter().map(|&state| tape.variable(state)).collect();
        let rates = self.rates.rates(time, &states);
        (states, rates)
    }
}

impl<R: Rates, const PATTERN: bool> System for Counted<R, PATTERN> {
    const MAY_BE_SPARSE: bool = PATTERN;

    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
        self.counts[3] += 1;
        derivatives.copy_from_slice(&self.rates.rates(time, states));
    }

    fn linearize(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) {
        self.counts[2] += 1;
        by_time.fill(0.0);
        let count = directions.count();
        self.counts[0] += u32::from(count > 0);
        self.counts[4] += u32::try_from(count).unwrap();
        for direction in 0..count {
            let along = |(state, &value)| Dual::new(value, directions.component(direction, state));
            let rates = self.rates.rates(time, &states.iter().enumerate().map(along).collect::<Vec<_>>());
            for (row, rate) in rates.into_iter().enumerate() {
                products[row * count + direction] = rate.derivative;
            }
        }
    }

    fn pattern(&mut self, time: f64, states: &[f64]) -> Pattern {
        self.counts[1] += 1;
        let mut tape = Tape::new();
        tape.clear();
        let (_, rates) = self.record(time, states, &tape);
        tape.pattern(&rates)
    }

    fn gradients(
        &mut self,
        time: f64,
        states: &[f64],
        rows: &[usize],
        mut take: impl FnMut(usize, &dyn Fn(usize) -> f64),
    ) {
        let mut tape = Tape::new();
        tape.clear();
        let (states, rates) = self.record(time, states, &tape);
        self.counts[5] += u32::try_from(rows.len()).unwrap();
        for &row in rows {
            tape.differentiate(rates[row], states.len());
            take(row, &|column| tape.derivative(states[column]));
        }
    }
}

/// Conduction along a rod, whose conductivity falls with the temperature. From a time on, its ends are joined by what
/// conducts `joint` times as well.
#[derive(Clone, Copy)]
struct Conduction {
    joined_from: f64,
    joint: f64,
    /// With which gain the last state heats all cells, an integral of their mean.
    gain: f64,
}

type Rod<const PATTERN: bool> = Counted<Conduction, PATTERN>;

impl<const PATTERN: bool> Rod<PATTERN> {
    fn joined_from(joined_from: f64, joint: f64) -> Self {
        Self::new(Conduction { joined_from, joint, gain: 0.0 })
    }
}

impl Rates for Conduction {
    fn rates<T: Number>(&self, time: f64, states: &[T]) -> Vec<T> {
        let mut rates = vec![T::from(0.0); states.len()];
        let mut conducts = |one: usize, other: usize, times: f64| {
            let mean = (states[one] + states[other]) * 0.5;
            let flow = (states[one] - states[other]) * 400.0 * times / (mean * 0.1 + 1.0);
            rates[one] -= flow;
            rates[other] += flow;
        };
        for cell in 1..states.len() {
            conducts(cell - 1, cell, 1.0);
        }
        if time >= self.joined_from {
            conducts(0, states.len() - 1, self.joint);
        }
        if self.gain > 0.0 {
            let [cells @ .., integral] = states else { return rates };
            let mean = cells.iter().fold(T::from(0.0), |sum, &cell| sum + cell) / T::from(cells.len() as f64);
            for rate in &mut rates {
                *rate -= *integral * self.gain;
            }
            rates[cells.len()] = mean * self.gain;
        }
        rates
    }
}

const CELLS: usize = 60;

/// Steps along a rod to a time. Returns the states there.
fn conduct<S: System>(system: &mut S, integrator: &mut Integrator, from: f64, to: f64, states: &mut [f64]) {
    let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; CELLS] };
    let mut time = from;
    while time < to {
        time = integrator.step(system, (time, to), states, &tolerance, &mut 0).unwrap();
        integrator.states_at(system, time, states);
    }
}

fn warm_end() -> [f64; CELLS] {
    core::array::from_fn(|cell| (-0.01 * (cell * cell) as f64).exp())
}

/// Asserts that states differ by rounding: some thousand operations a step on numbers of order 1, in tens of steps.
fn assert_same(found: &[f64], expected: &[f64]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-10, "{found} instead of {expected}");
    }
}

#[test]
fn with_a_pattern_the_steps_are_those_without() {
    fn check<const KEPT: bool>() {
        let (mut sparse, mut dense) = (warm_end(), warm_end());
        let (mut patterned, mut full) =
            (Rod::<true>::joined_from(f64::MAX, 0.0), Rod::<false>::joined_from(f64::MAX, 0.0));
        let mut integrators = [Integrator::new(CELLS), Integrator::new(CELLS)];
        if KEPT {
            let (mut patterned, mut full) = (Kept(patterned), Kept(full));
            conduct(&mut patterned, &mut integrators[0], 0.0, 0.1, &mut sparse);
            conduct(&mut full, &mut integrators[1], 0.0, 0.1, &mut dense);
            assert_eq!(patterned.0.counts[1], 1);
            // One Jacobian for several steps.
            let [jacobians, _, steps, ..] = full.0.counts;
            assert!(jacobians * 4 < steps, "{jacobians} Jacobians in {steps} steps");
        } else {
            conduct(&mut patterned, &mut integrators[0], 0.0, 0.1, &mut sparse);
            conduct(&mut full, &mut integrators[1], 0.0, 0.1, &mut dense);
            assert_eq!([patterned.counts[0], patterned.counts[1]], [full.counts[0], 1]);
        }
        assert_same(&sparse, &dense);
    }
    check::<false>();
    check::<true>();
}

#[test]
fn an_element_that_a_branch_adds_is_noticed() {
    for joint in [1.0, 1e-6] {
        let (mut sparse, mut dense) = (warm_end(), warm_end());
        let (mut patterned, mut full) =
            (Rod::<true>::joined_from(0.1, joint), Rod::<false>::joined_from(0.1, joint));
        let mut integrators = [Integrator::new(CELLS), Integrator::new(CELLS)];
        for (from, to) in [(0.0, 0.1), (0.1, 0.2)] {
            conduct(&mut patterned, &mut integrators[0], from, to, &mut sparse);
            conduct(&mut full, &mut integrators[1], from, to, &mut dense);
        }
        assert_eq!(patterned.counts[1], 2, "the pattern is found again, once");
        // The Jacobian with the pattern serves several steps, of some hundred: within a hundred tolerances.
        for (sparse, dense) in sparse.iter().zip(dense) {
            assert!((sparse - dense).abs() < 1e-4, "{sparse} instead of {dense}");
        }
    }
}

#[test]
fn a_row_with_all_columns_is_as_exact_as_the_others() {
    let (mut sparse, mut dense) = (warm_end(), warm_end());
    let controlled = Conduction { joined_from: f64::MAX, joint: 0.0, gain: 20.0 };
    let (mut patterned, mut full) = (Rod::<true>::new(controlled), Rod::<false>::new(controlled));
    conduct(&mut patterned, &mut Integrator::new(CELLS), 0.0, 1.0, &mut sparse);
    conduct(&mut full, &mut Integrator::new(CELLS), 0.0, 1.0, &mut dense);
    assert_eq!(
        patterned.counts,
        [full.counts[0], 1, full.counts[2], full.counts[3], patterned.counts[4], patterned.counts[5]],
        "the steps are the same"
    );
    assert_same(&sparse, &dense);
}

/// States that decay and drive each other, all by all.
#[derive(Clone, Copy)]
struct Crowd {
    /// Whether the states' squares are computed once, before the rows that all need them.
    shares: bool,
}

impl Rates for Crowd {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let once: Vec<_> = if self.shares { states.iter().map(|&x| x * x).collect() } else { vec![] };
        let square = |state: usize| once.get(state).copied().unwrap_or_else(|| states[state] * states[state]);
        let rate = |row: usize| {
            let driven = (0..states.len()).map(|column| square(column) / (1 + row.abs_diff(column)) as f64);
            driven.sum::<T>() - states[row] * (row * row) as f64
        };
        (0..states.len()).map(rate).collect()
    }
}

#[test]
fn a_full_jacobian_is_computed_by_rows_where_these_cost_less() {
    for shares in [false, true] {
        let (mut by_rows, mut by_columns) = (warm_end(), warm_end());
        let (mut patterned, mut full) =
            (Counted::<_, true>::new(Crowd { shares }), Counted::<_, false>::new(Crowd { shares }));
        conduct(&mut patterned, &mut Integrator::new(CELLS), 0.0, 0.1, &mut by_rows);
        conduct(&mut full, &mut Integrator::new(CELLS), 0.0, 0.1, &mut by_columns);
        assert_same(&by_rows, &by_columns);
        assert!(full.counts[0] > 0 && patterned.counts[2] == full.counts[2], "the Jacobians are as many");
        assert_eq!(patterned.counts[4], if shares { full.counts[4] } else { 0 }, "directions");
    }
}

#[test]
fn a_jacobian_serves_steps_with_little_error() {
    let (mut states, mut integrator) = (warm_end(), Integrator::new(CELLS));
    let (mut exact, mut every) = (warm_end(), Integrator::new(CELLS));
    let (mut rod, mut full) =
        (Rod::<true>::joined_from(f64::MAX, 0.0), Rod::<false>::joined_from(f64::MAX, 0.0));
    for step in 0..100 {
        let (from, to) = (1e-5 * f64::from(step), 1e-5 * f64::from(step + 1));
        conduct(&mut rod, &mut integrator, from, to, &mut states);
        conduct(&mut full, &mut every, from, to, &mut exact);
    }
    let [jacobians, _, steps, ..] = rod.counts;
    assert!(steps >= 100 && jacobians * 10 <= steps, "{jacobians} Jacobians in {steps} steps");
    for (found, exact) in states.iter().zip(exact) {
        // Of a hundred steps with an error below a hundredth of the tolerance.
        assert!((found - exact).abs() < 1e-6, "{found} instead of {exact}");
    }
}

#[test]
fn a_copy_and_a_serialized_state_go_on_to_the_same_bits() {
    fn check<S: System>(new: fn() -> S) {
        let (mut states, mut integrator) = (warm_end(), Integrator::new(CELLS));
        // The Jacobian has served a few steps.
        conduct(&mut new(), &mut integrator, 0.0, 0.01, &mut states);
        let mut archive = Archive::writing();
        integrator.persist(&mut archive).unwrap();
        let mut read = Integrator::new(CELLS);
        read.persist(&mut Archive::reading(&archive.into_bytes())).unwrap();
        // What another run left is not used.
        let mut other = Integrator::new(CELLS);
        conduct(&mut new(), &mut other, 0.0, 0.5, &mut warm_end());
        other.clone_from(&integrator);
        let ends = [integrator.clone(), integrator, read, other].map(|mut integrator| {
            let mut states = states;
            conduct(&mut new(), &mut integrator, 0.01, 0.3, &mut states);
            states.map(f64::to_bits)
        });
        for (which, end) in ends.iter().enumerate() {
            assert_eq!(*end, ends[0], "end {which}");
        }
    }
    check(|| Rod::<true>::joined_from(0.005, 1.0));
    check(|| Kept(Rod::<true>::joined_from(0.005, 1.0)));
    check(|| Kept(Rod::<false>::joined_from(0.005, 1.0)));
}

#[test]
fn a_serialized_jacobian_of_another_model_is_refused() {
    let mut states = warm_end();
    let mut integrator = Integrator::new(CELLS);
    conduct(&mut Kept(Rod::<true>::joined_from(1.0, 1.0)), &mut integrator, 0.0, 0.01, &mut states);
    let mut archive = Archive::writing();
    integrator.persist(&mut archive).unwrap();
    let bytes = archive.into_bytes();
    assert!(Integrator::new(CELLS).persist(&mut Archive::reading(&bytes)).is_ok());
    let error = Integrator::new(CELLS + 1).persist(&mut Archive::reading(&bytes)).unwrap_err();
    assert_eq!(error.to_string(), "the Jacobian in the serialized state is not one of this model");
}

/// Seven stars in a plane, whose masses are 1 to 7 (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I,
/// section II.10): their x and y, and their velocities.
#[derive(Clone, Copy)]
struct Pleiades;

impl Rates for Pleiades {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let mut rates = states[14..].to_vec();
        rates.resize(28, T::from(0.0));
        for one in 0..7 {
            for other in (0..7).filter(|&other| other != one) {
                let [x, y] = [0, 7].map(|axis| states[axis + other] - states[axis + one]);
                let square = x * x + y * y;
                let pull = T::from((other + 1) as f64) / (square * square.sqrt());
                rates[14 + one] += pull * x;
                rates[21 + one] += pull * y;
            }
        }
        rates
    }
}

/// The initial positions and velocities of the seven stars.
const STARS: [f64; 28] = [
    3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0, 3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.75,
    -1.5, 0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0,
];

/// The right-hand sides and Jacobians of seven stars on their way to 3 s, in a number of steps.
fn follow_stars<const PATTERN: bool>(steps: u32, tolerance: f64) -> [u32; 2] {
    let tolerance = Tolerance { relative: tolerance, nominals: &[1.0; 28] };
    let mut system = Counted::<Pleiades, PATTERN>::new(Pleiades);
    let mut integrator = Integrator::new(28);
    let mut states = STARS;
    let ends = (0..=steps).map(|number| 3.0 * f64::from(number) / f64::from(steps));
    for (mut time, end) in ends.clone().zip(ends.skip(1)) {
        while time < end {
            time = integrator.step(&mut system, (time, end), &states, &tolerance, &mut 0).unwrap();
            integrator.states_at(&mut system, time, &mut states);
        }
    }
    [system.counts[3], system.counts[0]]
}

#[test]
fn a_jacobian_that_serves_costs_no_right_hand_sides() {
    for steps in [10, 1000] {
        for tolerance in [1e-4, 1e-6, 1e-8] {
            // Without a pattern each step has its own.
            let [every, _] = follow_stars::<false>(steps, tolerance);
            let [found, jacobians] = follow_stars::<true>(steps, tolerance);
            // A rejected trial in twenty steps, and steps that are a little shorter for it.
            assert!(f64::from(found) <= 1.1 * f64::from(every), "{found} instead of {every}");
            // A step takes eight.
            assert!(tolerance < 1e-4 || steps == 10 || jacobians * 3 * 8 < found, "{jacobians} Jacobians");
        }
    }
}

/// A body between Earth and Moon (Arenstorf; Hairer, Nørsett and Wanner, section II.0).
#[derive(Clone, Copy)]
struct Arenstorf;

impl Rates for Arenstorf {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let (moon, earth) = (0.012_277_471, 1.0 - 0.012_277_471);
        let [x, y, u, v] = [0, 1, 2, 3].map(|state| states[state]);
        let pull = |mass: f64, x: T| {
            let square = x * x + y * y;
            T::from(mass) / (square * square.sqrt())
        };
        let (to_earth, to_moon) = (x + moon, x - earth);
        let (by_earth, by_moon) = (pull(earth, to_earth), pull(moon, to_moon));
        vec![
            u,
            v,
            x + v * 2.0 - by_earth * to_earth - by_moon * to_moon,
            y - u * 2.0 - y * (by_earth + by_moon),
        ]
    }
}

/// Lorenz' chaotic system (section I.16).
#[derive(Clone, Copy)]
struct Lorenz;

impl Rates for Lorenz {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let [x, y, z] = [0, 1, 2].map(|state| states[state]);
        vec![(y - x) * 10.0, x * (T::from(28.0) - z) - y, x * y - z * (8.0 / 3.0)]
    }
}

/// Van der Pol's oscillator.
#[derive(Clone, Copy)]
struct VanDerPol(f64);

impl Rates for VanDerPol {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let [x, v] = [0, 1].map(|state| states[state]);
        vec![v, (T::from(1.0) - x * x) * v * self.0 - x]
    }
}

/// Integrates to an end in one step.
fn solve<S: System>(mut system: S, start: &[f64], end: f64, relative: f64) -> (Vec<f64>, S, Integrator) {
    let (nominals, mut integrator) = (vec![1.0; start.len()], Integrator::new(start.len()));
    let (mut states, mut time) = (start.to_vec(), 0.0);
    while time < end {
        let tolerance = Tolerance { relative, nominals: &nominals };
        time = integrator.step(&mut system, (time, end), &states, &tolerance, &mut 0).unwrap();
        integrator.states_at(&mut system, time, &mut states);
    }
    (states, system, integrator)
}

fn largest_error(found: &[f64], exact: &[f64]) -> f64 {
    found.iter().zip(exact).map(|(x, exact)| (x - exact).abs() / (1.0 + exact.abs())).fold(0.0, f64::max)
}

// What SciPy 1.17.1 ends at with DOP853 at the tolerance 1e-13, and its errors and right-hand sides at 1e-4 to 1e-10,
// printed by `nonstiff.py` in the folder `tests`.
const PLEIADES: ([f64; 28], [(f64, u32); 4]) = (
    [
        0.370_613_914_383_404_63,
        3.237_284_092_057_588,
        -3.222_559_032_420_952_5,
        0.659_709_145_578_976_8,
        0.342_558_170_716_970_9,
        1.562_172_101_400_945_5,
        -0.700_309_292_220_312,
        -3.943_437_585_519_647_7,
        -3.271_380_973_972_124,
        5.225_081_843_446_938,
        -2.590_612_434_977_918_3,
        1.198_213_693_395_577,
        -0.242_968_234_493_851_96,
        1.091_449_240_431_423_8,
        3.417_003_806_286_931_7,
        1.354_584_501_625_950_1,
        -2.590_065_597_809_687,
        2.025_053_734_719_757_7,
        -1.155_815_100_158_762_9,
        -0.807_298_817_020_956_4,
        0.595_239_635_418_675_2,
        -3.741_244_961_247_941_3,
        0.377_345_968_575_504_9,
        0.938_685_886_946_783_9,
        0.366_792_222_721_638_53,
        -0.347_404_635_376_497_46,
        2.344_915_448_180_536_5,
        -1.947_020_434_261_529,
    ],
    [(6.66e-3, 842), (3.83e-5, 1358), (8.71e-7, 2222), (1.88e-8, 3590)],
);
const ARENSTORF: ([f64; 4], [(f64, u32); 4]) = (
    [
        0.993_999_999_998_141,
        -3.085_273_600_185_803_3e-12,
        -5.174_340_088_343_055e-10,
        -2.001_585_106_668_373_6,
    ],
    [(2.16e-2, 674), (6.91e-3, 1070), (8.43e-5, 1778), (1.28e-6, 2870)],
);
const LORENZ: ([f64; 3], [(f64, u32); 4]) = (
    [-4.902_687_541_136_66, -3.743_872_921_803_473_6, 24.690_858_102_794_65],
    [(1.59e-2, 1058), (8.84e-5, 1742), (2.25e-7, 2978), (1.07e-9, 4706)],
);
const ARENSTORF_START: [f64; 4] = [0.994, 0.0, 0.0, -2.001_585_106_379_082_5];
const ARENSTORF_END: f64 = 17.065_216_560_157_964;

/// The methods' right-hand sides, of numbers and dual numbers.
fn work(counts: [u32; 6]) -> f64 {
    f64::from(counts[3] + counts[4])
}

#[test]
fn nonstiff_systems_take_about_as_many_right_hand_sides_as_in_scipy() {
    fn check<R: Rates + Copy>(rates: R, start: &[f64], end: f64, exact: &[f64], others: [(f64, u32); 4]) {
        let mut compared = 0;
        for tolerance in [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10] {
            let (found, Automatic(system), _) =
                solve(Automatic(Counted::<R, false>::new(rates)), start, end, tolerance);
            let error = largest_error(&found, exact);
            if !(1e-9..=1e-3).contains(&error) {
                continue;
            }
            compared += 1;
            // The others' evaluations at this error, by powers between and beyond the two that are nearest.
            let at = others[1..3].iter().take_while(|(other, _)| *other > error).count();
            let [(most, few), (least, many)] = [others[at], others[at + 1]];
            let (few, many) = (f64::from(few), f64::from(many));
            let others = few * (many / few).powf((error / most).ln() / (least / most).ln());
            // One more in each step detects stiffness; the largest error counts instead of the mean.
            assert!(
                work(system.counts) <= 1.6 * others,
                "{} instead of {others} at {error:e}",
                work(system.counts)
            );
        }
        assert!(compared > 2, "{compared} errors to compare");
    }
    check(Pleiades, &STARS, 3.0, &PLEIADES.0, PLEIADES.1);
    check(Arenstorf, &ARENSTORF_START, ARENSTORF_END, &ARENSTORF.0, ARENSTORF.1);
    check(Lorenz, &[1.0; 3], 10.0, &LORENZ.0, LORENZ.1);
}

#[test]
fn stiff_systems_are_found() {
    // Fast and slow phases by turns; the fast eigenvalue is up to 3·μ.
    for (mu, end) in [(30.0, 100.0), (1000.0, 2000.0)] {
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let start = [2.0, 0.0];
            let (exact, ..) = solve(Counted::<_, false>::new(VanDerPol(mu)), &start, end, 1e-11);
            let (by_one, one, _) = solve(Counted::<_, false>::new(VanDerPol(mu)), &start, end, tolerance);
            let (found, Automatic(system), integrator) =
                solve(Automatic(Counted::<_, false>::new(VanDerPol(mu))), &start, end, tolerance);
            assert!(integrator.switch.is_implicit || mu < 1000.0, "μ = {mu} at {tolerance:e}");
            let (work, by_one_work) = (work(system.counts), work(one.counts));
            assert!(work <= 1.3 * by_one_work, "{work} instead of {by_one_work}, μ = {mu} at {tolerance:e}");
            // The phase's error is that of all steps.
            let (error, by_one) = (largest_error(&found, &exact), largest_error(&by_one, &exact));
            assert!(error <= 3.0 * by_one, "{error:e} instead of {by_one:e}, μ = {mu} at {tolerance:e}");
        }
    }
}

/// Conduction in a square, whose factors fill in.
#[derive(Clone, Copy)]
struct Plate(f64);

impl Plate {
    const EDGE: usize = 30;
}

impl Rates for Plate {
    fn rates<T: Number>(&self, _time: f64, states: &[T]) -> Vec<T> {
        let mut rates = vec![T::from(0.0); states.len()];
        for cell in 0..states.len() {
            let is_at_end = [(cell + 1).is_multiple_of(Self::EDGE), cell + Self::EDGE >= states.len()];
            for (stride, is_at_end) in [1, Self::EDGE].into_iter().zip(is_at_end) {
                if !is_at_end {
                    let flow = (states[cell] - states[cell + stride]) * self.0;
                    rates[cell] -= flow;
                    rates[cell + stride] += flow;
                }
            }
        }
        rates
    }
}

#[test]
fn linear_equations_are_solved_where_steps_become_as_much_longer_as_they_cost() {
    let start: Vec<_> = (0..Plate::EDGE.pow(2)).map(|cell| 1.0 + (0.01 * cell as f64).sin()).collect();
    let solved = |speed: f64| {
        let plate = Automatic(Counted::<_, true>::new(Plate(speed)));
        let (_, Automatic(system), integrator) = solve(plate, &start, 1.0, 1e-9);
        let [jacobians, _, _, rates, ..] = system.counts;
        (integrator.switch, jacobians, rates)
    };
    // The eigenvalues reach eight times the speed. Explicit steps are a few times shorter here, …
    let (switch, jacobians, rates) = solved(20.0);
    assert!(!switch.is_implicit, "{switch:?}");
    assert!(5 * jacobians < rates / 13, "{jacobians} Jacobians beside {rates} right-hand sides");
    // … and a thousand times here.
    let (switch, jacobians, rates) = solved(1e5);
    assert!(switch.is_implicit, "{switch:?} {jacobians} {rates}");
}

/// A system whose times count from another zero.
struct Late<S>(S, f64);

impl<S: System> System for Late<S> {
    const METHOD: &'static Method = S::METHOD;

    fn zero(&self) -> f64 {
        self.1
    }

    fn count_from(&mut self, zero: f64) {
        self.1 = zero;
    }

    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
        self.0.derivatives(self.1 + time, states, derivatives);
    }

    fn linearize(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    ) {
        self.0.linearize(self.1 + time, states, directions, products, by_time);
    }
}

#[test]
fn a_step_beyond_the_present_time_is_the_same_after_a_restart_that_counts_from_another_zero() {
    fn check<S: System>(system: fn() -> S) {
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
        let mut ends = [false, true].map(|restores| {
            let (mut system, mut integrator) = (Late(system(), 1.0), Integrator::new(2));
            let (mut states, mut found) = (exact(1.0), vec![]);
            // Of which double precision has no exact multiples.
            let size = 0.007;
            for _ in 0..200 {
                let span = Span { begin: 0.0, end: size, limit: 1.0, rounding: 0.0 };
                let mut reached = 0.0;
                while reached < size {
                    let span = Span { begin: reached, ..span };
                    reached = integrator.step(&mut system, span, &states, &tolerance, &mut 0).unwrap();
                    integrator.states_at(&mut system, reached, &mut states);
                }
                let rates = |rates: &mut [f64]| system.derivatives(size, &states, rates);
                assert!(integrator.agrees::<S>(size, &tolerance, rates), "{states:?}");
                if integrator.is_ahead {
                    // The differences that were compared.
                    found.extend(integrator.work.as_ref().unwrap().moved.iter().map(|x| x.to_bits()));
                }
                integrator.shift(size);
                system.1 += size;
                if restores {
                    let mut archive = Archive::writing();
                    integrator.clone().persist(&mut archive).unwrap();
                    let bytes = archive.into_bytes();
                    // The Jacobian, the step and ten numbers.
                    let most = 8 * (2 * 2 + 5 * 2 + 10 + 10);
                    assert!(bytes.len() <= most, "{} bytes", bytes.len());
                    integrator = Integrator::new(2);
                    integrator.persist(&mut Archive::reading(&bytes)).unwrap();
                }
                found.extend(states.map(f64::to_bits));
            }
            found
        });
        let restored = ends[1].split_off(0);
        assert_eq!(ends[0], restored);
    }
    check(|| NONLINEAR);
    check(|| Kept(NONLINEAR));
    check(|| Explicit(NONLINEAR));
    check(|| Automatic(NONLINEAR));
}

#[test]
fn a_damaged_step_of_the_explicit_method_is_refused() {
    let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
    let mut integrator = Integrator::new(2);
    let span = Span { begin: 1.0, end: 1.001, limit: 10.0, rounding: 0.0 };
    let mut states = exact(1.0);
    while !integrator.is_ahead {
        integrator.step(&mut Explicit(NONLINEAR), span, &states, &tolerance, &mut 0).unwrap();
    }
    integrator.states_at(&mut Explicit(NONLINEAR), 1.001, &mut states);
    for damage in [
        |last: &mut LastStep| last.begun = f64::NAN,
        |last: &mut LastStep| last.zero = f64::INFINITY,
        |last: &mut LastStep| last.from = vec![1.0],
        |last: &mut LastStep| last.is_explicit = false,
    ] {
        let mut damaged = integrator.clone();
        damage(damaged.last.as_mut().unwrap());
        let mut archive = Archive::writing();
        let _ = damaged.persist(&mut archive);
        let mut bytes = archive.into_bytes();
        bytes.resize(1000, 0);
        assert!(Integrator::new(2).persist(&mut Archive::reading(&bytes)).is_err());
    }
}
