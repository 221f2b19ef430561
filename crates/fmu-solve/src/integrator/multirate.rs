//! Integration of a system in two parts, each with its own steps.
//!
//! The fast part does not depend on the slow one and leads in small steps. The slow part follows in large ones, with cubic
//! interpolation between the fast steps.
//!
//! Both use [`ROS34PW2`] with a Jacobian from finite differences that serves many steps; steps of about the same length
//! share the inverse of their matrix. The compiler knows the number of states, so a step costs little more than its
//! evaluations.

use core::{array, mem};

use super::dense;
use super::method::{Method, ROS34PW2};
use super::step_size::{SIMILAR, StepSize};
use super::system::{Part, StepFailure, System, Tolerance, TwoParts};
use super::{Integrator, Trials};
use crate::error::Error;
use crate::persistence::{Archive, Persistent};

const METHOD: &Method = &ROS34PW2;
const STAGES: usize = METHOD.stages.len();

/// The most steps with one Jacobian.
const SERVES: u32 = 25;
/// The difference of a state for the Jacobian, in allowed errors.
const DIFFERENCE: f64 = 1e-2;
/// The difference in time for the drift, relative to the step.
const TIME_DIFFERENCE: f64 = 1e-3;
/// A jump that changes the derivatives by more than this many tolerances over the next step discards the Jacobian.
const JUMP_RENEWS: f64 = 300.0;
/// A larger jump than this many tolerances shortens the step: a long one would damp the fast modes that the jump excites
/// without showing in its error estimate.
const JUMP_SHORTENS: f64 = 30.0;
/// The weights of the stages' values in the slopes at both ends of the polynomial through them, relative to the step.
const STAGE_SLOPES: [[f64; STAGES]; 2] = [slope_weights(0.0), slope_weights(1.0)];
/// The largest value of the cubic with the slope 1 at one end, relative to its length.
const BULGE: f64 = 4.0 / 27.0;
/// The maximum lead of the fast part, in steps.
const MOST_AHEAD: usize = 16;

/// Integrates the first states, `FAST` in number, ahead of the other ones, `SLOW` in number.
#[derive(Clone, Debug)]
pub struct TwoRates<const FAST: usize, const SLOW: usize> {
    fast: Course<FAST>,
    slow: Course<SLOW>,
    /// The derivatives of the slow slopes with respect to each fast state, as old as the slow Jacobian.
    coupling: [[f64; SLOW]; FAST],
    /// Whether the slow slopes may depend on each fast state.
    drives: [bool; FAST],
    /// The fast part's steps that the slow part still needs; none between steps.
    ahead: Vec<FastStep<FAST>>,
    /// The stages of the fast part's last trial.
    stages: Stages<FAST>,
    /// The integrator of all states, for coupled parts.
    together: Integrator,
    /// The position of the state with which the last step failed.
    decisive: usize,
}

impl<const FAST: usize, const SLOW: usize> Persistent for TwoRates<FAST, SLOW> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { fast, slow, coupling, drives: _, ahead: _, stages: _, together, decisive: _ } = self;
        fast.persist(archive)?;
        slow.persist(archive)?;
        coupling.persist(archive)?;
        together.persist(archive)
    }
}

impl<const FAST: usize, const SLOW: usize> TwoRates<FAST, SLOW> {
    /// The integrator of a system with this many states.
    ///
    /// # Panics
    /// When both parts together have another number of states.
    #[must_use]
    pub fn new<S: TwoParts>(size: usize) -> Self {
        assert_eq!(size, FAST + SLOW, "the numbers of states of `TwoRates`");
        Self {
            fast: Course::new(S::range),
            slow: Course::new(|state| S::range(FAST + state)),
            coupling: [[0.0; SLOW]; FAST],
            drives: array::from_fn(|state| S::drives(state, FAST..FAST + SLOW)),
            ahead: vec![],
            stages: [[[0.0; FAST]; 2]; STAGES - 1],
            together: Integrator::new(size),
            decisive: 0,
        }
    }

    /// Jumps are noticed by the derivatives.
    pub fn restart(&mut self) {
        self.together.restart();
    }

    /// Has the Jacobians renewed before the next step.
    pub fn discard_jacobian(&mut self) {
        (self.fast.serves, self.slow.serves) = (0, 0);
        self.together.discard();
    }

    /// Takes all steps to the end, and returns it.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    pub fn step<S: TwoParts>(
        &mut self,
        system: &mut S,
        (time, end): (f64, f64),
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: Trials<'_>,
    ) -> Result<f64, StepFailure> {
        if system.is_coupled() {
            let reached = self.together.step(system, (time, end), states, tolerance, trials.count);
            self.decisive = self.together.decisive_state();
            return reached;
        }
        let Self { fast, slow, coupling, drives, ahead, stages, .. } = self;
        ahead.clear();
        let (mut fast_slopes, mut slow_slopes) = ([0.0; FAST], [0.0; SLOW]);
        system.present_derivatives(split(&mut fast_slopes, &mut slow_slopes));
        let scale = |state: usize| tolerance.scale::<S>(state, states[state]);
        let (fast_states, slow_states) =
            (array::from_fn(|i| states[i]), array::from_fn(|i| states[FAST + i]));
        fast.begin::<S>((time, end), fast_states, fast_slopes, scale);
        slow.begin::<S>((time, end), slow_states, slow_slopes, |i| scale(FAST + i));
        ahead.reserve(MOST_AHEAD);
        let mut parts = Parts { system, fast, drives, ahead, stages, end, trials };
        while slow.time < end {
            if let Err(failure) = parts.step_slow(slow, coupling) {
                self.decisive = failure.state;
                return Err(failure);
            }
        }
        Ok(end)
    }

    /// The states at the end of the last step, or, where the parts are coupled, within it.
    pub fn states_at<S: TwoParts>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        if system.is_coupled() {
            self.together.states_at(system, time, states);
        } else {
            states[..FAST].copy_from_slice(&self.fast.states);
            states[FAST..].copy_from_slice(&self.slow.states);
        }
    }

    /// Takes the derivatives at the end of the last step.
    pub fn end_step<S: TwoParts>(&mut self, system: &S) {
        system.present_derivatives(split(&mut self.fast.slopes, &mut self.slow.slopes));
    }

    /// The position of the state whose error determined the length of the last trial.
    #[must_use]
    pub fn decisive_state(&self) -> usize {
        self.decisive
    }
}

/// Distributes derivatives to both parts.
#[inline]
fn split<const FAST: usize, const SLOW: usize>(
    fast: &mut [f64; FAST],
    slow: &mut [f64; SLOW],
) -> impl FnMut(usize, f64) {
    |state, rate| {
        if state < FAST {
            fast[state] = rate;
        } else {
            slow[state - FAST] = rate;
        }
    }
}

/// The states and derivatives of a step's stages after the first.
type Stages<const N: usize> = [[[f64; N]; 2]; STAGES - 1];

/// An accepted step of the fast part.
#[derive(Clone, Copy, Debug)]
struct FastStep<const N: usize> {
    begin: f64,
    end: f64,
    /// The states and their derivatives at both ends.
    states: [[f64; N]; 2],
    slopes: [[f64; N]; 2],
}

impl<const N: usize> FastStep<N> {
    /// The largest change of a state by which the derivatives at both ends differ from the mean one, relative to the
    /// state's allowed error.
    fn bulge(&self, course: &Course<N>) -> f64 {
        let length = self.end - self.begin;
        let rise: [f64; N] = array::from_fn(|i| self.states[1][i] - self.states[0][i]);
        let relative = |slopes: &[f64; N]| {
            let relative = |i: usize| ((length * slopes[i] - rise[i]) * course.weights[i]).abs();
            (0..N).map(relative).fold(0.0, f64::max)
        };
        relative(&self.slopes[0]).max(relative(&self.slopes[1]))
    }

    /// Replaces the derivatives of a stiff part, which are mostly those of the states' errors, by those of the smooth
    /// solution: with A for the Jacobian J, it follows from x″ = J·x′ + ∂f/∂t that
    ///
    /// ```text
    /// (1 − γ·h·A)·x′ = f + γ·h·(d(f − A·x)/dt − x″),
    /// ```
    ///
    /// which damps the states' errors as in a step. The derivative on the right-hand side is that of the polynomial
    /// through the states and derivatives of the stages, x″ that of the cubic.
    #[inline(never)]
    fn smoothen(&mut self, course: &Course<N>, stages: &Stages<N>) {
        let length = self.end - self.begin;
        let weight = METHOD.gamma * course.inverse_of / length;
        let rise: [f64; N] = array::from_fn(|i| (self.states[1][i] - self.states[0][i]) / length);
        let [first, last] = self.slopes;
        self.slopes = array::from_fn(|end| {
            let [first_weight, weights @ ..] = STAGE_SLOPES[end];
            let [mut states, mut slopes] =
                [self.states[0], first].map(|values| values.map(|value| first_weight * value));
            for (weight, [x, f]) in weights.iter().zip(stages) {
                states = array::from_fn(|i| states[i] + weight * x[i]);
                slopes = array::from_fn(|i| slopes[i] + weight * f[i]);
            }
            let by_states = product(&course.jacobian, &states);
            let here = [first, last][end];
            product(
                &course.inverse,
                &array::from_fn(|i| {
                    let curvature = match end {
                        0 => 6.0 * rise[i] - 4.0 * first[i] - 2.0 * last[i],
                        _ => 2.0 * first[i] + 4.0 * last[i] - 6.0 * rise[i],
                    };
                    here[i] + weight * (slopes[i] - by_states[i] - curvature)
                }),
            )
        });
    }

    /// The states at a time, by the cubic through states and derivatives at both ends.
    fn at(&self, time: f64) -> [f64; N] {
        let length = self.end - self.begin;
        let share = (time - self.begin) / length;
        let rest = 1.0 - share;
        let (from, to) = (rest * rest * (1.0 + 2.0 * share), share * share * (3.0 - 2.0 * share));
        let (first, last) = (length * share * rest * rest, -length * share * share * rest);
        let Self { states, slopes, .. } = self;
        array::from_fn(|i| {
            from * states[0][i] + to * states[1][i] + first * slopes[0][i] + last * slopes[1][i]
        })
    }
}

/// The fast part at work, and what both parts need.
struct Parts<'a, S, const FAST: usize> {
    system: &'a mut S,
    fast: &'a mut Course<FAST>,
    drives: &'a [bool; FAST],
    ahead: &'a mut Vec<FastStep<FAST>>,
    stages: &'a mut Stages<FAST>,
    end: f64,
    trials: Trials<'a>,
}

impl<S: TwoParts, const FAST: usize> Parts<'_, S, FAST> {
    /// The fast states at a time.
    #[inline]
    fn fast_at(&self, time: f64) -> [f64; FAST] {
        let step = self.ahead.iter().find(|step| time < step.end);
        step.map_or(self.fast.states, |step| step.at(time))
    }

    /// The fast derivatives.
    #[inline]
    fn fast<const SLOW: usize>(
        system: &mut S,
        time: f64,
        states: &[f64; FAST],
        slow: &[f64; SLOW],
    ) -> [f64; FAST] {
        let mut slopes = [0.0; FAST];
        system.part_derivatives(
            Part::Fast,
            time,
            |state| if state < FAST { states[state] } else { slow[state - FAST] },
            split(&mut slopes, &mut [0.0; SLOW]),
        );
        slopes
    }

    /// The slow derivatives.
    #[inline]
    fn slow<const SLOW: usize>(
        system: &mut S,
        time: f64,
        fast: &[f64; FAST],
        states: &[f64; SLOW],
    ) -> [f64; SLOW] {
        let mut slopes = [0.0; SLOW];
        system.part_derivatives(
            Part::Slow,
            time,
            |state| if state < FAST { fast[state] } else { states[state - FAST] },
            split(&mut [0.0; FAST], &mut slopes),
        );
        slopes
    }

    /// Advances the fast part at least to a time, or to its maximum lead.
    #[inline(never)]
    fn lead_to<const SLOW: usize>(&mut self, time: f64, slow: &[f64; SLOW]) -> Result<(), StepFailure> {
        let Self { system, fast, ahead, stages, end, trials, .. } = self;
        while fast.time < time && ahead.len() < MOST_AHEAD {
            let is_last = trials.add();
            let (begin, states, slopes) = (fast.time, fast.states, fast.slopes);
            if fast.serves == 0 {
                fast.linearize(|states| Self::fast(system, begin, states, slow));
            }
            let (length, to) = fast.steps.within(begin, *end);
            let mut drift = [0.0; FAST];
            if !system.is_autonomous() {
                let difference = TIME_DIFFERENCE * length;
                let later = Self::fast(system, begin + difference, &states, slow);
                drift = array::from_fn(|i| (later[i] - slopes[i]) / difference);
            }
            let mut stage = 0;
            let trial = fast.trial(length, &drift, |time, states| {
                let slopes = Self::fast(system, time, states, slow);
                (stages[stage], stage) = ([*states, slopes], stage + 1);
                slopes
            });
            if let Some(trial) = fast.settle(trial, length, (to, *end), is_last)? {
                let mut step =
                    FastStep { begin, end: to, states: [states, trial.states], slopes: [slopes; 2] };
                if to < *end {
                    fast.slopes = Self::fast(system, to, &trial.states, slow);
                    step.slopes[1] = fast.slopes;
                } else {
                    // The slopes of the last stage, which is little from it.
                    let [last, slopes] = &stages[STAGES - 2];
                    let by_states = product(&fast.jacobian, &array::from_fn(|i| trial.states[i] - last[i]));
                    step.slopes[1] = array::from_fn(|i| slopes[i] + by_states[i]);
                }
                // Unless errors like this step's are of no consequence.
                if BULGE * length * fast.stiffness * trial.largest > 1.0 && BULGE * step.bulge(fast) > 1.0 {
                    step.smoothen(fast, stages);
                }
                ahead.push(step);
            }
        }
        Ok(())
    }

    /// Tries a step of the slow part.
    #[inline(never)]
    fn step_slow<const SLOW: usize>(
        &mut self,
        slow: &mut Course<SLOW>,
        coupling: &mut [[f64; SLOW]; FAST],
    ) -> Result<(), StepFailure> {
        let is_last = self.trials.add();
        let begin = slow.time;
        if slow.serves == 0 {
            self.linearize(slow, coupling);
        }
        let (mut length, mut to) = slow.steps.within(begin, self.end);
        self.lead_to(to, &slow.states)?;
        if self.fast.time < to {
            to = self.fast.time;
            length = to - begin;
        }
        let difference = TIME_DIFFERENCE * length;
        let (now, later) = (self.fast_at(begin), self.fast_at(begin + difference));
        let mut drift = [0.0; SLOW];
        if self.system.is_autonomous() {
            for state in (0..FAST).filter(|&state| self.drives[state]) {
                let rate = (later[state] - now[state]) / difference;
                drift = array::from_fn(|i| drift[i] + coupling[state][i] * rate);
            }
        } else {
            let later = Self::slow(self.system, begin + difference, &later, &slow.states);
            drift = array::from_fn(|i| (later[i] - slow.slopes[i]) / difference);
        }
        let trial = slow.trial(length, &drift, |time, states| {
            let fast = self.fast_at(time);
            Self::slow(self.system, time, &fast, states)
        });
        let settled = slow.settle(trial, length, (to, self.end), is_last);
        if settled.map_err(|failure| StepFailure { state: FAST + failure.state, ..failure })?.is_some() {
            if to < self.end {
                slow.slopes = Self::slow(self.system, to, &self.fast_at(to), &slow.states);
            }
            let past = self.ahead.iter().take_while(|step| step.end <= to).count();
            self.ahead.drain(..past);
        }
        Ok(())
    }

    /// Renews the slow part's Jacobian and its coupling to the fast part.
    fn linearize<const SLOW: usize>(&mut self, slow: &mut Course<SLOW>, coupling: &mut [[f64; SLOW]; FAST]) {
        let (time, fast) = (slow.time, self.fast_at(slow.time));
        slow.linearize(|states| Self::slow(self.system, time, &fast, states));
        for state in (0..FAST).filter(|&state| self.drives[state]) {
            let mut moved = fast;
            moved[state] += DIFFERENCE / self.fast.weights[state];
            let difference = moved[state] - fast[state];
            let slopes = Self::slow(self.system, time, &moved, &slow.states);
            coupling[state] = array::from_fn(|i| (slopes[i] - slow.slopes[i]) / difference);
        }
    }
}

/// The integration of a part.
#[derive(Clone, Debug)]
struct Course<const N: usize> {
    /// The range of each state; steps beyond it are rejected.
    min: [f64; N],
    max: [f64; N],
    /// The time reached.
    time: f64,
    /// The states at the time reached.
    states: [f64; N],
    /// The derivatives at the time reached; not numbers before the first step.
    slopes: [f64; N],
    /// The reciprocals of the states' errors allowed in a step.
    weights: [f64; N],
    steps: StepSize,
    /// The approximate Jacobian, by columns.
    jacobian: [[f64; N]; N],
    /// The Jacobian's norm, of states and derivatives relative to the states' allowed errors, in 1/s.
    stiffness: f64,
    /// The number of remaining steps with the Jacobian; 0 if there is none.
    serves: u32,
    /// Whether no step was accepted with the Jacobian yet.
    is_fresh: bool,
    /// The inverse of 1 − γ·h·J, by columns.
    inverse: [[f64; N]; N],
    /// The length h of the inverse; 0 if there is none.
    inverse_of: f64,
}

/// A step that was tried.
struct Trial<const N: usize> {
    states: [f64; N],
    /// The estimated errors of the states.
    error: [f64; N],
    /// The largest error relative to what is allowed; infinite if an error or a state is not finite, or a state out of
    /// its range.
    largest: f64,
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
    fn new(range: impl Fn(usize) -> [f64; 2]) -> Self {
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
    fn begin<S: System>(
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
        if jump > JUMP_RENEWS {
            self.serves = 0;
        }
        if jump > JUMP_SHORTENS {
            self.steps.next = length * (JUMP_SHORTENS / jump).sqrt().sqrt();
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
    fn linearize(&mut self, mut derivatives: impl FnMut(&[f64; N]) -> [f64; N]) {
        let mut changes = [0.0; N];
        for column in 0..N {
            let mut moved = self.states;
            moved[column] += DIFFERENCE / self.weights[column];
            let reciprocal = (moved[column] - self.states[column]).recip();
            let slopes = derivatives(&moved);
            self.jacobian[column] = array::from_fn(|row| (slopes[row] - self.slopes[row]) * reciprocal);
            let allowed = self.weights[column].recip();
            changes = array::from_fn(|row| changes[row] + (self.jacobian[column][row] * allowed).abs());
        }
        self.stiffness = (0..N).map(|row| changes[row] * self.weights[row]).fold(0.0, f64::max);
        (self.serves, self.is_fresh, self.inverse_of) = (SERVES, true, 0.0);
    }

    /// Prepares a step of a length. Returns whether its linear equations have a solution.
    fn prepare(&mut self, length: f64) -> bool {
        if (self.inverse_of - length).abs() <= SIMILAR * length {
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
    fn trial(
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
    fn settle(
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
fn product<const N: usize>(matrix: &[[f64; N]; N], vector: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    // Column by column, so that the sums of all rows are computed in parallel.
    for (column, x) in matrix.iter().zip(vector) {
        for (sum, element) in product.iter_mut().zip(column) {
            *sum += element * x;
        }
    }
    product
}

/// The derivatives, at one of the stages' times, of Lagrange's polynomials through them.
const fn slope_weights(at: f64) -> [f64; STAGES] {
    let (times, mut weights, mut i) = (METHOD.times, [0.0; STAGES], 0);
    while i < STAGES {
        let mut left_out = 0;
        while left_out < STAGES {
            let (mut product, mut j) = (1.0, 0);
            while j < STAGES {
                if j == left_out && j != i {
                    product /= times[i] - times[j];
                } else if j != i && left_out != i {
                    product *= (at - times[j]) / (times[i] - times[j]);
                }
                j += 1;
            }
            if left_out != i {
                weights[i] += product;
            }
            left_out += 1;
        }
        i += 1;
    }
    weights
}
