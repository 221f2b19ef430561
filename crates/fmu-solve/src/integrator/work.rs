//! What a step computes: its trials by either method, and the polynomials of its dense output with their error.

use core::mem;
use core::ops::Range;

use super::explicit;
use super::jacobian::{Jacobian, Matrix, SMALL_ERROR};
use super::last_step::LastStep;
use super::method::Method;
use super::switch::{Switch, votes};
use super::system::{System, Tolerance};

/// The most stages of a method.
const MOST_STAGES: usize = explicit::STAGES;

/// The largest error of the dense output relative to what its slope at [`RESIDUAL_AT`] implies, if it vanishes with its
/// slope at both ends of the step, as θ²·(1 − θ)² does. Where errors decay fast, the slope implies the error there, 9/16
/// of the largest; where slowly, γ·h times the error's slope, for which it would be 1/(3·γ), which is less: the largest
/// error is 1/16, and the slope at a quarter 3/16.
const DENSE_ERROR: f64 = 16.0 / 9.0;
/// Where the slope of the dense output is compared with the derivatives: at a quarter of the step, as that of such an
/// error vanishes in the middle.
const RESIDUAL_AT: f64 = 0.25;

/// How many times as large as an error of lowest order implies differences between the slope of the dense output and the
/// derivatives may be: this leaves room for the terms of higher order. [Chosen](crate::chosen).
const MARGIN: f64 = 2.0;

/// The explicit method is not for steps whose length times the estimated magnitude of the largest eigenvalue exceeds this.
/// [Chosen](crate::chosen) below the limit, as the magnitude is that of one direction of the states.
const STIFF: f64 = 0.7 * explicit::STABILITY;

/// Memory for a step.
#[derive(Debug)]
pub(super) struct Work {
    /// The derivatives at the step's start.
    pub(super) slopes: Vec<f64>,
    by_time: Vec<f64>,
    pub(super) matrix: Matrix,
    pub(super) stages: [Vec<f64>; MOST_STAGES],
    pub(super) moved: Vec<f64>,
    /// Whether the stages are those of the last step.
    pub(super) has_stages: bool,
    /// How much the last trial speaks for the other method.
    pub(super) for_other: u32,
    /// Whether the error of the last trial was so small that the linearly implicit method would keep its Jacobian.
    pub(super) would_keep: bool,
    /// The position of the state with the largest error in the last trial.
    pub(super) decisive: usize,
}

impl Work {
    pub(super) fn new(size: usize, method: &Method) -> Self {
        let vector = || vec![0.0; size];
        Self {
            slopes: vector(),
            by_time: vector(),
            matrix: Matrix::new(),
            stages: core::array::from_fn(|stage| if stage < method.count() { vector() } else { vec![] }),
            moved: vector(),
            has_stages: false,
            for_other: 0,
            would_keep: false,
            decisive: 0,
        }
    }

    /// Forgets the factors and stages of another run.
    pub(super) fn forget(&mut self) {
        self.matrix.forget();
        self.has_stages = false;
    }

    /// Prepares trials of a step. For the linearly implicit method: renews the Jacobian, unless it still serves, and the
    /// derivatives with respect to time.
    pub(super) fn prepare<S: System>(
        &mut self,
        last: &mut LastStep,
        switch: &mut Switch,
        system: &mut S,
        jacobian: &mut Jacobian,
    ) {
        let Self { by_time, matrix, .. } = self;
        last.is_explicit = S::METHOD.is_explicit(switch.is_implicit);
        if last.took_explicit::<S>() {
            return self.stages[0].copy_from_slice(&self.slopes);
        }
        let at = (last.begin, &last.from[..]);
        if jacobian.serves() {
            jacobian.keep(matrix, system, at, by_time);
        } else {
            matrix.forget();
            jacobian.renew(matrix, system, at, by_time);
        }
        if S::METHOD.switches() && switch.learn(matrix.price) {
            jacobian.discard();
            last.is_explicit = true;
            self.stages[0].copy_from_slice(&self.slopes);
        }
    }

    /// Evaluates the stages of the last step again.
    pub(super) fn repeat<S: System>(&mut self, last: &LastStep, system: &mut S) {
        system.derivatives(last.begun, &last.from, &mut self.slopes);
        self.stages[0].copy_from_slice(&self.slopes);
        // As they were finite, they are.
        for of in [explicit::BEFORE_END, explicit::AT_END] {
            let _ = evaluate(of, last, system, &mut self.stages, &mut self.moved);
        }
        self.has_stages = true;
    }

    /// Computes the polynomials of the dense output.
    pub(super) fn find_dense<S: System>(&mut self, last: &mut LastStep, system: &mut S) {
        last.dense.resize(last.from.len(), [0.0; 3]);
        last.higher.clear();
        if last.took_explicit::<S>() {
            // What is not finite is found by the error of the dense output.
            let _ = evaluate(explicit::OF_DENSE, last, system, &mut self.stages, &mut self.moved);
            last.higher.resize(last.from.len(), [0.0; 3]);
            self.moved.copy_from_slice(&self.stages[explicit::END]);
        } else if let [first, second, third] = S::METHOD.dense {
            for (i, dense) in last.dense.iter_mut().enumerate() {
                *dense = [first, second, third].map(|weights| {
                    weights.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[i]).sum::<f64>()
                });
            }
            return;
        } else {
            system.derivatives(last.end, &last.to, &mut self.moved);
        }
        let LastStep { length, from, to, dense, higher, .. } = last;
        for (i, dense) in dense.iter_mut().enumerate() {
            let rise = to[i] - from[i];
            let (begin, end) = (*length * self.slopes[i], *length * self.moved[i]);
            *dense = [begin - rise, 2.0 * rise - begin - end, 0.0];
        }
        for (i, (dense, higher)) in dense.iter_mut().zip(higher).enumerate() {
            let [a, b, c, d] = explicit::DENSE.map(|weights| {
                weights.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[i]).sum::<f64>()
                    * *length
            });
            // θ·(1 − θ)·a + θ²·(1 − θ)·b + θ²·(1 − θ)²·c + θ³·(1 − θ)²·d over θ, by powers.
            let [_, second, third] = dense;
            *second += a;
            *third = b + c - a;
            *higher = [d - b - 2.0 * c, c - 2.0 * d, d];
        }
    }

    /// The largest error of the dense output, from the difference between its slope and the derivatives at one share of
    /// the step.
    pub(super) fn dense_error<S: System>(
        &mut self,
        last: &LastStep,
        system: &mut S,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let (share, weight) = if last.took_explicit::<S>() {
            (explicit::RESIDUAL_AT, explicit::ERROR_SLOPE.recip())
        } else {
            (RESIDUAL_AT, DENSE_ERROR)
        };
        let time = last.begin + share * last.length;
        last.states_at(time, &mut self.moved);
        let rates = &mut self.stages[const { S::METHOD.count() - 1 }];
        system.derivatives(time, &self.moved, rates);
        mem::swap(&mut self.moved, rates);
        self.residual::<S>(last, share, weight, tolerance)
    }

    /// Whether derivatives at a share of the last step, which `moved` holds, differ from the slope of its dense output by no
    /// more than errors within the tolerance explain.
    pub(super) fn agrees<S: System>(
        &mut self,
        last: &LastStep,
        jacobian: &mut Jacobian,
        share: f64,
        tolerance: &Tolerance<'_>,
    ) -> bool {
        let most = if last.took_explicit::<S>() {
            explicit::ERROR_SLOPE
        } else if self.matrix.restore::<S>(jacobian, last.length, last.from.len()) {
            // Errors that decay fast are left by the matrix as they are, slow ones become γ·h times their slope.
            1.0 + S::METHOD.gamma * explicit::ERROR_SLOPE
        } else {
            return false;
        };
        self.residual::<S>(last, share, 1.0, tolerance).largest <= chosen!(MARGIN) * most
    }

    /// The largest difference between derivatives at a share of the last step, which `moved` holds, and the slope of its
    /// dense output. It is multiplied by the length of the step, or by the linearly implicit method damped by the matrix
    /// of the step where errors decay fast.
    fn residual<S: System>(
        &mut self,
        last: &LastStep,
        share: f64,
        weight: f64,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let residual = &mut self.moved;
        for (state, residual) in residual.iter_mut().enumerate() {
            *residual -= last.slope(state, share);
        }
        if last.took_explicit::<S>() {
            for residual in residual.iter_mut() {
                *residual *= last.length;
            }
        } else {
            self.matrix.solve::<S>(residual);
        }
        let ends = last.from.iter().zip(&last.to);
        LargestError::of(residual.iter().zip(ends).enumerate().map(|(state, (error, (from, to)))| {
            weight * error / tolerance.scale::<S>(state, from.abs().max(to.abs()))
        }))
    }

    /// Tries a step of the last length: computes its stages and its end.
    pub(super) fn trial<S: System>(
        &mut self,
        last: &mut LastStep,
        system: &mut S,
        jacobian: &mut Jacobian,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        (self.for_other, self.would_keep) = (0, false);
        if last.took_explicit::<S>() {
            self.explicit_trial(last, system, tolerance)
        } else {
            self.implicit_trial(last, system, jacobian, tolerance)
        }
    }

    /// Tries a step beyond the end that is asked for: with its dense output, whose error counts, too.
    pub(super) fn trial_beyond<S: System>(
        &mut self,
        last: &mut LastStep,
        system: &mut S,
        jacobian: &mut Jacobian,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let error = self.trial(last, system, jacobian, tolerance);
        if error.largest > 1.0 {
            return error;
        }
        self.find_dense(last, system);
        let of_dense = self.dense_error(last, system, tolerance);
        if of_dense.largest > error.largest { of_dense } else { error }
    }

    /// Tries a step of the explicit method.
    fn explicit_trial<S: System>(
        &mut self,
        last: &mut LastStep,
        system: &mut S,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let Self { stages, moved, .. } = self;
        let not_finite = |state| LargestError { largest: f64::INFINITY, state };
        if let Err(state) = evaluate(explicit::BEFORE_END, last, system, stages, moved) {
            return not_finite(state);
        }
        last.to.copy_from_slice(moved);
        if let Err(state) = evaluate(explicit::AT_END, last, system, stages, moved) {
            return not_finite(state);
        }
        self.has_stages = true;
        // The states of the last stage before the end, which the next ones replace.
        let before = mem::replace(&mut last.to, mem::take(moved));
        let to = &last.to;
        let scale = |i: usize| tolerance.scale::<S>(i, last.from[i].abs().max(to[i].abs()));
        // The stages of the dense output are not evaluated yet.
        let (stages, [errors, ..]) = stages.split_at_mut(explicit::AT_END.end) else { unreachable!() };
        let mut relative = |weights: &[f64]| {
            // Stage by stage is fast for long vectors.
            if S::MAY_BE_SPARSE {
                errors.fill(-0.0);
                add(errors, weights, stages);
            }
            LargestError::of(to.iter().enumerate().map(|(i, to)| {
                let error = if S::MAY_BE_SPARSE {
                    errors[i]
                } else {
                    weights.iter().zip(&*stages).map(|(weight, stage)| weight * stage[i]).sum()
                };
                if to.is_finite() { last.length * error / scale(i) } else { f64::NAN }
            }))
        };
        let (fifth, third) = (relative(explicit::FIFTH_ORDER), relative(explicit::THIRD_ORDER));
        let norm =
            (fifth.largest * fifth.largest + explicit::OF_THIRD_ORDER * third.largest * third.largest).sqrt();
        let combined = fifth.largest * (fifth.largest / norm);
        let largest = match (fifth.largest, norm.is_finite()) {
            (0.0, _) => 0.0,
            (_, true) => combined,
            (_, false) => f64::INFINITY,
        };
        if S::METHOD.switches() {
            // The derivatives at two states at the end differ by the Jacobian times the difference of these.
            let [_, .., rates_before, rates] = &stages[..=explicit::END] else { unreachable!() };
            let (mut states_differ, mut rates_differ) = (0.0_f64, 0.0_f64);
            for i in 0..to.len() {
                states_differ = states_differ.max(((to[i] - before[i]) / scale(i)).abs());
                rates_differ = rates_differ.max(((rates[i] - rates_before[i]) / scale(i)).abs());
            }
            self.for_other = votes(last.length * rates_differ / (chosen!(STIFF) * states_differ));
            self.would_keep = fifth.largest <= chosen!(SMALL_ERROR);
        }
        self.moved = before;
        LargestError { largest, state: fifth.state }
    }

    /// Tries a step of the linearly implicit method.
    fn implicit_trial<S: System>(
        &mut self,
        last: &mut LastStep,
        system: &mut S,
        jacobian: &mut Jacobian,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let LastStep { begin, length, from, to, .. } = last;
        let length = *length;
        let size = from.len();
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
                for ((moved, right), (from, slope)) in sums.zip(from.iter().zip(&self.by_time)) {
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
                    self.moved[i] = from[i] + moved;
                    solution[i] = right / length + by_time * self.by_time[i];
                }
            }
            if stage > 0 {
                system.derivatives(*begin + S::METHOD.times[stage] * length, &self.moved, to);
            }
            let slopes = if stage > 0 { &*to } else { &self.slopes };
            if let Some(state) = slopes.iter().position(|slope| !slope.is_finite()) {
                return LargestError { largest: f64::INFINITY, state };
            }
            for (solution, slope) in solution.iter_mut().zip(slopes) {
                *solution += slope;
            }
            self.matrix.solve::<S>(solution);
        }
        let stages = &self.stages[..const { S::METHOD.stages.len() }];
        let (weighted, last_stage) =
            (&stages[stages.len() - S::METHOD.error.len()..], &stages[stages.len() - 1]);
        let ends = to.iter_mut().zip(self.moved.iter().zip(last_stage));
        LargestError::of(ends.enumerate().map(|(state, (to, (moved, last)))| {
            *to = moved + last;
            let error = match S::METHOD.error {
                [1.0] => *last,
                weights => weights.iter().zip(weighted).map(|(weight, stage)| weight * stage[state]).sum(),
            };
            let scale = tolerance.scale::<S>(state, from[state].abs().max(to.abs()));
            if to.is_finite() { error / scale } else { f64::NAN }
        }))
    }
}

/// The largest error of a trial relative to its tolerance, and the position of its state; infinite if anything was not
/// finite.
pub(super) struct LargestError {
    pub(super) largest: f64,
    pub(super) state: usize,
}

impl LargestError {
    /// The largest error of the states.
    pub(super) fn of(errors: impl Iterator<Item = f64>) -> Self {
        let mut largest = Self { largest: 0.0, state: 0 };
        for (state, error) in errors.enumerate() {
            if error.is_nan() {
                return Self { largest: f64::INFINITY, state };
            }
            if error.abs() > largest.largest {
                largest = Self { largest: error.abs(), state };
            }
        }
        largest
    }
}

/// Adds weighted stages.
fn add(sums: &mut [f64], weights: &[f64], stages: &[Vec<f64>]) {
    for (weight, stage) in weights.iter().zip(stages).filter(|(weight, _)| **weight != 0.0) {
        for (sum, rate) in sums.iter_mut().zip(stage) {
            *sum += weight * rate;
        }
    }
}

/// Evaluates stages of a step, those before them known; `moved` gets the states of the last one. The error is the
/// position of the first derivative that is not finite.
fn evaluate<S: System>(
    of: Range<usize>,
    last: &LastStep,
    system: &mut S,
    stages: &mut [Vec<f64>],
    moved: &mut [f64],
) -> Result<(), usize> {
    for stage in of {
        let (known, rest) = stages.split_at_mut(stage);
        moved.fill(-0.0);
        add(moved, explicit::STATES[stage], known);
        for (moved, from) in moved.iter_mut().zip(&last.from) {
            *moved = from + last.length * *moved;
        }
        system.derivatives(last.begun + explicit::TIMES[stage] * last.length, moved, &mut rest[0]);
        if let Some(state) = rest[0].iter().position(|rate| !rate.is_finite()) {
            return Err(state);
        }
    }
    Ok(())
}
