//! Where a communication step of Co-Simulation stops, in Event Mode and Intermediate Update Mode of FMI 3.0.

use crate::time::End;

/// Where a communication step stops.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stops {
    pub events: EventsLeft,
    /// Whether the step stops at the end of each internal step, too.
    pub internal_steps: bool,
}

impl Stops {
    /// No stops: the model handles its events.
    pub const NONE: Self = Self { events: EventsLeft::None, internal_steps: false };
}

/// Why a communication step stops, and its time in s.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    Event(f64),
    InternalStep(f64),
}

impl Stop {
    #[must_use]
    pub fn time(self) -> f64 {
        let (Self::Event(time) | Self::InternalStep(time)) = self;
        time
    }
}

/// Which of a step's events the importer handles.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventsLeft {
    /// All events: the step may end early.
    All,
    /// The event at the end of the step; the model handles earlier events.
    AtEnd,
    /// No events: the model handles all.
    None,
}

impl EventsLeft {
    /// Whether the importer handles an event at a time in s, in a step to `end`.
    #[must_use]
    pub fn has(self, time: f64, end: f64) -> bool {
        match self {
            Self::All => true,
            Self::AtEnd => time >= end,
            Self::None => false,
        }
    }
}

/// The time in s of a time event due in a step, if any, after one at `last`: what is the same as its end is there.
#[must_use]
pub fn due_until(end: &End, next: Option<f64>, last: f64) -> Option<f64> {
    let due = next.filter(|next| end.has(*next, last))?;
    Some(if end.is_after(due, last) { due } else { end.time })
}
