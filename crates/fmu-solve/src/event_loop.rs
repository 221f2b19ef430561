//! The event loop of co-simulation: goes through a communication step from event to event, with the
//! [integrator](crate::integrator) in between.

use crate::display::Seconds;
use crate::integrator::Trials;
use crate::stops::{EventsLeft, Stop, Stops, due_until};
use crate::time::End;

/// Time events that come at least this share of a step after one another do not accumulate: they are at most ten million.
const APART: f64 = 1e-7;
/// The most trials and events are too many where they advance by less than this share of a step.
const ADVANCE: f64 = 0.01;
/// The most trials and events in that share of a step, which must end: ten million in a step, as many as time events may be,
/// minutes for the smallest models.
pub const MOST_TRIALS: u32 = 100_000;
/// Steps after an event start short: with at least one event per this many trials, events are the cause of many trials. A
/// first step changes the states by a hundredth and the next ones are six times as long each, so three more make it
/// usual; these with a rejection each, and the event, are about eight.
pub const MOST_TRIALS_AN_EVENT: u32 = 8;

/// Says that a step from `start` was given up at a `time`, both in s.
#[must_use]
#[cold]
pub fn abandoned(start: f64, time: f64, most_trials: u32) -> String {
    format!(
        "the step from {} s was abandoned at {} s after {most_trials} trials and events",
        Seconds(start),
        Seconds(time)
    )
}

/// States that are integrated between the events of a model.
pub trait Hybrid {
    /// What fails.
    type Error;

    /// The time in s of the next time event.
    fn next_event(&self) -> Option<f64>;

    /// The time in s of the last event.
    fn last_event(&self) -> f64;

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

    /// Handles the event at the present time, and those that it causes at once; `due` is the time in s of a time event,
    /// which may differ from the present one by rounding. Returns whether the simulation goes on.
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
    /// The start and length in s.
    start: f64,
    size: f64,
    end: End,
    /// Whether a time event at the end belongs to the next step.
    samples_inputs: bool,
    /// Whether an event indicator has changed at the present time.
    crossed: bool,
    most_trials: u32,
    trials: u32,
    events: u32,
    /// Where trials and events began to count, and the place of the last time event, in s since the start.
    since: f64,
    last_due: f64,
}

impl EventLoop {
    /// A step from `start` by a size, both in s. If it `samples_inputs`, an event due at its end belongs to the next one.
    /// It fails after `most_trials` of integrator and events that hardly advance, or of which many are events; a time event
    /// apart from the last one starts a new count.
    #[must_use]
    pub fn new((start, size, end): (f64, f64, End), samples_inputs: bool, most_trials: u32) -> Self {
        Self {
            start,
            size,
            end,
            samples_inputs,
            crossed: false,
            most_trials,
            trials: 0,
            events: 0,
            since: 0.0,
            last_due: f64::NEG_INFINITY,
        }
    }

    /// Begins with an event if an indicator `crossed` zero at the start, as of changed inputs.
    #[must_use]
    pub fn after(self, crossed: bool) -> Self {
        Self { crossed, ..self }
    }

    /// Starts a new count at a place in s since the start.
    fn count_from(&mut self, elapsed: f64) {
        (self.trials, self.events, self.since) = (0, 0, elapsed);
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
        let Self { start, size, end, samples_inputs, most_trials, .. } = *self;
        loop {
            let (next, last) = (hybrid.next_event(), hybrid.last_event());
            let due = if STOPS && stops.events != EventsLeft::None {
                due_until(&end, next, last)
            } else {
                next.filter(|&due| if samples_inputs { end.is_after(due, last) } else { end.has(due, last) })
            };
            let is_at_end = hybrid.elapsed() >= size;
            // Events that come ever faster may advance by any share.
            let few_events = self.events < self.trials / MOST_TRIALS_AN_EVENT;
            if few_events && hybrid.elapsed() - self.since >= ADVANCE * size {
                self.count_from(hybrid.elapsed());
            }
            let is_due = due.is_some_and(|due| due - start <= hybrid.elapsed() || is_at_end);
            if self.crossed || is_due {
                if STOPS && stops.events.has(hybrid.time(), end.time) {
                    return Ok(Some(Stop::Event(hybrid.time())));
                }
                if is_due {
                    let elapsed = hybrid.elapsed();
                    if elapsed - self.last_due >= APART * size {
                        self.count_from(elapsed);
                    }
                    self.last_due = elapsed;
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
                let last = size - end.rounding();
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
