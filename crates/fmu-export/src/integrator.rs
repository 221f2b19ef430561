//! The built-in integrator of models of equations: an explicit [method](DOP853) for nonstiff phases, linearly implicit
//! (Rosenbrock) [ones](Method) for stiff phases. Unless a model chooses, they take turns as the votes of the steps decide.
//! A method makes a trial step and the polynomials of its dense output; all else they share.
//!
//! The linearly implicit ones are L-stable: they damp modes that are much faster than a step instead of following them.
//! As one-step methods all restart cheaply after an event, and remember only the length of the next step, a Jacobian that
//! serves several steps, and a step that went beyond the present time.
//!
//! The linear equations are dense for few states. For more, the [`System`] gives the pattern of its Jacobian, whose
//! columns are computed in groups and whose factors are sparse; rows with many elements are computed one by one. A
//! product with one more direction checks the pattern whenever the Jacobian is renewed, so that an element that another
//! branch of the equations adds is not missed. A Jacobian serves steps with little error, or any with a method that
//! allows it.
//!
//! A step may go beyond the end that its caller asks for, as far as a [limit](Span::limit): the states up to its end are
//! then those of the dense output, whose error is limited like the step's.
//!
//! Memory for a step is allocated in the first one, in the first that is linearly implicit, where the pattern changes, and
//! for the long rows. It does not belong to a clone.
//!
//! `docs/integrator.md` compares it with other solvers. The crates `diffsol`, `differential-equations` and
//! `ode_solvers` were tried, but none can write its memory as bytes in the middle of a run, which a serialized FMU
//! state needs.

pub(crate) mod dense;
mod explicit;
mod jacobian;
mod method;
mod multirate;
mod pattern;
mod sparse;
mod step_size;
mod switch;
mod system;
#[cfg(test)]
mod tests;

use core::mem;

use crate::error::Error;
use crate::persistence::{Archive, Persistent};
use crate::search::ROUNDINGS;

use jacobian::{Jacobian, Matrix, SMALL_ERROR};
pub use method::{AUTOMATIC, DOP853, Method, RODAS5P, ROS34PW2};
pub use multirate::TwoRates;
pub use pattern::Pattern;
use step_size::StepSize;
use switch::Switch;
pub use system::{Directions, MOST_DENSE, Part, StepFailure, System, Tolerance, TwoParts};

/// The most stages of a method.
const MOST_STAGES: usize = explicit::STAGES;

/// The largest error of the dense output relative to what its slope at [`RESIDUAL_AT`] implies, if it vanishes with its
/// slope at both ends of the step, as θ²·(1 − θ)² does. Where errors decay fast, the slope implies the error there, 9/16
/// of the largest; where slowly, γ·h times the error's slope, for which it would be 1/(3·γ), which is less.
const DENSE_ERROR: f64 = 16.0 / 9.0;
/// Where the slope of the dense output is compared with the derivatives: at a quarter of the step, as that of such an
/// error vanishes in the middle.
const RESIDUAL_AT: f64 = 0.25;

/// The explicit method is not for steps whose length times the estimated magnitude of the largest eigenvalue exceeds
/// this, …
const STIFF: f64 = 0.7 * explicit::STABILITY;
/// … and is for those of the linearly implicit one in which its bound is less.
const NONSTIFF: f64 = 0.3 * explicit::STABILITY;

/// The integrator with its last step.
#[derive(Debug)]
pub struct Integrator {
    size: usize,
    steps: StepSize,
    switch: Switch,
    jacobian: Jacobian,
    /// Whether the last step ended beyond the end that was asked for.
    is_ahead: bool,
    /// A clone has it if it is ahead.
    last: Option<Box<LastStep>>,
    /// Memory for a step. A clone has none, as it is between steps.
    work: Option<Box<Work>>,
}

/// What a step is to integrate, in s.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Its start.
    pub begin: f64,
    /// The last time that is asked for.
    pub end: f64,
    /// How far a step may go beyond it.
    pub limit: f64,
    /// How far rounding may move the end.
    pub rounding: f64,
}

/// From a start to an end, not beyond.
impl From<(f64, f64)> for Span {
    fn from((begin, end): (f64, f64)) -> Self {
        Self { begin, end, limit: end, rounding: 0.0 }
    }
}

/// The last step.
#[derive(Debug)]
struct LastStep {
    /// Its start and end in s, and its length.
    begin: f64,
    end: f64,
    length: f64,
    /// The states at both.
    from: Vec<f64>,
    to: Vec<f64>,
    /// Whether the explicit method took it. If so, its stages can be evaluated again: its start then, and what that
    /// counted from.
    is_explicit: bool,
    begun: f64,
    zero: f64,
    /// The polynomials of the dense output, once they are asked for, and the terms that the explicit method adds.
    dense: Vec<[f64; 3]>,
    higher: Vec<[f64; 3]>,
    has_dense: bool,
}

impl Clone for Integrator {
    fn clone(&self) -> Self {
        let last = self.last.as_ref().filter(|_| self.is_ahead);
        let last = last.map(|last| Box::new(last.kept()));
        Self { jacobian: self.jacobian.clone(), last, work: None, ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        let (last, mut work) = (self.last.take(), self.work.take());
        if let Some(work) = &mut work {
            work.forget();
        }
        let source = source.clone();
        *self = Self { last: source.last.or(last), work, ..source };
    }
}

impl Persistent for Integrator {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.steps.next.persist(archive)?;
        self.switch.persist(archive)?;
        self.jacobian.persist(archive)?;
        self.jacobian.check(self.size)?;
        self.is_ahead.persist(archive)?;
        if !self.is_ahead {
            return Ok(());
        }
        let last = self.last.get_or_insert_with(|| Box::new(LastStep::new(self.size)));
        last.persist(archive)?;
        last.check(self.size)
    }
}

impl Persistent for LastStep {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self { begin, end, length, from, to, is_explicit, begun, zero, dense, has_dense, .. } = self;
        [begin, end, length].into_iter().try_for_each(|time| time.persist(archive))?;
        from.persist(archive)?;
        to.persist(archive)?;
        is_explicit.persist(archive)?;
        *has_dense = !*is_explicit;
        if *is_explicit {
            begun.persist(archive)?;
            zero.persist(archive)
        } else {
            dense.persist(archive)
        }
    }
}

impl LastStep {
    fn new(size: usize) -> Self {
        let vector = || vec![0.0; size];
        Self {
            begin: 0.0,
            end: 0.0,
            length: 0.0,
            from: vector(),
            to: vector(),
            is_explicit: false,
            begun: 0.0,
            zero: 0.0,
            dense: vec![],
            higher: vec![],
            has_dense: false,
        }
    }

    /// Whether the explicit method took it. Code for it is left out where it never does.
    #[inline]
    fn took_explicit<S: System>(&self) -> bool {
        S::METHOD.has_explicit() && self.is_explicit
    }

    /// What a saved state keeps of it: the polynomials, or what is needed to evaluate them again if those are more.
    fn kept(&self) -> Self {
        let Self { from, to, dense, .. } = self;
        let has_dense = self.has_dense && !self.is_explicit;
        let dense = if has_dense { dense.clone() } else { vec![] };
        Self { from: from.clone(), to: to.clone(), dense, higher: vec![], has_dense, ..*self }
    }

    /// Checks what was read for this many states.
    fn check(&self, size: usize) -> Result<(), Error> {
        let Self { begin, end, length, from, to, is_explicit, begun, zero, dense, .. } = self;
        let polynomials = if *is_explicit { &[][..] } else { dense };
        let numbers = [begin, end, length, begun, zero].into_iter().chain(from).chain(to);
        let are_finite = numbers.chain(polynomials.as_flattened()).all(|number| number.is_finite());
        let is_complete = [from.len(), to.len()] == [size; 2] && (*is_explicit || dense.len() == size);
        if is_complete && are_finite && begin < end && *length > 0.0 {
            Ok(())
        } else {
            Err(Error::new("the integrator's step in the serialized state is not one of this model"))
        }
    }

    /// What the dense output adds at a share of the step to the line from its start to its end, divided by
    /// share·(1 − share), and the slope of this.
    fn bulge(&self, state: usize, share: f64) -> [f64; 2] {
        let ([first, second, mut third], mut slope) = (self.dense[state], 0.0);
        if let Some([fourth, fifth, sixth]) = self.higher.get(state) {
            third += share * (fourth + share * (fifth + share * sixth));
            slope = fourth + share * (2.0 * fifth + 3.0 * share * sixth);
        }
        [first + share * (second + share * third), second + share * (2.0 * third + share * slope)]
    }

    /// The states at a time, with dense output.
    fn states_at(&self, time: f64, states: &mut [f64]) {
        if time >= self.end {
            return states.copy_from_slice(&self.to);
        }
        let share = (time - self.begin) / self.length;
        let ends = self.from.iter().zip(&self.to);
        for (i, (state, (from, to))) in states.iter_mut().zip(ends).enumerate() {
            let [bulge, _] = self.bulge(i, share);
            *state = (1.0 - share) * from + share * (to + (1.0 - share) * bulge);
        }
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
        Self {
            size,
            steps: StepSize::new(0.0, f64::INFINITY),
            switch: Switch::new(),
            jacobian: Jacobian::default(),
            is_ahead: false,
            last: None,
            work: None,
        }
    }

    /// Re-estimates the length of the next step, as after a jump.
    pub fn restart(&mut self) {
        self.steps.next = 0.0;
        self.discard();
    }

    /// Forgets what rests on the present parameters: the Jacobian, and a step beyond the present time.
    pub fn discard(&mut self) {
        self.jacobian.discard();
        self.forget_ahead();
    }

    /// Forgets a step beyond the present time.
    pub(crate) fn forget_ahead(&mut self) {
        self.is_ahead = false;
    }

    /// Has times count from another zero.
    pub(crate) fn shift(&mut self, zero: f64) {
        if let (true, Some(last)) = (self.is_ahead, &mut self.last) {
            last.begin -= zero;
            last.end -= zero;
        }
    }

    /// Takes a step from `states`, shortened until its error meets the relative tolerance, unless the last one already
    /// went beyond. Returns the time up to which the [states](Self::states_at) are known: the end of the step, or the
    /// last time that is asked for. `trials` counts, but for trials beyond that.
    ///
    /// # Errors
    /// When even the shortest step misses the tolerance.
    pub fn step<S: System>(
        &mut self,
        system: &mut S,
        span: impl Into<Span>,
        states: &[f64],
        tolerance: &Tolerance<'_>,
        trials: &mut u32,
    ) -> Result<f64, StepFailure> {
        let Self { size, steps, switch, jacobian, is_ahead, last, work } = self;
        let last = last.get_or_insert_with(|| Box::new(LastStep::new(*size)));
        let Span { begin: time, end, mut limit, rounding } = span.into();
        if *is_ahead {
            let rounding = rounding + ROUNDINGS * f64::EPSILON * last.length;
            *is_ahead = last.end > end + rounding;
            return Ok(if last.end < end - rounding { last.end } else { end });
        }
        let work = work.get_or_insert_with(|| Box::new(Work::new(*size, S::METHOD)));
        last.from.copy_from_slice(states);
        (last.begin, last.begun, last.zero) = (time, time, system.zero());
        system.derivatives(time, states, &mut work.slopes);
        *steps = StepSize::new(steps.next, S::LONGEST_STEP);
        if steps.next <= 0.0 {
            let norm = |values| norm::<S>(values, &last.from, tolerance);
            steps.begin(norm(&last.from), norm(&work.slopes));
        }
        last.is_explicit = S::METHOD.is_explicit(switch.is_implicit);
        if !last.took_explicit::<S>() {
            jacobian.expect::<S>(steps.within(time, limit).0);
        }
        work.prepare(last, system, jacobian);
        loop {
            let (length, to) = steps.within(time, limit);
            let is_beyond = to > end + rounding;
            *trials += u32::from(!is_beyond);
            (last.length, last.end, last.has_dense) = (length, to, is_beyond);
            let mut error = work.trial(last, system, jacobian, tolerance);
            if is_beyond && error.largest <= 1.0 {
                work.find_dense(last, system);
                let of_dense = work.dense_error(last, system, tolerance);
                if of_dense.largest > error.largest {
                    error = of_dense;
                }
            }
            if is_beyond && !error.largest.is_finite() {
                // What fails beyond the end is of no concern yet.
                limit = end;
                continue;
            }
            work.decisive = error.state;
            // The error with an older Jacobian says nothing about the length, if the method's order rests on it.
            let is_stale =
                !last.took_explicit::<S>() && !S::METHOD.takes_any_jacobian && !jacobian.is_fresh();
            if is_stale && error.largest > 1.0 {
                jacobian.distrust();
                work.prepare(last, system, jacobian);
                continue;
            }
            let order =
                if last.took_explicit::<S>() { explicit::ESTIMATE_ORDER } else { S::METHOD.estimate_order };
            let factor = if error.largest > 0.0 { error.largest.powf(-order.recip()) } else { f64::INFINITY };
            let is_accepted = steps.judge(length, error.largest, factor);
            // Where ends cut steps short, one with a Jacobian of few states costs less than an explicit one.
            let is_cut = is_accepted && length < steps.next;
            let costs_less = is_cut && *size + S::METHOD.stages.len() < explicit::AT_END.end;
            let takes_over = S::METHOD.switches() && (last.took_explicit::<S>() || !costs_less) && {
                if !last.took_explicit::<S>() && jacobian.is_fresh() && error.largest > SMALL_ERROR {
                    let scale = |state: usize| tolerance.scale::<S>(state, last.from[state]);
                    let is_nonstiff = length * jacobian.radius(scale, &mut work.moved) < NONSTIFF;
                    work.for_other = u32::from(is_nonstiff);
                }
                switch.count(work.for_other)
            };
            if is_accepted {
                if is_stale && steps.next < length {
                    steps.next = length;
                }
                if takes_over {
                    jacobian.discard();
                } else if !last.took_explicit::<S>() {
                    jacobian.count_step::<S>(error.largest);
                }
                *is_ahead = is_beyond;
                return Ok(if is_beyond { end } else { to });
            }
            if steps.is_too_short(time, end) {
                if !(S::METHOD.switches() && last.took_explicit::<S>()) {
                    return Err(StepFailure { time, state: error.state });
                }
                if !takes_over {
                    switch.take_over();
                }
            }
            let was_explicit = mem::replace(&mut last.is_explicit, S::METHOD.is_explicit(switch.is_implicit));
            if was_explicit != last.is_explicit || !(last.took_explicit::<S>() || jacobian.is_fresh()) {
                jacobian.discard();
                work.prepare(last, system, jacobian);
            }
        }
    }

    /// The states at a time in the last step.
    pub fn states_at<S: System>(&mut self, system: &mut S, time: f64, states: &mut [f64]) {
        let Some(last) = &mut self.last else { return };
        if time < last.end && !last.has_dense {
            let work = self.work.get_or_insert_with(|| Box::new(Work::new(self.size, S::METHOD)));
            if last.took_explicit::<S>() && !work.has_stages {
                let zero = system.zero();
                system.count_from(last.zero);
                work.repeat(last, system);
                work.find_dense(last, system);
                system.count_from(zero);
            } else {
                work.find_dense(last, system);
            }
            last.has_dense = true;
        }
        last.states_at(time, states);
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
    /// The derivatives at its start.
    slopes: Vec<f64>,
    by_time: Vec<f64>,
    matrix: Matrix,
    stages: [Vec<f64>; MOST_STAGES],
    moved: Vec<f64>,
    /// Whether the stages are those of the last step.
    has_stages: bool,
    /// How much the last trial speaks for the other method.
    for_other: u32,
    /// The position of the state with the largest error in the last trial.
    decisive: usize,
}

impl Work {
    fn new(size: usize, method: &Method) -> Self {
        let vector = || vec![0.0; size];
        Self {
            slopes: vector(),
            by_time: vector(),
            matrix: Matrix::new(),
            stages: core::array::from_fn(|stage| if stage < method.count() { vector() } else { vec![] }),
            moved: vector(),
            has_stages: false,
            for_other: 0,
            decisive: 0,
        }
    }

    /// Forgets what belongs to another run.
    fn forget(&mut self) {
        self.matrix.forget();
        self.has_stages = false;
    }

    /// Prepares trials of a step. For the linearly implicit method: renews the Jacobian, unless it still serves, and the
    /// derivatives with respect to time.
    fn prepare<S: System>(&mut self, last: &LastStep, system: &mut S, jacobian: &mut Jacobian) {
        let Self { by_time, matrix, .. } = self;
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
    }

    /// Evaluates the stages of the last step again.
    fn repeat<S: System>(&mut self, last: &LastStep, system: &mut S) {
        system.derivatives(last.begun, &last.from, &mut self.slopes);
        self.stages[0].copy_from_slice(&self.slopes);
        // As they were finite, they are.
        for of in [explicit::BEFORE_END, explicit::AT_END] {
            let _ = explicit::evaluate(of, last, system, &mut self.stages, &mut self.moved);
        }
        self.has_stages = true;
    }

    /// Computes the polynomials of the dense output.
    fn find_dense<S: System>(&mut self, last: &mut LastStep, system: &mut S) {
        last.dense.resize(last.from.len(), [0.0; 3]);
        last.higher.clear();
        if last.took_explicit::<S>() {
            // What is not finite is found by the error of the dense output.
            let _ = explicit::evaluate(explicit::OF_DENSE, last, system, &mut self.stages, &mut self.moved);
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

    /// The largest error of the dense output, from the difference between its slope and the derivatives, which the
    /// matrix of the step damps where errors decay fast.
    fn dense_error<S: System>(
        &mut self,
        last: &LastStep,
        system: &mut S,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        let share = if last.took_explicit::<S>() { explicit::RESIDUAL_AT } else { RESIDUAL_AT };
        let rest = 1.0 - share;
        let time = last.begin + share * last.length;
        last.states_at(time, &mut self.moved);
        let residual = &mut self.stages[const { S::METHOD.count() - 1 }];
        system.derivatives(time, &self.moved, residual);
        let ends = last.from.iter().zip(&last.to);
        for (i, (residual, (from, to))) in residual.iter_mut().zip(ends).enumerate() {
            let [bulge, bulge_slope] = last.bulge(i, share);
            let rise = to - from + (rest - share) * bulge + share * rest * bulge_slope;
            *residual -= rise / last.length;
        }
        if last.took_explicit::<S>() {
            for residual in residual.iter_mut() {
                *residual *= last.length;
            }
        } else {
            self.matrix.solve::<S>(residual);
        }
        let weight = if last.took_explicit::<S>() { explicit::DENSE_ERROR } else { DENSE_ERROR };
        let ends = last.from.iter().zip(&last.to);
        LargestError::of(residual.iter().zip(ends).enumerate().map(|(state, (error, (from, to)))| {
            weight * error / tolerance.scale::<S>(state, from.abs().max(to.abs()))
        }))
    }

    /// Tries a step of the last length: computes its stages and its end.
    fn trial<S: System>(
        &mut self,
        last: &mut LastStep,
        system: &mut S,
        jacobian: &mut Jacobian,
        tolerance: &Tolerance<'_>,
    ) -> LargestError {
        self.for_other = 0;
        if last.took_explicit::<S>() {
            self.explicit_trial(last, system, tolerance)
        } else {
            self.implicit_trial(last, system, jacobian, tolerance)
        }
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
        if let Err(state) = explicit::evaluate(explicit::BEFORE_END, last, system, stages, moved) {
            return not_finite(state);
        }
        last.to.copy_from_slice(moved);
        if let Err(state) = explicit::evaluate(explicit::AT_END, last, system, stages, moved) {
            return not_finite(state);
        }
        self.has_stages = true;
        // The states of the last stage before the end, which the next ones replace.
        let before = mem::replace(&mut last.to, mem::take(moved));
        let to = &last.to;
        let scale = |i: usize| tolerance.scale::<S>(i, last.from[i].abs().max(to[i].abs()));
        let relative = |weights: &[f64]| {
            LargestError::of(to.iter().enumerate().map(|(i, to)| {
                let error =
                    weights.iter().zip(&*stages).map(|(weight, stage)| weight * stage[i]).sum::<f64>();
                if to.is_finite() { last.length * error / scale(i) } else { f64::NAN }
            }))
        };
        let (fifth, third) = (relative(explicit::FIFTH_ORDER), relative(explicit::THIRD_ORDER));
        let norm = (fifth.largest * fifth.largest + 0.01 * third.largest * third.largest).sqrt();
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
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
            let too_long = (last.length * rates_differ / (STIFF * states_differ)) as u32;
            // The linearly implicit method would keep its Jacobian.
            self.for_other = too_long.max(u32::from(fifth.largest <= SMALL_ERROR));
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
struct LargestError {
    largest: f64,
    state: usize,
}

impl LargestError {
    /// That of the errors of the states.
    fn of(errors: impl Iterator<Item = f64>) -> Self {
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

/// The largest magnitude of values of the states relative to their allowed errors.
fn norm<S: System>(values: &[f64], states: &[f64], tolerance: &Tolerance<'_>) -> f64 {
    let relative = |(i, value): (usize, &f64)| (value / tolerance.scale::<S>(i, states[i])).abs();
    values.iter().enumerate().map(relative).fold(0.0, f64::max)
}
