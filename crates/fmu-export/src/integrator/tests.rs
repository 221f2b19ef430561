//! The integrator on systems with known solutions, and with patterns of their Jacobians.

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

/// The same by `ROS34PW2`.
struct Kept<S>(S);

impl<S: System> System for Kept<S> {
    const METHOD: &'static Method = &ROS34PW2;
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

/// The errors of one step from 1: at its end, the estimate there, and at its middle.
fn errors<S: System>(mut system: S, length: f64) -> [[f64; 2]; 3] {
    let mut integrator = Integrator::new(2);
    integrator.steps.next = length;
    let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
    integrator.step(&mut system, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
    let stages = &integrator.work.as_ref().unwrap().stages;
    let estimate = [0, 1].map(|state| {
        let last = stages[..S::METHOD.stages.len()].iter().rev().zip(S::METHOD.error.iter().rev());
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
    fn check<S: System>(system: fn() -> S, powers: [f64; 3]) {
        let (long, short) = (errors(system(), 0.05), errors(system(), 0.025));
        for ((long, short), power) in long.into_iter().zip(short).zip(powers) {
            for (long, short) in long.iter().zip(short) {
                let found = (long / short).abs().log2();
                assert!(found > power - 0.5, "the error falls with the power {found}, not {power}");
            }
        }
    }
    check(|| NONLINEAR, [6.0, 5.0, 5.0]);
    check(|| Kept(NONLINEAR), [4.0, 3.0, 4.0]);
}

/// Another trial of the last step, of another length.
fn trial<S: System>(
    integrator: &mut Integrator,
    system: &mut S,
    length: f64,
    tolerance: &Tolerance<'_>,
) -> LargestError {
    let Integrator { last, work, jacobian, .. } = integrator;
    work.as_mut().unwrap().trial(last.as_mut().unwrap(), system, jacobian, length, tolerance)
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

/// Such a system with the pattern of its Jacobian or without, which counts.
struct Counted<R, const PATTERN: bool> {
    rates: R,
    /// The Jacobians, patterns, derivatives with respect to time and right-hand sides that were computed.
    counts: [u32; 4],
}

impl<R: Rates, const PATTERN: bool> Counted<R, PATTERN> {
    fn new(rates: R) -> Self {
        Self { rates, counts: [0; 4] }
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
        let (mut tape, mut reached) = (Tape::new(), vec![]);
        tape.clear();
        let (_, rates) = self.record(time, states, &tape);
        Pattern::of_rows(states.len(), |row, columns| {
            tape.add_dependencies(rates[row], row, states.len(), &mut reached, columns);
        })
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
        for &row in rows {
            tape.differentiate(rates[row]);
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
            let [jacobians, _, steps, _] = full.0.counts;
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
        [full.counts[0], 1, full.counts[2], full.counts[3]],
        "the steps are the same"
    );
    assert_same(&sparse, &dense);
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
    let [jacobians, _, steps, _] = rod.counts;
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

/// The right-hand sides and Jacobians of seven stars on their way to 3 s, in a number of steps.
fn follow_stars<const PATTERN: bool>(steps: u32, tolerance: f64) -> [u32; 2] {
    let tolerance = Tolerance { relative: tolerance, nominals: &[1.0; 28] };
    let mut system = Counted::<Pleiades, PATTERN>::new(Pleiades);
    let mut integrator = Integrator::new(28);
    let mut states = [
        [3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0],
        [3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.75, -1.5],
        [0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0],
    ]
    .concat();
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
