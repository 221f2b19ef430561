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

pub(crate) mod dense;
mod jacobian;
mod method;
mod multirate;
mod pattern;
mod sparse;
mod step_size;
mod system;
#[cfg(test)]
mod tests;

use core::mem;

use crate::error::Error;
use crate::persistence::{Archive, Persistent};

use jacobian::{Jacobian, Matrix};
pub use method::{Method, RODAS5P, ROS34PW2};
pub use multirate::TwoRates;
pub use pattern::Pattern;
use step_size::StepSize;
pub use system::{Directions, MOST_DENSE, Part, StepFailure, System, Tolerance, TwoParts};

/// The most stages of a method.
const MOST_STAGES: usize = 8;

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

    /// Has the Jacobian renewed before the next step.
    pub fn discard_jacobian(&mut self) {
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
        *steps = StepSize::new(steps.next, S::LONGEST_STEP);
        if steps.next <= 0.0 {
            let norm = |values| work.norm::<S>(values, tolerance);
            steps.begin(norm(&work.from), norm(&work.slopes));
        }
        jacobian.expect::<S>(steps.within(time, end).0);
        work.linearize(system, jacobian);
        loop {
            *trials += 1;
            let (length, to) = steps.within(time, end);
            let error = work.trial(system, jacobian, length, tolerance);
            work.decisive = error.state;
            // The error with an older Jacobian says nothing about the length, if the method's order rests on it.
            let is_stale = !S::METHOD.takes_any_jacobian && !jacobian.is_fresh();
            if is_stale && error.largest > 1.0 {
                jacobian.distrust();
                work.linearize(system, jacobian);
                continue;
            }
            let factor = if error.largest > 0.0 {
                error.largest.powf(-S::METHOD.estimate_order.recip())
            } else {
                f64::INFINITY
            };
            if steps.judge(length, error.largest, factor) {
                if is_stale && steps.next < length {
                    steps.next = length;
                }
                work.length = length;
                work.has_dense = false;
                jacobian.count_step::<S>(error.largest);
                return Ok(to);
            }
            if steps.is_too_short(time, end) {
                return Err(StepFailure { time, state: error.state });
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

    /// The largest magnitude of values of the states relative to their allowed errors.
    fn norm<S: System>(&self, values: &[f64], tolerance: &Tolerance<'_>) -> f64 {
        let relative = |(i, value): (usize, &f64)| (value / tolerance.scale::<S>(i, self.from[i])).abs();
        values.iter().enumerate().map(relative).fold(0.0, f64::max)
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
                // Stage by stage, and without divisions, which is fast for long vectors.
                self.moved.fill(-0.0);
                solution.fill(-0.0);
                for ((a, c), known) in weights.zip(&*known) {
                    let c = c / length;
                    let sums = self.moved.iter_mut().zip(&mut *solution).zip(known);
                    for ((moved, right), known) in sums {
                        *moved += a * known;
                        *right += c * known;
                    }
                }
                let sums = self.moved.iter_mut().zip(solution.iter_mut());
                for ((moved, right), (from, slope)) in sums.zip(self.from.iter().zip(&self.by_time)) {
                    *moved += from;
                    *right += by_time * slope;
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

/// The largest error of a trial relative to its tolerance, and the position of its state; infinite if anything was not
/// finite.
struct LargestError {
    largest: f64,
    state: usize,
}
