//! Models of equations: what is computed from time, parameters, inputs and states, written once and generic over the
//! number type. The runtime makes everything else of it: co-simulation by its integrator, Model Exchange, and exact
//! derivatives.

use crate::error::Error;
use crate::events::Event;
use crate::model::{Context, Variables};
use crate::number::Number;
use crate::persistence::Persistent;

/// A model of ordinary differential equations, with events where it has them.
///
/// ```ignore
/// fmu_export::fmu!(equations struct VanDerPol);
///
/// impl Equations for VanDerPol {
///     type Variables = Variables;
///
///     fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
///         let Evaluation { parameters, states, derivatives, .. } = variables;
///         derivatives.x0 = states.x1;
///         derivatives.x1 = parameters.mu * (-states.x0.powi(2) + 1.0) * states.x1 - states.x0;
///     }
/// }
/// ```
///
/// The fields of the struct are what the model remembers from event to event, such as the branch that it is on; `Clone`
/// and [`Persistent`] must copy and hand out the whole of it, as in [`Model`](crate::Model).
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Equations`: write `fmu!({Self})`, `fmu!(sampled {Self})` or `fmu!(clocked {Self})` if it implements \
               `Model`, `Sampled` or `Clocked`",
    label = "exported as an `Equations`"
)]
pub trait Equations: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables<Of<f64> = Self::Variables>;

    /// Computes derivatives, locals and outputs from time (s), parameters, inputs and states.
    ///
    /// Between two events the result must be smooth in time, inputs and states, also a little beyond a place where an
    /// event is due: a branch that changes at an event is chosen by what [`Equations::event`] remembers in the model.
    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>);

    /// Refuses parameters that contradict each other.
    ///
    /// # Errors
    /// A message that names the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Prepares the model, before anything is computed: reads files of the FMU, say. Called at each initialization, on a
    /// new model.
    ///
    /// # Errors
    /// When the model cannot start.
    fn prepare(&mut self, variables: &mut Self::Variables, context: &mut Context<'_>) -> Result<(), Error> {
        let _ = (variables, context);
        Ok(())
    }

    /// Computes the states to begin with that are not the start values, which all states have before.
    fn initialize<T: Number>(&self, variables: &mut VariablesOf<Self, T>) {
        let _ = variables;
    }

    /// Computes the event indicators, one for each name in the model's JSON, once [`Equations::evaluate`] has computed
    /// the variables. An event is where one of them becomes positive, or no longer is; they should be of order one.
    fn event_indicators(&self, time: f64, variables: &Self::Variables, indicators: &mut [f64]) {
        let _ = (time, variables, indicators);
    }

    /// When the next event after a time (s) is due, whatever the states are then. Asked for at each event. The first one
    /// may be due at the start time.
    fn next_event(&self, time: f64, variables: &Self::Variables) -> Option<f64> {
        let _ = (time, variables);
        None
    }

    /// Does what happens at an event: changes the model's memory, the states, and discrete variables. It may also be
    /// called where nothing has to happen, as where an indicator returns to its side. Where the sign of an indicator is
    /// another one after it, there is another event at once.
    ///
    /// # Errors
    /// When the model cannot go on.
    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (event, variables, context);
        Ok(())
    }
}

/// The variables of a model of equations over a number type.
pub type VariablesOf<E, T> = <<E as Equations>::Variables as Variables>::Of<T>;

/// What the equations of a model read and calculate, over a number type.
pub type EvaluationOf<'a, E, T> = <<E as Equations>::Variables as Variables>::Evaluation<'a, T>;

/// Evaluates the equations of a model.
pub(crate) fn evaluate<E: Equations, T: Number>(equations: &E, time: T, variables: &mut VariablesOf<E, T>) {
    equations.evaluate(time, E::Variables::evaluation(variables));
}
