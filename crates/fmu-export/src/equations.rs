//! Models of equations: what is computed from time, parameters, inputs and states, written once and generic over the
//! number type. The runtime makes everything else of it: co-simulation by its integrator, and exact derivatives.

use crate::error::Error;
use crate::model::Variables;
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
///     fn evaluate<T: Number>(&self, _time: T, variables: &mut Variables<T>) {
///         let Variables { parameters, states, derivatives, .. } = variables;
///         derivatives.x0 = states.x1;
///         derivatives.x1 = parameters.mu * (-states.x0.powi(2) + 1.0) * states.x1 - states.x0;
///     }
/// }
/// ```
///
/// The fields of the struct are what the model remembers from event to event, such as the branch that it is on; `Clone`
/// and [`Persistent`] must copy and hand out the whole of it, as in [`Model`](crate::Model).
pub trait Equations: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables<Of<f64> = Self::Variables>;

    /// The number of event indicators.
    const EVENT_INDICATORS: usize = 0;

    /// Computes derivatives, locals and outputs from time (s), parameters, inputs and states.
    ///
    /// Between two events the result must be smooth in time, inputs and states, also a little beyond a place where an
    /// event is due: a branch that changes at an event is chosen by what [`Equations::event`] remembers in the model.
    fn evaluate<T: Number>(&self, time: T, variables: &mut VariablesOf<Self, T>);

    /// Refuses parameters that contradict each other.
    ///
    /// # Errors
    /// A message that names the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Computes the states to begin with that are not the start values, which all states have before.
    fn initialize<T: Number>(&self, variables: &mut VariablesOf<Self, T>) {
        let _ = variables;
    }

    /// Computes the event indicators, once [`Equations::evaluate`] has computed the variables. An event is where one
    /// of them becomes positive, or no longer is.
    fn event_indicators(&self, time: f64, variables: &Self::Variables, indicators: &mut [f64]) {
        let _ = (time, variables, indicators);
    }

    /// When the next event after a time (s) is due, whatever the states are then. Asked for at each event.
    fn next_event(&self, time: f64, variables: &Self::Variables) -> Option<f64> {
        let _ = (time, variables);
        None
    }

    /// Does what happens at an event: changes the model's memory, the states, and discrete variables. It may also be
    /// called where nothing has to happen, as where an indicator returns to its side.
    ///
    /// # Errors
    /// When the model cannot go on.
    fn event(&mut self, event: &Event<'_>, variables: &mut Self::Variables) -> Result<(), Error> {
        let _ = (event, variables);
        Ok(())
    }
}

/// The variables of a model of equations over a number type.
pub type VariablesOf<E, T> = <<E as Equations>::Variables as Variables>::Of<T>;

/// Why there is an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event<'a> {
    /// The time in s. For an event of [`Equations::next_event`] that very number.
    pub time: f64,
    /// Whether it is the one at the start, where the model finds the branches that it begins on.
    pub is_initial: bool,
    /// Whether the time of [`Equations::next_event`] is reached.
    pub is_due: bool,
    /// Which event indicators have become positive or no longer are.
    pub indicators: &'a [bool],
}
