//! Model Exchange: what a model implements whose states the importer integrates.

use crate::error::Error;
use crate::events::Event;
use crate::model::{Context, InputsOf, Model};

/// A model for Model Exchange (FMI 2.0.5, chapter 3), with events where it has them.
///
/// Its derivatives, locals and outputs are computed by [`Model::refresh`] from the time, the inputs and the states,
/// wherever the importer's solver tries them: between two events smoothly, also a little beyond a place where an event
/// is due. A branch that changes at an event is chosen by what [`ModelExchange::event`] remembers in the model. A solver
/// may try states that a real model never has; derivatives that are not finite make it try a shorter step.
///
/// Models of [`Equations`](crate::Equations) and [`Sampled`](crate::Sampled) ones have all of this.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be exported for Model Exchange",
    note = "models of `Equations` and `Sampled` models can be, and others that implement `ModelExchange`"
)]
pub trait ModelExchange: Model {
    /// Computes the event indicators, one for each name in the model's JSON, once [`Model::refresh`] has computed the
    /// variables. An event is where one of them becomes positive, or no longer is; they should be of order one.
    /// What it changes in `variables` is lost at the next [`Model::refresh`].
    fn event_indicators(
        &self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        indicators: &mut [f64],
    ) {
        let _ = (time, variables, inputs, indicators);
    }

    /// When the next event after a time (s) is due, whatever the states are then. Asked for at each event.
    fn next_event(&self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<Self>) -> Option<f64> {
        let _ = (time, variables, inputs);
        None
    }

    /// Does what happens at an event: changes the model's memory, the states, and discrete variables.
    /// [`Model::refresh`] follows it. Where that changes the sign of an indicator, there is another event at once.
    ///
    /// # Errors
    /// When the model cannot go on.
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
