//! What half and twice of the integrator's [chosen](crate::chosen) constants cost.

use core::array;
use core::cell::Cell;
use std::time::Instant;

use super::networks::{Network, Random, Reaction, of_equations};
use super::*;
use crate::chosen::experiment::{Outcome, compare};

const TOLERANCE: f64 = 1e-6;
/// The tolerance of the solutions beside which errors are taken. Less error is as good as none.
const EXACT: f64 = 1e-9;

/// A run is given up at so many times the cost of what was chosen.
const MOST: f64 = 10.0;

/// A problem, solved beforehand.
type Problem = Box<dyn Fn() -> Outcome>;

fn solved(problems: &[Problem]) -> Vec<Outcome> {
    problems.iter().map(|problem| problem()).collect()
}

/// Integrates to an end in communication steps, beyond which steps may go, unless it costs too much. Returns the states
/// there.
fn run<S: System>(
    system: &mut S,
    integrator: &mut Integrator,
    start: &[f64],
    (end, steps): (f64, u32),
    relative: f64,
    costs_too_much: impl Fn(&S, &Integrator) -> bool,
) -> Vec<f64> {
    let nominals = vec![1.0; start.len()];
    let tolerance = Tolerance { relative, nominals: &nominals };
    let (mut states, mut rates) = (start.to_vec(), vec![0.0; start.len()]);
    for step in 0..steps {
        let [mut time, target] = [step, step + 1].map(|step| end * f64::from(step) / f64::from(steps));
        while time < target {
            let span = Span { begin: time, end: target, limit: end, rounding: 1e-12 * end };
            time = integrator.step(system, span, &states, &tolerance, &mut 0).unwrap();
            integrator.states_at(system, time, &mut states);
            if costs_too_much(system, integrator) {
                return states;
            }
        }
        system.derivatives(target, &states, &mut rates);
        if !integrator.agrees::<S>(target, &tolerance, |taken| taken.copy_from_slice(&rates)) {
            integrator.forget_ahead();
        }
    }
    states
}

/// A run by a method, whose cost is its operations.
fn problem<R: Rates + Clone + 'static, S: System + 'static>(
    rates: R,
    by: fn(Counted<R, true>) -> S,
    counts: fn(&S) -> [u32; 6],
    start: Vec<f64>,
    to: (f64, u32),
) -> Problem {
    let size = start.len();
    let mut counted = Counted::<R, true>::new(rates.clone());
    let exact = run(&mut counted, &mut Integrator::new(size), &start, (to.0, 1), EXACT, |_, _| false);
    let pattern = counted.pattern(0.0, &start);
    let [of_factors, of_solution] = of_equations(&pattern, size);
    let operations = pattern.operations() as f64;
    let cost = move |system: &S, integrator: &Integrator| {
        let [_, _, _, evaluations, directions, rows] = counts(system).map(f64::from);
        let [factors, solutions] = integrator.work.as_ref().unwrap().matrix.counts.map(f64::from);
        let of_rates = operations * (evaluations + 2.0 * directions + 4.0 * rows);
        of_rates + of_factors * factors + of_solution * solutions
    };
    let most = Cell::new(f64::INFINITY);
    Box::new(move || {
        let (mut system, mut integrator) = (by(Counted::new(rates.clone())), Integrator::new(size));
        let costs_too_much = |system: &S, integrator: &Integrator| cost(system, integrator) > most.get();
        let found = run(&mut system, &mut integrator, &start, to, TOLERANCE, costs_too_much);
        let cost = cost(&system, &integrator);
        most.set(most.get().min(MOST * cost));
        Outcome { cost, error: largest_error(&found, &exact).max(EXACT) }
    })
}

/// Problems of few and many states, stiff and not, in few communication steps and many.
fn problems() -> Vec<Problem> {
    fn automatic<R: Rates + Clone + 'static>(rates: R, start: Vec<f64>, to: (f64, u32)) -> Problem {
        problem(rates, Automatic, |Automatic(system)| system.counts, start, to)
    }
    let mut random = Random(7);
    let mut problems = vec![];
    for steps in [10, 200] {
        problems.push(automatic(Pleiades, STARS.to_vec(), (3.0, steps)));
        problems.push(automatic(Lorenz, vec![1.0; 3], (10.0, steps)));
        problems.push(automatic(VanDerPol(30.0), vec![2.0, 0.0], (100.0, steps)));
        problems.push(automatic(VanDerPol(1000.0), vec![2.0, 0.0], (2000.0, steps)));
        problems.push(automatic(Crowd { shares: false }, warm_end().to_vec(), (0.1, steps)));
        let controlled = Conduction { joined_from: f64::MAX, joint: 0.0, gain: 20.0 };
        problems.push(automatic(controlled, warm_end().to_vec(), (1.0, steps)));
        for (size, links, stiffness) in [(7, 3, 1e3), (12, 3, 1e6), (18, 4, 1e4), (40, 3, 1e5), (70, 6, 1e3)]
        {
            let network = Network::new(size, links, stiffness, &mut random);
            let (start, end) = (network.start(&mut random), 10.0 * network.slowest());
            problems.push(automatic(network.clone(), start.clone(), (end, steps)));
            let kept = |Kept(system): &Kept<Counted<_, true>>| system.counts;
            problems.push(problem(network, Kept, kept, start, (end, steps)));
        }
        let reaction = Reaction::new(6, 100.0, 1e3, &mut random);
        let start = (0..72).map(|_| 2.0 * random.number() - 1.0).collect();
        problems.push(automatic(reaction, start, (10.0, steps)));
    }
    problems
}

#[test]
#[ignore = "an experiment that prints a table"]
fn neither_half_nor_twice_of_a_chosen_constant_of_the_integrator_is_better() {
    let problems = problems();
    let names = [
        "DIRECTION",
        "FEW",
        "GRADIENT",
        "GROWTH",
        "INDEXED",
        "MARGIN",
        "MOST_SAVING",
        "NONSTIFF",
        "RECORDING",
        "SETTLING",
        "SIMILAR",
        "SMALL_ERROR",
        "STIFF",
        "TO_EXPLICIT",
        "TO_IMPLICIT",
    ];
    compare(&names, || solved(&problems));
}

/// Two fast states, the first stiff, that drive two slow ones, with an input that jumps and a wave.
#[derive(Clone, Copy)]
struct Halves {
    input: f64,
    stiffness: f64,
    turn: f64,
    slowness: f64,
    wave: f64,
}

impl Rates for Halves {
    fn rates<T: Number>(&self, time: f64, states: &[T]) -> Vec<T> {
        let [x, w, p, q] = [0, 1, 2, 3].map(|state| states[state]);
        let wave = self.wave * (3.0 * time).sin();
        vec![
            (w.sin() * 0.5 - x + (self.input + wave)) * self.stiffness,
            (x - w * w * w) * self.turn,
            (x - p * p * p * 0.1 - p) * self.slowness,
            (p * w - q + wave) * (0.3 * self.slowness),
        ]
    }
}

/// The halves with the derivatives of the last evaluation, and the evaluations of each.
struct Evaluated {
    halves: Halves,
    /// The time that times count from.
    zero: f64,
    rates: Vec<f64>,
    evaluations: u32,
}

impl System for Evaluated {
    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
        self.rates = self.halves.rates(self.zero + time, states);
        derivatives.copy_from_slice(&self.rates);
    }

    fn linearize(&mut self, _: f64, _: &[f64], _: &impl Directions, _: &mut [f64], _: &mut [f64]) {
        unreachable!("the halves are not coupled");
    }
}

impl TwoParts for Evaluated {
    fn part_derivatives(
        &mut self,
        part: Part,
        time: f64,
        states: impl Fn(usize) -> f64,
        mut derivatives: impl FnMut(usize, f64),
    ) {
        self.evaluations += 1;
        let states: [f64; 4] = array::from_fn(states);
        let rates = self.halves.rates(self.zero + time, &states);
        let part = if part == Part::Fast { 0..2 } else { 2..4 };
        part.for_each(|state| derivatives(state, rates[state]));
    }

    fn present_derivatives(&self, mut derivatives: impl FnMut(usize, f64)) {
        self.rates.iter().enumerate().for_each(|(state, &rate)| derivatives(state, rate));
    }

    fn drives(_: usize, _: core::ops::Range<usize>) -> bool {
        true
    }

    fn is_coupled(&self) -> bool {
        false
    }

    fn is_autonomous(&self) -> bool {
        self.halves.wave == 0.0
    }

    fn range(_: usize) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }
}

/// A run at two rates, whose cost is its evaluations, in communication steps with an input each.
fn halves(of: Halves, size: f64, inputs: Vec<f64>) -> Problem {
    let (nominals, mut exact) = ([1.0; 4], vec![0.0; 4]);
    for (step, &input) in inputs.iter().enumerate() {
        let mut system = Late(Counted::<_, false>::new(Halves { input, ..of }), step as f64 * size);
        exact = run(&mut system, &mut Integrator::new(4), &exact, (size, 1), EXACT, |_, _| false);
    }
    Box::new(move || {
        let mut system = Evaluated { halves: of, zero: 0.0, rates: vec![0.0; 4], evaluations: 0 };
        let (mut integrator, mut states) = (TwoRates::<2, 2>::new::<Evaluated>(4), [0.0; 4]);
        let mut rates = [0.0; 4];
        for (step, &input) in inputs.iter().enumerate() {
            (system.halves.input, system.zero) = (input, step as f64 * size);
            system.derivatives(0.0, &states, &mut rates);
            let tolerance = Tolerance { relative: TOLERANCE, nominals: &nominals };
            let trials = Trials { count: &mut 0, most: u32::MAX };
            integrator.step(&mut system, (0.0, size), &states, &tolerance, trials).unwrap();
            integrator.states_at(&mut system, size, &mut states);
            system.derivatives(size, &states, &mut rates);
            integrator.end_step(&system);
        }
        Outcome { cost: f64::from(system.evaluations), error: largest_error(&states, &exact).max(EXACT) }
    })
}

#[test]
#[ignore = "an experiment that prints a table"]
fn neither_half_nor_twice_of_a_chosen_constant_of_two_rates_is_better() {
    let mut random = Random(11);
    let mut problems = vec![];
    for number in 0..24 {
        let mut power = |least: f64, most: f64| 10.0_f64.powf(least + (most - least) * random.number());
        let of = Halves {
            input: 0.0,
            stiffness: power(0.0, 3.0),
            turn: power(0.0, 2.0),
            slowness: power(-1.0, 1.0),
            wave: if number % 2 == 0 { 0.0 } else { power(-2.0, 0.0) },
        };
        let size = power(-2.0, -0.5);
        // Jumps of all sizes, or none.
        let inputs = (0..30).map(|_| match random.number() {
            which if which < 0.5 => 1.0,
            _ => 1.0 + 10.0_f64.powf(-5.0 * random.number()),
        });
        problems.push(halves(of, size, inputs.collect()));
    }
    let names = ["JUMP_RENEWS", "JUMP_SHORTENS", "MOST_AHEAD", "OF_STATE", "OF_TIME", "SERVES", "SIMILAR"];
    compare(&names, || solved(&problems));
}

/// The least time of several runs (s), and the states at their end.
fn timed<S: System>(new: impl Fn() -> S, start: &[f64], end: f64, least: f64) -> (f64, Vec<f64>) {
    let begin = Instant::now();
    let found = run(&mut new(), &mut Integrator::new(start.len()), start, (end, 10), TOLERANCE, |_, _| false);
    (begin.elapsed().as_secs_f64().min(least), found)
}

/// Times are printed only, as other load changes them.
#[test]
#[ignore = "an experiment that prints a table"]
fn chosen_sizes_of_dense_equations_give_what_sparse_ones_give() {
    println!("| states | Rodas5P | ROS34PW2 |\n|---|---|---|");
    for size in [10, 12, 16, 22, 24, 32, 48] {
        let mut random = Random(size as u64);
        let network = Network::new(size, 4, 1e3, &mut random);
        let (start, end) = (network.start(&mut random), 10.0 * network.slowest());
        let sparse = || Counted::<_, true>::new(network.clone());
        let dense = || Counted::<_, false>::new(network.clone());
        let mut times = [[f64::INFINITY; 2]; 2];
        for _ in 0..50 {
            let mut ends = [vec![], vec![], vec![], vec![]];
            // By turns, so that other load slows all of them.
            (times[0][0], ends[0]) = timed(sparse, &start, end, times[0][0]);
            (times[0][1], ends[1]) = timed(dense, &start, end, times[0][1]);
            (times[1][0], ends[2]) = timed(|| Kept(sparse()), &start, end, times[1][0]);
            (times[1][1], ends[3]) = timed(|| Kept(dense()), &start, end, times[1][1]);
            for pair in ends.chunks(2) {
                for (sparse, dense) in pair[0].iter().zip(&pair[1]) {
                    // The Jacobian with a pattern serves other steps: within some tolerances.
                    assert!((sparse - dense).abs() < 100.0 * TOLERANCE, "{sparse} instead of {dense}");
                }
            }
        }
        let [rodas, ros] = times.map(|[sparse, dense]| sparse / dense);
        println!("| {size} | {rodas:.2} | {ros:.2} |");
    }
}
