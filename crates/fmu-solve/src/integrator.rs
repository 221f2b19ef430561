//! The built-in integrator of models of equations: an explicit [method](DOP853) for nonstiff phases, linearly implicit
//! (Rosenbrock) [ones](Method) for stiff phases. Unless a model chooses, they take turns as the votes of the steps decide.
//! A method makes a trial step and the polynomials of its dense output; all else they share.
//!
//! The linearly implicit ones are L-stable: they damp modes that are much faster than a step instead of following them.
//! As one-step methods all restart cheaply after an event, and remember only the length of the next step, a Jacobian that
//! serves several steps, and a step that went beyond the present time.
//!
//! The linear equations are dense for few states. For more, the [`System`] gives the pattern of its Jacobian, whose
//! columns are computed in groups and whose factors are sparse; rows with many elements are computed one by one, all
//! rows of a full Jacobian if that costs less. A product with one more direction checks the pattern whenever the
//! Jacobian is renewed, so that an element that another branch of the equations adds is not missed. A Jacobian serves
//! steps with little error, or any with a method that allows it.
//!
//! A step may go beyond the end that its caller asks for, as far as a [limit](Span::limit): the states up to its end are
//! then those of the dense output, whose error is limited like the step's. Its caller compares the derivatives at each time
//! that it asks for with what the step lets expect, and gives the step up where they differ.
//!
//! Memory for a step is allocated in the first one, in the first that is linearly implicit, where the pattern changes, and
//! for rows that are computed one by one. It does not belong to a clone.
//!
//! `docs/integrator.md` compares it with other solvers. The crates `diffsol`, `differential-equations` and
//! `ode_solvers` were tried, but none can write its memory as bytes in the middle of a run, which a serialized FMU
//! state needs.

pub(crate) mod dense;
mod explicit;
mod jacobian;
mod last_step;
mod method;
mod multirate;
mod pattern;
mod sparse;
mod step_size;
mod switch;
mod system;
#[cfg(test)]
mod tests;
mod work;

use crate::error::Error;
use crate::persistence::{Archive, Persistent};
use crate::search::ROUNDINGS;

pub use jacobian::check_direction;
use jacobian::{Jacobian, SMALL_ERROR};
use last_step::LastStep;
pub use method::{AUTOMATIC, DOP853, Method, RODAS5P, ROS34PW2};
pub use multirate::TwoRates;
pub use pattern::Pattern;
use step_size::StepSize;
use switch::{Switch, votes};
pub use system::{Directions, Part, StepFailure, System, Tolerance, TwoParts};
use work::Work;

/// The explicit method is for steps of the linearly implicit one whose length times the bound of the magnitudes of the
/// eigenvalues is less, if both cost as much. For each step that one of the linearly implicit one costs more, this may be
/// larger by the stability limit. [Chosen](crate::chosen), less than half of what makes a step stiff, so that the methods do
/// not go back and forth: the magnitudes are bounds.
const NONSTIFF: f64 = 0.3 * explicit::STABILITY;

/// The most states for which solutions with kept factors take less time than the evaluations that they save.
/// [Chosen](crate::chosen).
const MOST_SAVING: usize = 20;

/// The integrator with its last step.
#[derive(Debug)]
pub struct Integrator {
    size: usize,
    steps: StepSize,
    switch: Switch,
    jacobian: Jacobian,
    /// Whether the last step ended beyond the end that was asked for.
    is_ahead: bool,
    /// The last step. A clone has it if it is ahead.
    last: Option<Box<LastStep>>,
    /// Memory for a step. A clone has none, as it is between steps.
    work: Option<Box<Work>>,
}

/// What a step is to integrate, in s.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// The start of the span.
    pub begin: f64,
    /// The last time that is asked for.
    pub end: f64,
    /// The latest time that a step may reach beyond the end.
    pub limit: f64,
    /// How far rounding may move the end.
    pub rounding: f64,
}

/// The span from a start to an end, not beyond.
impl From<(f64, f64)> for Span {
    fn from((begin, end): (f64, f64)) -> Self {
        Self { begin, end, limit: end, rounding: 0.0 }
    }
}

impl Clone for Integrator {
    fn clone(&self) -> Self {
        let last = self.ahead().map(|last| Box::new(last.kept()));
        Self { jacobian: self.jacobian.kept(self.needs_jacobian()), last, work: None, ..*self }
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
        self.is_ahead.persist(archive)?;
        if self.is_ahead {
            let last = self.last.get_or_insert_with(|| Box::new(LastStep::new(self.size)));
            last.persist(archive)?;
            last.check(self.size)?;
        }
        self.jacobian.check(self.size, self.needs_jacobian())
    }
}

/// The trials of a communication step.
#[derive(Debug)]
pub struct Trials<'a> {
    /// The number of trials.
    pub count: &'a mut u32,
    /// The number after which the step fails.
    pub most: u32,
}

impl Trials<'_> {
    /// Counts a trial. Returns whether it is one too many.
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

    /// The last step, if it ended beyond the end that was asked for.
    fn ahead(&self) -> Option<&LastStep> {
        self.last.as_deref().filter(|_| self.is_ahead)
    }

    /// Whether the check of the last step needs its Jacobian.
    fn needs_jacobian(&self) -> bool {
        self.ahead().is_some_and(|last| !last.is_explicit)
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
    pub fn forget_ahead(&mut self) {
        self.is_ahead = false;
    }

    /// Has times count from another zero.
    pub fn shift(&mut self, zero: f64) {
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
        if !S::METHOD.is_explicit(switch.is_implicit) {
            jacobian.expect::<S>(steps.within(time, limit).0);
        }
        work.prepare(last, switch, system, jacobian);
        loop {
            let (length, to) = steps.within(time, limit);
            let is_beyond = to > end + rounding;
            *trials += u32::from(!is_beyond);
            (last.length, last.end, last.has_dense) = (length, to, is_beyond);
            let error = if is_beyond {
                // What fails beyond the end is of no concern yet.
                let tried = S::attempt(|| work.trial_beyond(last, system, jacobian, tolerance));
                let Some(error) = tried.filter(|error| error.largest.is_finite()) else {
                    limit = end;
                    continue;
                };
                error
            } else {
                work.trial(last, system, jacobian, tolerance)
            };
            work.decisive = error.state;
            // The error with an older Jacobian says nothing about the length, if the method's order rests on it.
            let is_stale =
                !last.took_explicit::<S>() && !S::METHOD.takes_any_jacobian && !jacobian.is_fresh();
            if is_stale && error.largest > 1.0 {
                jacobian.distrust();
                work.prepare(last, switch, system, jacobian);
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
                if last.took_explicit::<S>() {
                    let saves = work.would_keep && *size <= chosen!(MOST_SAVING);
                    work.for_other = work.for_other.max(u32::from(saves));
                } else if jacobian.is_fresh() && error.largest > chosen!(SMALL_ERROR) {
                    let scale = |state: usize| tolerance.scale::<S>(state, last.from[state]);
                    // How long it would be for its error, unless the limit cut it short.
                    let length = if to < limit { length * factor.max(1.0) } else { length };
                    let longest = chosen!(NONSTIFF) + f64::from(switch.price - 1) * explicit::STABILITY;
                    work.for_other = votes(longest / (length * jacobian.radius(scale, &mut work.moved)));
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
            let is_explicit = S::METHOD.is_explicit(switch.is_implicit);
            if last.is_explicit != is_explicit || !(is_explicit || jacobian.is_fresh()) {
                jacobian.discard();
                work.prepare(last, switch, system, jacobian);
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

    /// Whether the derivatives at a time in a step that went beyond are what its dense output lets expect. Otherwise there
    /// is something that the stages of the step have missed. `take` writes the derivatives.
    pub fn agrees<S: System>(
        &mut self,
        time: f64,
        tolerance: &Tolerance<'_>,
        take: impl FnOnce(&mut [f64]),
    ) -> bool {
        let Self { size, jacobian, is_ahead, last, work, .. } = self;
        let Some(last) = last.as_deref().filter(|_| *is_ahead) else { return true };
        let work = work.get_or_insert_with(|| Box::new(Work::new(*size, S::METHOD)));
        take(&mut work.moved);
        let share = (time - last.begin) / last.length;
        work.agrees::<S>(last, jacobian, share, tolerance)
    }

    /// The position of the state whose error determined the length of the last trial.
    #[must_use]
    pub fn decisive_state(&self) -> usize {
        self.work.as_ref().map_or(0, |work| work.decisive)
    }
}

/// The largest magnitude of values of the states relative to their allowed errors.
fn norm<S: System>(values: &[f64], states: &[f64], tolerance: &Tolerance<'_>) -> f64 {
    let relative = |(i, value): (usize, &f64)| (value / tolerance.scale::<S>(i, states[i])).abs();
    values.iter().enumerate().map(relative).fold(0.0, f64::max)
}
