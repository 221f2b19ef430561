//! Event Mode of Co-Simulation in FMI 3.0: what a model implements whose events the importer handles.

use crate::error::Error;
use crate::events::Events;
use crate::model::{Context, InputsOf, Step, time_rounding};
use crate::model_exchange::ModelExchange;

/// A model that steps by itself from event to event (FMI 3.0.2, section 4.2): those of [`Equations`](crate::Equations) and
/// [`Sampled`](crate::Sampled) ones.
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no Event Mode, which `event_mode` in the capabilities of its JSON declares",
    note = "models of `Equations` and `Sampled` models have it"
)]
pub trait EventMode: ModelExchange {
    /// Advances over a communication step, or to the first event that is left to the importer: the time of that, in s.
    ///
    /// # Errors
    /// As [`Model::step`](crate::Model::step).
    #[doc(hidden)]
    fn step_to_event(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        events: &mut Events,
        left: EventsLeft,
        context: &mut Context<'_>,
    ) -> Result<Option<f64>, Error>;

    /// The next step begins after an event.
    #[doc(hidden)]
    fn enter_step_mode(&mut self) {}
}

/// Which of a step's events are left to the importer.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventsLeft {
    /// All: the step may end early.
    All,
    /// The one at the end of the step. The model handles those before it.
    AtEnd,
}

impl EventsLeft {
    /// Whether an event at a time in s, in a step to an end, is among them.
    pub(crate) fn has(self, time: f64, end: f64) -> bool {
        self == Self::All || time >= end
    }
}

/// The time in s at which a time event of a step to an end is due, if it is: an importer's end may be off by rounding.
pub(crate) fn due_until(end: f64, next: Option<f64>) -> Option<f64> {
    let rounding = time_rounding(end);
    let due = next.filter(|next| *next <= end + rounding)?;
    Some(if due < end - rounding { due } else { end })
}
