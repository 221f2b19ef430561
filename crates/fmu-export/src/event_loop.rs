//! The event loop of co-simulation: goes through a communication step from event to event, with the
//! [integrator](crate::integrator) in between.

use crate::integrator::Trials;
use crate::search::ROUNDINGS;
use crate::stops::{Stop, Stops, due_until};
use crate::time::time_rounding;

/// An event due this shortly after a communication step, relative to the step and beyond the rounding of the time,
/// belongs to the step: importers' times are subject to rounding.
pub const TIME_TOLERANCE: f64 = 1e-9;

/// States that are integrated between the events of a model.
pub trait Hybrid {
    /// What fails.
    type Error;

    /// The time in s of the next time event.
    fn next_event(&self) -> Option<f64>;

    /// The present time in s.
    fn time(&self) -> f64;

    /// The present time in s since the communication step's start, where rounding of the absolute time may exceed the step.
    fn elapsed(&self) -> f64;

    /// Takes a step of the integrator, at most to a target in s since the communication step's start, or to the first
    /// event in it. Returns whether an event indicator has changed there.
    ///
    /// # Errors
    /// When the states cannot be integrated, though there were not too many trials.
    fn integrate(&mut self, target: f64, trials: Trials<'_>) -> Result<bool, Self::Error>;

    /// Handles the event at the present time, and those that it causes at once; `due` is the time in s of a time event.
    /// Returns whether the simulation goes on.
    ///
    /// # Errors
    /// When the model cannot continue.
    fn handle(&mut self, due: Option<f64>) -> Result<bool, Self::Error>;

    /// The error of a step with more than the most trials, some of which were events.
    fn abandoned(&self, most_trials: u32, events: u32) -> Self::Error;
}

/// A communication step on its way from event to event.
#[derive(Clone, Copy, Debug)]
pub struct EventLoop {
    /// The start, length and end in s.
    start: f64,
    size: f64,
    end: f64,
    /// Time events until then, in s, belong to the step.
    last_event: f64,
    /// Whether an event indicator has changed at the present time.
    crossed: bool,
    most_trials: u32,
    trials: u32,
    events: u32,
}

impl EventLoop {
    /// A step from `start` to `end`, both in s. If it `samples_inputs`, an event due at its end belongs to the next one.
    /// After `most_trials` of integrator and events it fails.
    #[must_use]
    pub fn new((start, size, end): (f64, f64, f64), samples_inputs: bool, most_trials: u32) -> Self {
        let coincidence = TIME_TOLERANCE * size + time_rounding(end);
        let last_event = if samples_inputs { end - coincidence } else { end + coincidence };
        Self { start, size, end, last_event, crossed: false, most_trials, trials: 0, events: 0 }
    }

    /// Begins with an event if an indicator `crossed` zero at the start, as of changed inputs.
    #[must_use]
    pub fn after(self, crossed: bool) -> Self {
        Self { crossed, ..self }
    }

    /// Goes to the end of the step, or, with `STOPS`, to an earlier stop, after which it may go on.
    ///
    /// # Errors
    /// When the states cannot be integrated or the model cannot continue.
    #[allow(clippy::inline_always, reason = "apart from its caller it costs instructions in each step")]
    #[inline(always)]
    pub fn go_on<const STOPS: bool, H: Hybrid>(
        &mut self,
        hybrid: &mut H,
        stops: Stops,
    ) -> Result<Option<Stop>, H::Error> {
        let Self { start, size, end, last_event, most_trials, .. } = *self;
        loop {
            let next = hybrid.next_event();
            let due = if STOPS { due_until(end, next) } else { next.filter(|&due| due <= last_event) };
            let is_at_end = hybrid.elapsed() >= size;
            let is_due = due.is_some_and(|due| due - start <= hybrid.elapsed() || is_at_end);
            if self.crossed || is_due {
                if STOPS && stops.events.has(hybrid.time(), end) {
                    return Ok(Some(Stop::Event(hybrid.time())));
                }
                self.trials += 1;
                self.events += 1;
                if !hybrid.handle(due.filter(|_| is_due))? {
                    return Ok(None);
                }
                self.crossed = false;
            } else if is_at_end {
                return Ok(None);
            } else {
                // One that rounding puts before the end is at the end.
                let last = size - ROUNDINGS * f64::EPSILON * end.abs();
                let due = due.map(|due| due - start).filter(|due| *due < last);
                let trials = Trials { count: &mut self.trials, most: most_trials };
                self.crossed = hybrid.integrate(due.unwrap_or(size), trials)?;
                if STOPS && stops.internal_steps && !self.crossed && hybrid.elapsed() < size {
                    return Ok(Some(Stop::InternalStep(hybrid.time())));
                }
            }
            if self.trials > most_trials {
                return Err(hybrid.abandoned(most_trials, self.events));
            }
        }
    }
}
