//! Event Mode and Intermediate Update Mode of Co-Simulation in FMI 3.0: the trait of models whose events the importer
//! can handle, and with which it can exchange values between internal steps.

use crate::context::Context;
use crate::error::Error;
use crate::events::Events;
use crate::model::{InputsOf, Step, time_rounding};
use crate::model_exchange::ModelExchange;

/// A model that steps itself from event to event (FMI 3.0.2, section 4.2): models of [`Equations`](crate::Equations)
/// and
/// [`Sampled`](crate::Sampled) ones.
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no Event Mode, which `event_mode` in its JSON's capabilities declares",
    note = "models of `Equations` and `Sampled` models have it"
)]
pub trait EventMode: ModelExchange {
    /// Advances over a communication step, or to an earlier stop. Without `events`, the model uses its own.
    ///
    /// # Errors
    /// As [`Model::step`](crate::Model::step).
    #[doc(hidden)]
    fn step_to_event(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        events: Option<&mut Events>,
        stops: Stops,
        context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error>;

    /// The next step begins after an event.
    #[doc(hidden)]
    fn enter_step_mode(&mut self) {}
}

/// Where a communication step stops.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stops {
    pub(crate) events: EventsLeft,
    /// Whether at the end of each internal step, too.
    pub(crate) internal_steps: bool,
}

impl Stops {
    /// None: the model handles its events.
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
    pub(crate) fn time(self) -> f64 {
        let (Self::Event(time) | Self::InternalStep(time)) = self;
        time
    }
}

/// Which of a step's events the importer handles.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventsLeft {
    /// All: the step may end early.
    All,
    /// The event at the end of the step; the model handles earlier events.
    AtEnd,
    /// None.
    None,
}

impl EventsLeft {
    /// Whether they include an event at a time in s, in a step to `end`.
    pub(crate) fn has(self, time: f64, end: f64) -> bool {
        match self {
            Self::All => true,
            Self::AtEnd => time >= end,
            Self::None => false,
        }
    }
}

/// The time in s of a time event due in a step to `end`, if any: an importer's end may be off by rounding.
pub(crate) fn due_until(end: f64, next: Option<f64>) -> Option<f64> {
    let rounding = time_rounding(end);
    let due = next.filter(|next| *next <= end + rounding)?;
    Some(if due < end - rounding { due } else { end })
}
