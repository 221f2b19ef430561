//! Models defined by equations of time, parameters, inputs and states, generic over the number type. The runtime
//! derives the rest: co-simulation with its integrator, Model Exchange, and exact derivatives.

use fmu_solve::integrator::Part;
use fmu_solve::persistence::Persistent;
use fmu_solve::{Dual, Error, Event, Integration, Number};

use crate::model::context::Context;
use crate::model::variables::{Numbered, Variables};

/// A model of ordinary differential equations, optionally with events.
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
/// The struct's fields are what the model remembers between events, such as the active branch; `Clone` and
/// [`Persistent`] must cover all of them, as in [`Stepper`](crate::Stepper).
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Equations`: write `fmu!(sampled {Self})` or `fmu!(stepper {Self})` if it implements \
               `Sampled` or `Stepper`",
    label = "exported as an `Equations`"
)]
pub trait Equations: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables;

    /// The longest communication step in seconds, as in [`Stepper`](crate::Stepper).
    const LONGEST_STEP: f64 = f64::MAX;

    /// The settings of the built-in integrator.
    const INTEGRATION: Integration<Self::Variables> = Integration::DEFAULT;

    /// Computes derivatives, locals and outputs from time (s), parameters, inputs and states.
    ///
    /// Between events the result must be smooth in time, inputs and states, even slightly beyond where an event is
    /// due: only
    /// [`Equations::event`] switches branches, which the model stores.
    fn evaluate<T: Number>(&self, time: T, variables: EvaluationOf<'_, Self, T>);

    /// [`Equations::evaluate`] for plain numbers. Override it to compute with fields that
    /// [`Equations::take_parameters`] derived.
    fn evaluate_values(&self, time: f64, variables: EvaluationOf<'_, Self, f64>) {
        self.evaluate(time, variables);
    }

    /// Rejects contradictory parameters.
    ///
    /// # Errors
    /// A message with the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Prepares the model, for example reads resource files. Called at each initialization, on a new model, before
    /// [`Equations::calculate_parameters`]; until then calculated parameters are 0.
    ///
    /// # Errors
    /// When the model cannot start.
    fn prepare(&mut self, variables: &mut Self::Variables, context: &mut Context<'_>) -> Result<(), Error> {
        let _ = (variables, context);
        Ok(())
    }

    /// Calculates the *variables* that depend on parameters only: all calculated parameters, and all locals whose
    /// variability is `fixed` or `tunable`. No other hook sets them. Called after [`Equations::prepare`], after each
    /// change of tunable parameters, and in each derivative with respect to parameters.
    ///
    /// [`Equations::take_parameters`] stores values that depend on parameters only and are not variables in the model's
    /// fields.
    fn calculate_parameters<T: Number>(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<T>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<T>,
    ) {
        let _ = (parameters, calculated);
    }

    /// Derives the model's *fields* that depend on parameters only, such as tables. Called after
    /// [`Equations::calculate_parameters`], whenever that is, and for a restored state. [`Equations::evaluate`] reads
    /// parameters and calculated parameters instead, because fields have no derivatives.
    fn take_parameters(&mut self, variables: &Self::Variables) {
        let _ = variables;
    }

    /// Computes initial states that differ from the start values. Called after [`Equations::take_parameters`], with all
    /// states at their start values.
    fn initialize<T: Number>(&self, variables: &mut VariablesOf<Self, T>) {
        let _ = variables;
    }

    /// Whether the initial states have derivatives, if [`Equations::initialize`] solves for them.
    ///
    /// # Errors
    /// Why they have none.
    fn check_start(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Computes the event indicators, one per name in the model's JSON, after [`Equations::evaluate`] has computed the
    /// variables. An event occurs where an indicator becomes positive, or ceases to be; indicators should be of order
    /// one.
    fn event_indicators(&self, time: f64, variables: &Self::Variables, indicators: &mut [f64]) {
        let _ = (time, variables, indicators);
    }

    /// When the next time event after a time (s) is due; it must not depend on the states. Called at each event, and again
    /// before the next step when inputs or tunable parameters may have changed, so do not count from `time`, which is
    /// then between events. An event that has moved to an earlier time is due at once, as is the one that is due now. The
    /// first may be due at the start time.
    fn next_event(&self, time: f64, variables: &Self::Variables) -> Option<f64> {
        let _ = (time, variables);
        None
    }

    /// Handles an event: changes the model's memory, states and discrete variables. It may be called with nothing to
    /// do, for example when an indicator returns to its previous side. If an indicator's sign differs afterwards,
    /// another event follows.
    ///
    /// # Errors
    /// When the model cannot continue.
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

/// Equations in two parts: a fast one that drives a slow one, each of which [`TwoRates`](crate::TwoRates) integrates with
/// steps of its own. The JSON declares the states of the fast part first.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Multirate`, whose `evaluate_part` computes one part at a time",
    label = "integrated by `TwoRates`"
)]
pub trait Multirate: Equations {
    /// [`Equations::evaluate_values`] of one part: computes at least the derivatives of its states. The fast part must not
    /// read the slow states, unless the parts are [coupled](Multirate::is_coupled).
    fn evaluate_part(&self, part: Part, time: f64, variables: EvaluationOf<'_, Self, f64>) {
        let _ = part;
        self.evaluate_values(time, variables);
    }

    /// Whether the fast part depends on the slow one with these parameters: both then take the same steps.
    fn is_coupled(&self, variables: &Self::Variables) -> bool {
        let _ = variables;
        false
    }
}

/// The variables of a model of equations over a number type.
pub type VariablesOf<E, T> = <<E as Equations>::Variables as Numbered>::Of<T>;

/// What the equations of a model read and compute, for a number type.
pub type EvaluationOf<'a, E, T> = <<E as Equations>::Variables as Numbered>::Evaluation<'a, T>;

/// Calculates what follows from the parameters of a model only.
pub(crate) fn calculate_parameters<E: Equations, T: Number>(
    equations: &E,
    variables: &mut VariablesOf<E, T>,
) {
    E::Variables::calculate_parameters::<T>(variables, |parameters, calculated| {
        equations.calculate_parameters(parameters, calculated);
    });
}

/// Variables as dual numbers, each of two numbers by `pair`. A library has this once.
#[inline(never)]
pub(crate) fn duals<V: Variables>(one: &V, other: &V, pair: &dyn Fn(f64, f64) -> Dual) -> V::Of<Dual> {
    one.combined(other, pair)
}

/// Evaluates the equations of a model. A library has them once for each number type.
#[inline(never)]
pub(crate) fn evaluate<E: Equations, T: Number>(equations: &E, time: T, variables: &mut VariablesOf<E, T>) {
    equations.evaluate(time, E::Variables::evaluation(variables));
}

/// Evaluates the equations of a model with plain numbers.
pub(crate) fn evaluate_values<E: Equations>(equations: &E, time: f64, variables: &mut E::Variables) {
    equations.evaluate_values(time, E::Variables::evaluation(variables));
}
