//! The built-in integrator of models of equations: linearly implicit (Rosenbrock) [methods](Method), of which models use
//! `Rodas5P` unless they choose another.
//!
//! They are L-stable and so suit stiff systems: they damp modes that are much faster than a step instead of following
//! them. As one-step methods they restart cheaply after an event, and remember only the length of the next step and,
//! where it serves several steps, the Jacobian.
//!
//! The linear equations are dense for few states. For more, the [`System`] gives the pattern of its Jacobian, whose
//! columns are computed in groups and whose factors are sparse; rows with many elements are computed one by one. A
//! product with one more direction checks the pattern whenever the Jacobian is renewed, so that an element that another
//! branch of the equations adds is not missed. A Jacobian serves steps with little error, or any with a method that
//! allows it.
//!
//! Memory for a step is allocated in the first one, where the pattern changes, and for the long rows. It does not belong
//! to a clone.
//!
//! `docs/integrator.md` compares it with other solvers. The crates `diffsol`, `differential-equations` and
//! `ode_solvers` were tried, but none can write its memory as bytes in the middle of a run, which a serialized FMU
//! state needs.

mod dense;
mod jacobian;
mod method;
mod multirate;
mod pattern;
mod sparse;
mod step_size;

use core::mem;

use crate::error::Error;
use crate::persistence::{Archive, Persistent};

pub use jacobian::Directions;
use jacobian::{Jacobian, Matrix};
pub use method::{Method, RODAS5P, ROS34PW2};
pub use multirate::{Part, TwoParts, TwoRates};
pub use pattern::Pattern;
use step_size::StepSize;

/// The most stages of a method.
const MOST_STAGES: usize = 8;
/// The most states whose linear equations are always dense: about where both take equally long for random networks.
pub const MOST_DENSE: usize = 20;

/// The shortest step, in roundings of the time.
const SHORTEST_STEP: f64 = 16.0 * f64::EPSILON;

/// A system dx/dt = f(t, x).
pub trait System {
    /// How it is integrated.
    const METHOD: &'static Method = &RODAS5P;
    /// Whether the tolerance is relative to nominal values alone.
    const TOLERANCE_IS_ABSOLUTE: bool = false;
    /// The longest step in s.
    const LONGEST_STEP: f64 = f64::INFINITY;
    /// Whether it may have more than [`MOST_DENSE`] states with a pattern: otherwise code for it is left out.
    const MAY_BE_SPARSE: bool = false;

    /// Computes the derivatives of the states.
    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]);
    /// Computes their derivatives along directions of the states, by rows, and with respect to time.
    fn linearize(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    );
    /// Computes rows of the Jacobian, each as a function of the column, for a system that gives a pattern.
    fn gradients(
        &mut self,
        time: f64,
        states: &[f64],
        rows: &[usize],
        take: impl FnMut(usize, &dyn Fn(usize) -> f64),
    ) {
        let _ = (time, states, rows, take);
    }
    /// Where the Jacobian has elements at this time and these states; full if unknown.
    fn pattern(&mut self, time: f64, states: &[f64]) -> Pattern {
        let _ = (time, states);
        Pattern::full()
    }
}

/// Even the shortest step misses the tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepFailure {
    /// The position of the state whose error is largest relative to its tolerance, or NaN.
    pub state: usize,
}

/// The integrator with its last step.
#[derive(Debug)]
pub struct Integrator {
    size: usize,
    steps: StepSize,
    jacobian: Jacobian,
    /// Memory for a step, and the last one. A clone has none, as it is between steps.
    work: Option<Box<Work>>,
}

impl Clone for Integrator {
    fn clone(&self) -> Self {
        Self { size: self.size, steps: self.steps, jacobian: self.jacobian.clone(), work: None }
    }

    fn clone_from(&mut self, source: &Self) {
        *self = Self { work: self.work.take(), ..source.clone() };
        if let Some(work) = &mut self.work {
            work.matrix.forget();
        }
    }
}

impl Persistent for Integrator {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.steps.next.persist(archive)?;
        self.jacobian.persist(archive)?;
        self.jacobian.check(self.size)
    }
}

/// The trials of a communication step.
#[derive(Debug)]
pub struct Trials<'a> {
    /// Their number.
    pub count: &'a mut u32,
    /// The number after which the step fails.
    pub most: u32,
}

impl Trials<'_> {
    /// Counts one. Returns whether it is one too many.
    fn add(&mut self) -> bool {
        *self.count += 1;
        *self.count > self.most
    }
}

/// What integrates the states of a model in co-simulation.
pub trait Integrate: Clone + core::fmt::Debug + Persistent + Send + Sync + 'static {
    /// Whether [`Integrate::states_at`] gives states within a step, where events are searched.
    const FINDS_EVENTS: bool;
    /// An integrator for this many states of a system.
    fn new<S: TwoParts>(size: usize) -> Self;
    /// Prepares for a jump.
    fn restart(&mut self);
    /// Has the Jacobian renewed before the next step.
    fn discard_jacobian(&mut self);
    /// Takes a step as [`Integrator::step`].
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    fn step<S: TwoParts>(
        &mut self,
        system: &mut S,
        times: (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure>;
    /// The states at a time in the last step.
    fn states_at<S: TwoParts>(&mut self, system: &mut S, time: f64, states: &mut [f64]);
    /// Takes the derivatives at the end of the last step.
    fn end_step<S: TwoParts>(&mut self, system: &S) {
        let _ = system;
    }
    /// The position of the state whose error determined the length of the last trial.
    fn decisive_state(&self) -> usize;
}

impl Integrate for Integrator {
    const FINDS_EVENTS: bool = true;

    fn new<S: TwoParts>(size: usize) -> Self {
        Self::new(size)
    }

    fn restart(&mut self) {
        self.restart();
    }

    fn discard_jacobian(&mut self) {
        self.jacobian.discard();
    }

    fn step<S: TwoParts>(
        &mut self,
        system: &mut S,
        times: (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        self.step(system, times, states, tolerance, trials.count)
    }

    fn states_at<S: TwoParts>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        self.states_at(system, time, states);
    }

    fn decisive_state(&self) -> usize {
        self.decisive_state()
    }
}

impl Integrator {
    /// An integrator for this many states.
    #[must_use]
    pub fn new(size: usize) -> Self {
        Self { size, steps: StepSize::new(0.0, f64::INFINITY), jacobian: Jacobian::default(), work: None }
    }

    /// Re-estimates the length of the next step, as after a jump.
    pub fn restart(&mut self) {
        self.steps.next = 0.0;
        self.jacobian.discard();
    }

    /// Takes a step from `states`, not beyond an end, shortened until its error meets the relative tolerance. Returns
    /// the time at which it ends; `trials` counts.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    pub fn step<S: System>(
        &mut self,
        system: &mut S,
        (time, end): (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: &mut u32,
    ) -> Result<f64, StepFailure> {
        let Self { size, steps, jacobian, work } = self;
        let work = work.get_or_insert_with(|| Box::new(Work::new(*size, S::METHOD)));
        work.from.copy_from_slice(states);
        work.begin = time;
        system.derivatives(time, states, &mut work.slopes);
        work.linearize(system, jacobian);
        if steps.next <= 0.0 {
            steps.next = work.first_step::<S>(tolerance);
        }
        *steps = StepSize::new(steps.next, S::LONGEST_STEP);
        loop {
            *trials += 1;
            let (length, to) = steps.within(time, end);
            let error = work.trial(system, jacobian, length, tolerance);
            work.decisive = error.state;
            let factor = if error.largest > 0.0 {
                error.largest.powf(-S::METHOD.estimate_order.recip())
            } else {
                f64::INFINITY
            };
            if steps.judge(length, error.largest, factor) {
                work.length = length;
                work.has_dense = false;
                jacobian.count_step::<S>(error.largest);
                return Ok(to);
            }
            if steps.next <= SHORTEST_STEP * time.abs().max(end.abs()) || steps.next < f64::MIN_POSITIVE {
                return Err(StepFailure { state: error.state });
            }
            if !jacobian.is_fresh() {
                jacobian.discard();
                work.linearize(system, jacobian);
            }
        }
    }

    /// The states at a time in the last step.
    pub fn states_at<S: System>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        if let Some(work) = &mut self.work {
            work.states_at(system, time, states);
        }
    }

    /// The position of the state whose error determined the length of the last trial.
    #[must_use]
    pub(crate) fn decisive_state(&self) -> usize {
        self.work.as_ref().map_or(0, |work| work.decisive)
    }
}

/// Memory for a step.
#[derive(Debug)]
struct Work {
    /// The start of the last step in s, and its length.
    begin: f64,
    length: f64,
    /// The states there, and at the end of the step.
    from: Vec<f64>,
    to: Vec<f64>,
    /// The derivatives at its start.
    slopes: Vec<f64>,
    by_time: Vec<f64>,
    matrix: Matrix,
    stages: [Vec<f64>; MOST_STAGES],
    moved: Vec<f64>,
    /// The polynomials of the dense output, once they are asked for.
    dense: Vec<[f64; 3]>,
    has_dense: bool,
    /// The position of the state with the largest error in the last trial.
    decisive: usize,
}

impl Work {
    fn new(size: usize, method: &Method) -> Self {
        let vector = || vec![0.0; size];
        Self {
            begin: 0.0,
            length: 0.0,
            from: vector(),
            to: vector(),
            slopes: vector(),
            by_time: vector(),
            matrix: Matrix::new(),
            stages: core::array::from_fn(|stage| if stage < method.stages.len() { vector() } else { vec![] }),
            moved: vector(),
            dense: vec![[0.0; 3]; size],
            has_dense: false,
            decisive: 0,
        }
    }

    fn states_at<S: System>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        let share = (time - self.begin) / self.length;
        if share >= 1.0 {
            return states.copy_from_slice(&self.to);
        }
        if !mem::replace(&mut self.has_dense, true) {
            self.find_dense(system);
        }
        let ends = self.from.iter().zip(&self.to);
        for ((state, [first, second, third]), (from, to)) in states.iter_mut().zip(&self.dense).zip(ends) {
            let bulge = first + share * (second + share * third);
            *state = (1.0 - share) * from + share * (to + (1.0 - share) * bulge);
        }
    }

    /// Computes the polynomials of the dense output.
    fn find_dense<S: System>(&mut self, system: &mut S) {
        if let [first, second, third] = S::METHOD.dense {
            for (i, dense) in self.dense.iter_mut().enumerate() {
                *dense = [first, second, third].map(|weights| {
                    weights.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[i]).sum::<f64>()
                });
            }
            return;
        }
        system.derivatives(self.begin + self.length, &self.to, &mut self.moved);
        for (i, dense) in self.dense.iter_mut().enumerate() {
            let rise = self.to[i] - self.from[i];
            let (begin, end) = (self.length * self.slopes[i], self.length * self.moved[i]);
            *dense = [begin - rise, 2.0 * rise - begin - end, 0.0];
        }
    }

    /// The length of a first step: that in which the states change by a hundredth at their present derivatives
    /// (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, section II.4). The end does not limit it: it
    /// would limit the steps after it, too.
    fn first_step<S: System>(&self, tolerance: &Tolerance<'_>) -> f64 {
        let norm = |values: &[f64]| {
            let scaled = values
                .iter()
                .enumerate()
                .map(|(i, value)| (value / tolerance.scale::<S>(i, self.from[i])).abs());
            scaled.fold(0.0, f64::max)
        };
        let (states, slopes) = (norm(&self.from), norm(&self.slopes));
        let length = 0.01 * states.max(1.0) / slopes;
        if length > 0.0 { length } else { f64::INFINITY }
    }

    /// Renews the Jacobian, unless it still serves, and the derivatives with respect to time.
    fn linearize<S: System>(&mut self, system: &mut S, jacobian: &mut Jacobian) {
        let Self { begin, from, by_time, matrix, .. } = self;
        if jacobian.serves() {
            jacobian.keep(matrix, system, (*begin, from), by_time);
        } else {
            matrix.forget();
            jacobian.renew(matrix, system, (*begin, from), by_time);
        }
    }

    /// Computes `stages` and `to` for a step length.
    fn trial<S: System>(
        &mut self,
        system: &mut S,
        jacobian: &mut Jacobian,
        length: f64,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let size = self.from.len();
        if !self.matrix.factor::<S>(jacobian, length, size) {
            return LargestError { largest: f64::INFINITY, state: jacobian.first_not_finite(size) };
        }
        for stage in 0..const { S::METHOD.stages.len() } {
            let (known, rest) = self.stages.split_at_mut(stage);
            let solution = &mut rest[0];
            let weights = S::METHOD.states[stage].iter().zip(S::METHOD.stages[stage]);
            let by_time = length * S::METHOD.by_time[stage];
            if S::MAY_BE_SPARSE {
                // Stage by stage, which is fast for long vectors.
                self.moved.fill(-0.0);
                solution.fill(-0.0);
                for ((a, c), known) in weights.zip(&*known) {
                    let sums = self.moved.iter_mut().zip(&mut *solution).zip(known);
                    for ((moved, right), known) in sums {
                        *moved += a * known;
                        *right += c * known;
                    }
                }
                let sums = self.moved.iter_mut().zip(solution.iter_mut());
                for ((moved, right), (from, slope)) in sums.zip(self.from.iter().zip(&self.by_time)) {
                    *moved += from;
                    *right = *right / length + by_time * slope;
                }
            } else {
                for i in 0..size {
                    let (mut moved, mut right) = (-0.0, -0.0);
                    for ((a, c), known) in weights.clone().zip(&*known) {
                        moved += a * known[i];
                        right += c * known[i];
                    }
                    self.moved[i] = self.from[i] + moved;
                    solution[i] = right / length + by_time * self.by_time[i];
                }
            }
            if stage > 0 {
                system.derivatives(self.begin + S::METHOD.times[stage] * length, &self.moved, &mut self.to);
            }
            let slopes = if stage > 0 { &self.to } else { &self.slopes };
            if let Some(state) = slopes.iter().position(|slope| !slope.is_finite()) {
                return LargestError { largest: f64::INFINITY, state };
            }
            for (solution, slope) in solution.iter_mut().zip(slopes) {
                *solution += slope;
            }
            self.matrix.solve::<S>(solution);
        }
        let stages = &self.stages[..const { S::METHOD.stages.len() }];
        let (weighted, last) = (&stages[stages.len() - S::METHOD.error.len()..], &stages[stages.len() - 1]);
        let mut largest = LargestError { largest: 0.0, state: 0 };
        for (state, (to, (moved, last))) in self.to.iter_mut().zip(self.moved.iter().zip(last)).enumerate() {
            *to = moved + last;
            let error = match S::METHOD.error {
                [1.0] => *last,
                weights => weights.iter().zip(weighted).map(|(weight, stage)| weight * stage[state]).sum(),
            };
            let scale = tolerance.scale::<S>(state, self.from[state].abs().max(to.abs()));
            let error = (error / scale).abs();
            if !to.is_finite() || error.is_nan() {
                return LargestError { largest: f64::INFINITY, state };
            }
            if error > largest.largest {
                largest = LargestError { largest: error, state };
            }
        }
        largest
    }
}

/// The allowed error of a step.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance<'a> {
    /// Relative to the sum of a state and its nominal value.
    pub relative: f64,
    /// The nominal value of each state.
    pub nominals: &'a [f64],
}

impl Tolerance<'_> {
    #[inline]
    fn scale<S: System>(&self, state: usize, value: f64) -> f64 {
        let magnitude = if S::TOLERANCE_IS_ABSOLUTE { 0.0 } else { value.abs() };
        self.relative * (magnitude + self.nominals[state])
    }
}

/// The largest error of a trial relative to its tolerance, and the position of its state; infinite if anything was not
/// finite.
struct LargestError {
    largest: f64,
    state: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::{Dual, Number};
    use crate::tape::Tape;

    /// Sets products with a Jacobian given by its rows.
    fn set(directions: &impl Directions, products: &mut [f64], rows: &[f64]) {
        let count = directions.count();
        for (row, elements) in rows.chunks_exact(rows.len().isqrt()).enumerate() {
            for direction in 0..count {
                let terms =
                    elements.iter().enumerate().map(|(state, x)| x * directions.component(direction, state));
                products[row * count + direction] = terms.sum();
            }
        }
    }

    /// x' = x·cos t, y' = −y², from 1 at t = 1.
    struct Nonlinear;

    impl System for Nonlinear {
        fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
            derivatives[0] = states[0] * time.cos();
            derivatives[1] = -states[1] * states[1];
        }

        fn linearize(
            &mut self,
            time: f64,
            states: &[f64],
            directions: &impl Directions,
            products: &mut [f64],
            by_time: &mut [f64],
        ) {
            set(directions, products, &[time.cos(), 0.0, 0.0, -2.0 * states[1]]);
            by_time.copy_from_slice(&[-states[0] * time.sin(), 0.0]);
        }
    }

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
        check(|| Nonlinear, [6.0, 5.0, 5.0]);
        check(|| Kept(Nonlinear), [4.0, 3.0, 4.0]);
    }

    /// Another trial of the last step, of another length.
    fn trial<S: System>(
        integrator: &mut Integrator,
        system: &mut S,
        length: f64,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let Integrator { work, jacobian, .. } = integrator;
        work.as_mut().unwrap().trial(system, jacobian, length, tolerance)
    }

    /// Takes a step from t = 1 with an initial length and a distant end. Returns the number of trials.
    fn step_from(integrator: &mut Integrator, length: f64, tolerance: &Tolerance<'_>) -> u32 {
        let mut trials = 0;
        integrator.steps.next = length;
        integrator.step(&mut Nonlinear, (1.0, 1e4), &exact(1.0), tolerance, &mut trials).unwrap();
        trials
    }

    #[test]
    fn the_next_step_just_meets_the_tolerance() {
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        assert_eq!(step_from(&mut integrator, 0.03, &tolerance), 1);
        let proposed = integrator.steps.next;
        // Its error is the fifth power of the safety factor, up to terms of higher order.
        let error = trial(&mut integrator, &mut Nonlinear, proposed, &tolerance).largest;
        assert!(error > 0.4 && error < 0.8, "{error}");
        // The error of a step half as long again is about 4 tolerances: it is rejected.
        assert_eq!(step_from(&mut integrator, 1.5 * proposed, &tolerance), 2);
    }

    #[test]
    fn the_next_step_does_not_grow_at_once_after_a_rejection() {
        /// x' = 1, until t = 1.
        struct Wall;
        impl System for Wall {
            fn derivatives(&mut self, time: f64, _states: &[f64], derivatives: &mut [f64]) {
                derivatives[0] = if time <= 1.0 { 1.0 } else { f64::NAN };
            }

            fn linearize(
                &mut self,
                _time: f64,
                _states: &[f64],
                directions: &impl Directions,
                products: &mut [f64],
                by_time: &mut [f64],
            ) {
                set(directions, products, &[0.0]);
                by_time[0] = 0.0;
            }
        }
        let tolerance = Tolerance { relative: 1e-6, nominals: &[1.0] };
        let mut integrator = Integrator::new(1);
        let mut trials = 0;
        integrator.steps.next = 2.0;
        integrator.step(&mut Wall, (0.0, 1e4), &[0.0], &tolerance, &mut trials).unwrap();
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
    fn a_step_that_the_end_cuts_short_leaves_the_length_of_the_next() {
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
        let mut integrator = Integrator::new(2);
        integrator.steps.next = 0.1;
        let end = integrator.step(&mut Nonlinear, (1.0, 1.001), &exact(1.0), &tolerance, &mut 0).unwrap();
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
            integrator.step(&mut Nonlinear, (begin, end), &exact(begin), &tolerance, &mut 0).unwrap();
        assert_eq!(reached.to_bits(), end.to_bits());
    }

    /// x' = 1000, y' = cos t.
    struct Rising;

    impl System for Rising {
        fn derivatives(&mut self, time: f64, _states: &[f64], derivatives: &mut [f64]) {
            derivatives.copy_from_slice(&[1000.0, time.cos()]);
        }

        fn linearize(
            &mut self,
            time: f64,
            _states: &[f64],
            directions: &impl Directions,
            products: &mut [f64],
            by_time: &mut [f64],
        ) {
            set(directions, products, &[0.0; 4]);
            by_time.copy_from_slice(&[0.0, -time.sin()]);
        }
    }

    #[test]
    fn the_error_is_relative_to_the_larger_of_both_ends_and_the_nominal_value() {
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0, 0.25] };
        let mut integrator = Integrator::new(2);
        integrator.steps.next = 0.5;
        for (from, larger) in [(0.0, 0.5_f64.sin()), (2.0, 2.0 + 0.5_f64.sin()), (-2.0, 2.0)] {
            integrator.step(&mut Rising, (0.0, 0.5), &[0.0, from], &tolerance, &mut 0).unwrap();
            let error = trial(&mut integrator, &mut Rising, 0.5, &tolerance);
            let expected = integrator.work.as_ref().unwrap().stages[7][1].abs() / (1e-3 * (larger + 0.25));
            assert_eq!(error.state, 1);
            // The error of the step is far less than a thousandth.
            assert!((error.largest / expected - 1.0).abs() < 1e-3, "{} instead of {expected}", error.largest);
        }
    }

    #[test]
    fn a_failure_names_the_state_without_a_linearization() {
        struct Broken;
        impl System for Broken {
            fn derivatives(&mut self, _time: f64, _states: &[f64], derivatives: &mut [f64]) {
                derivatives.fill(1.0);
            }

            fn linearize(
                &mut self,
                _time: f64,
                _states: &[f64],
                directions: &impl Directions,
                products: &mut [f64],
                by_time: &mut [f64],
            ) {
                set(directions, products, &[0.0, 0.0, 0.0, f64::NAN]);
                by_time.fill(0.0);
            }
        }
        let tolerance = Tolerance { relative: 1e-3, nominals: &[1.0; 2] };
        let result = Integrator::new(2).step(&mut Broken, (0.0, 1.0), &[0.0; 2], &tolerance, &mut 0);
        assert_eq!(result, Err(StepFailure { state: 1 }));
    }

    #[test]
    fn within_a_step_the_error_is_less_than_at_its_end() {
        let length = 0.1;
        let mut integrator = Integrator::new(2);
        integrator.steps.next = length;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0; 2] };
        integrator.step(&mut Nonlinear, (1.0, 1.0 + length), &exact(1.0), &tolerance, &mut 0).unwrap();
        for eighth in 1..8 {
            let time = 1.0 + f64::from(eighth) / 8.0 * length;
            let mut states = [0.0; 2];
            integrator.states_at(&mut Nonlinear, time, &mut states);
            for (i, (state, exact)) in states.iter().zip(exact(time)).enumerate() {
                // The largest is a third.
                let error = ((state - exact) / integrator.work.as_ref().unwrap().stages[7][i]).abs();
                assert!(error < 0.5, "after {eighth} eighths, {error} of the error estimated for the end");
            }
        }
    }

    #[test]
    fn a_mode_a_million_times_as_fast_as_the_step_is_damped() {
        struct Stiff;
        impl System for Stiff {
            fn derivatives(&mut self, _time: f64, states: &[f64], derivatives: &mut [f64]) {
                derivatives[0] = -1e6 * states[0];
            }

            fn linearize(
                &mut self,
                _time: f64,
                _states: &[f64],
                directions: &impl Directions,
                products: &mut [f64],
                by_time: &mut [f64],
            ) {
                set(directions, products, &[-1e6]);
                by_time[0] = 0.0;
            }
        }
        let mut integrator = Integrator::new(1);
        integrator.steps.next = 1.0;
        let tolerance = Tolerance { relative: 1.0, nominals: &[1.0] };
        integrator.step(&mut Stiff, (0.0, 1.0), &[1.0], &tolerance, &mut 0).unwrap();
        // An L-stable method with a few stages leaves a multiple of 1e-6; an explicit one would have 1e48.
        assert!(
            integrator.work.as_ref().unwrap().to[0].abs() < 1e-4,
            "{}",
            integrator.work.as_ref().unwrap().to[0]
        );
    }

    /// Conduction along a rod, whose conductivity falls with the temperature, with the pattern of its Jacobian or
    /// without. From a time on, its ends are joined by what conducts `joint` times as well.
    struct Rod<const PATTERN: bool> {
        joined_from: f64,
        joint: f64,
        /// With which gain the last state heats all cells, an integral of their mean.
        gain: f64,
        /// The Jacobians, the patterns and the derivatives with respect to time that were computed.
        counts: [u32; 3],
    }

    impl<const PATTERN: bool> Rod<PATTERN> {
        fn joined_from(joined_from: f64, joint: f64) -> Self {
            Self { joined_from, joint, gain: 0.0, counts: [0; 3] }
        }

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
                let mean =
                    cells.iter().fold(T::from(0.0), |sum, &cell| sum + cell) / T::from(cells.len() as f64);
                for rate in &mut rates {
                    *rate -= *integral * self.gain;
                }
                rates[cells.len()] = mean * self.gain;
            }
            rates
        }
    }

    impl<const PATTERN: bool> System for Rod<PATTERN> {
        const MAY_BE_SPARSE: bool = PATTERN;

        fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]) {
            derivatives.copy_from_slice(&self.rates(time, states));
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
                let rates = self.rates(time, &states.iter().enumerate().map(along).collect::<Vec<_>>());
                for (row, rate) in rates.into_iter().enumerate() {
                    products[row * count + direction] = rate.derivative;
                }
            }
        }

        fn pattern(&mut self, time: f64, states: &[f64]) -> Pattern {
            self.counts[1] += 1;
            let last = states.len() - 1;
            Pattern::of_rows(states.len(), |row, columns| {
                columns.extend(row.saturating_sub(1)..=(row + 1).min(last));
                if time >= self.joined_from && (row == 0 || row == last) {
                    columns.extend([0, last]);
                }
                if self.gain > 0.0 {
                    columns.extend(if row == last { 0..last } else { last..last + 1 });
                }
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
            let states: Vec<_> = states.iter().map(|&state| tape.variable(state)).collect();
            let rates = self.rates(time, &states);
            for &row in rows {
                tape.differentiate(rates[row]);
                take(row, &|column| tape.derivative(states[column]));
            }
        }
    }

    const CELLS: usize = 60;

    /// Steps along a rod to a time. Returns the states there.
    fn conduct<S: System>(
        system: &mut S,
        integrator: &mut Integrator,
        from: f64,
        to: f64,
        states: &mut [f64],
    ) {
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
                let [jacobians, _, steps] = full.0.counts;
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
        let mut patterned = Rod::<true> { gain: 20.0, ..Rod::joined_from(f64::MAX, 0.0) };
        let mut full = Rod::<false> { gain: 20.0, ..Rod::joined_from(f64::MAX, 0.0) };
        conduct(&mut patterned, &mut Integrator::new(CELLS), 0.0, 1.0, &mut sparse);
        conduct(&mut full, &mut Integrator::new(CELLS), 0.0, 1.0, &mut dense);
        assert_eq!(patterned.counts, [full.counts[0], 1, full.counts[2]], "the steps are the same");
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
        let [jacobians, _, steps] = rod.counts;
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
}
