//! The integration of a part, from trial to trial.

use core::{array, mem};

use super::differences::moved;
use crate::error::Error;
use crate::integrator::dense;
use crate::integrator::method::{Method, ROS34PW2};
use crate::integrator::step_size::{SIMILAR, StepSize};
use crate::integrator::system::{StepFailure, System};
use crate::persistence::{Archive, Persistent};

pub(super) const METHOD: &Method = &ROS34PW2;
pub(super) const STAGES: usize = METHOD.stages.len();

/// The most steps with one Jacobian. [Chosen](crate::chosen).
const SERVES: u32 = 25;
/// A jump that changes the derivatives by more than this many tolerances over the next step discards the Jacobian.
/// [Chosen](crate::chosen).
const JUMP_RENEWS: f64 = 300.0;
/// A larger jump than this many tolerances shortens the step: a long one would damp the fast modes that the jump excites
/// without showing in its error estimate. [Chosen](crate::chosen).
const JUMP_SHORTENS: f64 = 30.0;

/// The integration of a part.
#[derive(Clone, Debug)]
pub(super) struct Course<const N: usize> {
    /// The range of each state; steps beyond it are rejected.
    min: [f64; N],
    max: [f64; N],
    /// The time reached.
    pub(super) time: f64,
    /// The states at the time reached.
    pub(super) states: [f64; N],
    /// The derivatives at the time reached; not numbers before the first step.
    pub(super) slopes: [f64; N],
    /// The reciprocals of the states' errors allowed in a step.
    pub(super) weights: [f64; N],
    pub(super) steps: StepSize,
    /// The approximate Jacobian, by columns.
    pub(super) jacobian: [[f64; N]; N],
    /// The Jacobian's norm, of states and derivatives relative to the states' allowed errors, in 1/s.
    pub(super) stiffness: f64,
    /// The number of remaining steps with the Jacobian; 0 if there is none.
    pub(super) serves: u32,
    /// Whether no step was accepted with the Jacobian yet.
    is_fresh: bool,
    /// The inverse of 1 − γ·h·J, by columns.
    pub(super) inverse: [[f64; N]; N],
    /// The length h of the inverse; 0 if there is none.
    pub(super) inverse_of: f64,
}

/// A step that was tried.
pub(super) struct Trial<const N: usize> {
    pub(super) states: [f64; N],
    /// The estimated errors of the states.
    error: [f64; N],
    /// The largest error relative to what is allowed; infinite if an error or a state is not finite, or a state out of
    /// its range.
    pub(super) largest: f64,
}

impl<const N: usize> Persistent for Course<N> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { slopes, steps, jacobian, stiffness, serves, is_fresh, inverse, inverse_of, .. } = self;
        slopes.persist(archive)?;
        steps.next.persist(archive)?;
        jacobian.persist(archive)?;
        stiffness.persist(archive)?;
        serves.persist(archive)?;
        is_fresh.persist(archive)?;
        inverse.persist(archive)?;
        inverse_of.persist(archive)
    }
}

impl<const N: usize> Course<N> {
    pub(super) fn new(range: impl Fn(usize) -> [f64; 2]) -> Self {
        Self {
            min: array::from_fn(|i| range(i)[0]),
            max: array::from_fn(|i| range(i)[1]),
            time: 0.0,
            states: [0.0; N],
            slopes: [f64::NAN; N],
            weights: [0.0; N],
            steps: StepSize::new(0.0, f64::INFINITY),
            jacobian: [[0.0; N]; N],
            stiffness: 0.0,
            serves: 0,
            is_fresh: false,
            inverse: [[0.0; N]; N],
            inverse_of: 0.0,
        }
    }

    /// Begins at a time, where the derivatives may have jumped, with the allowed error of each state.
    pub(super) fn begin<S: System>(
        &mut self,
        (time, end): (f64, f64),
        states: [f64; N],
        slopes: [f64; N],
        allowed: impl Fn(usize) -> f64,
    ) {
        (self.time, self.states) = (time, states);
        self.weights = array::from_fn(|i| allowed(i).recip());
        self.steps = StepSize::new(self.steps.next, S::LONGEST_STEP);
        let before = mem::replace(&mut self.slopes, slopes);
        if self.steps.next <= 0.0 {
            return self.steps.begin(self.relative(&states, &states), self.relative(&states, &slopes));
        }
        let (length, _) = self.steps.within(time, end);
        let jump = self.relative(&states, &array::from_fn(|i| length * (slopes[i] - before[i])));
        if jump > chosen!(JUMP_RENEWS) {
            self.serves = 0;
        }
        if jump > chosen!(JUMP_SHORTENS) {
            self.steps.next = length * (chosen!(JUMP_SHORTENS) / jump).sqrt().sqrt();
        }
    }

    /// The largest error relative to what is allowed; infinite if an error or a state is not finite.
    #[inline]
    fn relative(&self, states: &[f64; N], error: &[f64; N]) -> f64 {
        let (mut largest, mut sum) = (0.0, 0.0);
        for ((state, error), weight) in states.iter().zip(error).zip(&self.weights) {
            let relative = (error * weight).abs();
            largest = if relative > largest { relative } else { largest };
            sum += relative + 0.0 * state;
        }
        // Comparisons ignore NaN; the sum does not.
        if sum.is_finite() { largest } else { f64::INFINITY }
    }

    /// Whether states are in their ranges.
    #[inline]
    fn is_within(&self, states: &[f64; N]) -> bool {
        // Without branches, which cost more than the comparisons.
        let is_outside = |i: usize| !(self.min[i]..=self.max[i]).contains(&states[i]);
        (0..N).map(|i| u32::from(is_outside(i))).sum::<u32>() == 0
    }

    /// Renews the Jacobian, with the derivatives as a function of the states.
    pub(super) fn linearize(&mut self, mut derivatives: impl FnMut(&[f64; N]) -> [f64; N]) {
        let mut changes = [0.0; N];
        for column in 0..N {
            let (moved, difference) = moved(&self.states, &self.weights, column);
            let slopes = derivatives(&moved);
            // One division instead of one a row.
            let reciprocal = difference.recip();
            self.jacobian[column] = array::from_fn(|row| (slopes[row] - self.slopes[row]) * reciprocal);
            let allowed = self.weights[column].recip();
            changes = array::from_fn(|row| changes[row] + (self.jacobian[column][row] * allowed).abs());
        }
        self.stiffness = (0..N).map(|row| changes[row] * self.weights[row]).fold(0.0, f64::max);
        (self.serves, self.is_fresh, self.inverse_of) = (chosen!(SERVES), true, 0.0);
    }

    /// Prepares a step of a length. Returns whether its linear equations have a solution.
    fn prepare(&mut self, length: f64) -> bool {
        if (self.inverse_of - length).abs() <= chosen!(SIMILAR) * length {
            return true;
        }
        let weight = METHOD.gamma * length;
        let mut matrix = self.jacobian.map(|column| column.map(|element| -weight * element));
        for (i, column) in matrix.iter_mut().enumerate() {
            column[i] += 1.0;
        }
        let is_regular = dense::invert(&mut matrix);
        if is_regular {
            (self.inverse, self.inverse_of) = (matrix, length);
        }
        is_regular
    }

    /// Tries a step; `drift` is the derivative of the slopes with respect to time. None if the linear equations have no
    /// solution.
    #[inline]
    pub(super) fn trial(
        &mut self,
        length: f64,
        drift: &[f64; N],
        mut derivatives: impl FnMut(f64, &[f64; N]) -> [f64; N],
    ) -> Option<Trial<N>> {
        if !self.prepare(length) {
            return None;
        }
        let mut stages = [[0.0; N]; STAGES];
        self.solve::<0>(&mut stages, length, &self.slopes, drift);
        let mut evaluated = |time: f64, states: &[f64; N]| derivatives(self.time + time * length, states);
        let slopes = evaluated(METHOD.times[1], &self.moved::<1>(&stages));
        self.solve::<1>(&mut stages, length, &slopes, drift);
        let slopes = evaluated(METHOD.times[2], &self.moved::<2>(&stages));
        self.solve::<2>(&mut stages, length, &slopes, drift);
        let moved = self.moved::<3>(&stages);
        let slopes = evaluated(METHOD.times[3], &moved);
        self.solve::<3>(&mut stages, length, &slopes, drift);
        let mut error = [0.0; N];
        for (weight, stage) in METHOD.error.iter().zip(&stages) {
            error = array::from_fn(|i| error[i] + weight * stage[i]);
        }
        let states = array::from_fn(|i| moved[i] + stages[3][i]);
        let largest = if self.is_within(&states) { self.relative(&states, &error) } else { f64::INFINITY };
        Some(Trial { states, error, largest })
    }

    /// The states at which a stage is evaluated.
    #[allow(clippy::inline_always, reason = "so that each stage's coefficients are constants")]
    #[inline(always)]
    fn moved<const STAGE: usize>(&self, stages: &[[f64; N]; STAGES]) -> [f64; N] {
        let mut moved = self.states;
        for (weight, stage) in METHOD.states[STAGE].iter().zip(stages) {
            moved = array::from_fn(|i| moved[i] + weight * stage[i]);
        }
        moved
    }

    /// Solves the linear equations of a stage.
    #[allow(clippy::inline_always, reason = "so that each stage's coefficients are constants")]
    #[inline(always)]
    fn solve<const STAGE: usize>(
        &self,
        stages: &mut [[f64; N]; STAGES],
        length: f64,
        slopes: &[f64; N],
        drift: &[f64; N],
    ) {
        let (weight, by_time) = (METHOD.gamma * length, METHOD.by_time[STAGE] * length);
        let mut right: [f64; N] = array::from_fn(|i| weight * (slopes[i] + by_time * drift[i]));
        for (share, stage) in METHOD.stages[STAGE].iter().zip(&*stages) {
            let share = METHOD.gamma * share;
            right = array::from_fn(|i| right[i] + share * stage[i]);
        }
        stages[STAGE] = product(&self.inverse, &right);
    }

    /// Accepts or rejects a step to a time on the way to an end, after which there may be none. Returns it if accepted.
    pub(super) fn settle(
        &mut self,
        trial: Option<Trial<N>>,
        length: f64,
        (to, end): (f64, f64),
        is_last: bool,
    ) -> Result<Option<Trial<N>>, StepFailure> {
        let error = trial.as_ref().map_or(f64::INFINITY, |trial| trial.largest);
        // The fourth root instead of the third damps the changes of the length.
        let is_accepted = self.steps.judge(length, error, error.recip().sqrt().sqrt());
        if is_last || self.steps.is_too_short(self.time, end) {
            let state = trial.map_or(0, |trial| self.decisive(&trial));
            return Err(StepFailure { time: self.time, state });
        }
        let trial = trial.filter(|_| is_accepted);
        if let Some(trial) = &trial {
            (self.time, self.states) = (to, trial.states);
            (self.serves, self.is_fresh) = (self.serves - 1, false);
        } else if !self.is_fresh {
            self.serves = 0;
        }
        Ok(trial)
    }

    /// The position of the largest error, or of the first that is not finite or whose state is out of range.
    #[cold]
    fn decisive(&self, trial: &Trial<N>) -> usize {
        let relative = |i: usize| {
            let is_within = (self.min[i]..=self.max[i]).contains(&trial.states[i]);
            let relative = (trial.error[i] * self.weights[i]).abs();
            if relative.is_nan() || !is_within { f64::INFINITY } else { relative }
        };
        (0..N).rev().max_by(|&a, &b| relative(a).total_cmp(&relative(b))).unwrap_or(0)
    }
}

/// The product of a matrix, by columns, and a vector.
#[inline]
pub(super) fn product<const N: usize>(matrix: &[[f64; N]; N], vector: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    // Column by column, so that the sums of all rows are computed in parallel.
    for (column, x) in matrix.iter().zip(vector) {
        for (sum, element) in product.iter_mut().zip(column) {
            *sum += element * x;
        }
    }
    product
}
