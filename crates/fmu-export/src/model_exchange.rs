//! Model Exchange: the trait of models whose states the importer integrates.

use crate::context::Context;
use crate::error::Error;
use crate::events::Event;
use crate::model::{InputsOf, Model};

/// A model for Model Exchange (FMI 2.0.5, chapter 3), optionally with events.
///
/// [`Model::refresh`] computes derivatives, locals and outputs from time, inputs and states, for any values that the
/// importer's solver tries. Between events the result must be smooth, even slightly beyond the point where an event is
/// due: only [`ModelExchange::event`] switches branches, which the model stores. A solver may try states that never
/// occur; non-finite derivatives make it try a shorter step.
///
/// Models of [`Equations`](crate::Equations) and [`Sampled`](crate::Sampled) ones implement all of this.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be exported for Model Exchange",
    note = "models of `Equations` and `Sampled` models can be, and others that implement `ModelExchange`"
)]
pub trait ModelExchange: Model {
    /// Computes the event indicators, one per name in the model's JSON, after [`Model::refresh`] has computed the
    /// variables. An event occurs where an indicator becomes positive, or ceases to be; indicators should be of order
    /// one. Its changes to `variables` are lost at the next [`Model::refresh`].
    fn event_indicators(
        &self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        indicators: &mut [f64],
    ) {
        let _ = (time, variables, inputs, indicators);
    }

    /// When the next time event after a time (s) is due; it must not depend on the states. Called at each event.
    fn next_event(&self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<Self>) -> Option<f64> {
        let _ = (time, variables, inputs);
        None
    }

    /// Handles an event: changes the model's memory, states and discrete variables. [`Model::refresh`] follows. If
    /// that changes the sign of an indicator, another event follows at once.
    ///
    /// # Errors
    /// When the model cannot continue.
    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (event, variables, inputs, context);
        Ok(())
    }
}
