//! Models that step themselves, such as a simulation that another crate brings.

use fmu_solve::persistence::Persistent;
use fmu_solve::{Dual, Error, Tape};

use crate::kinds::{Fmu, InputsOf, Model, Step, assert_double_precision, provides_no};
use crate::model::context::Context;
use crate::model::variables::{Accessed, Numbered, Variables};

/// A model that steps itself, for co-simulation.
///
/// The inputs in its variables are those that it computes with: within their bounds, at the time of the call, and in
/// [`Stepper::step`] at the step's start.
///
/// `Clone` saves and restores the model, and [`Persistent`] carries it into other processes, so both must cover its
/// whole memory. A struct can derive both.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Stepper`: write `fmu!(equations {Self})` or `fmu!(sampled {Self})` if it implements \
               `Equations` or `Sampled`",
    label = "exported as a `Stepper`"
)]
pub trait Stepper: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables;

    /// The longest communication step in seconds. Longer ones are rejected; otherwise a mistyped step would block its
    /// importer forever.
    const LONGEST_STEP: f64 = f64::MAX;

    /// Rejects contradictory parameters. Called at the end of initialization, and before the step after a change of a
    /// tunable parameter.
    ///
    /// # Errors
    /// A message with the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Computes the values at the start time (states, derivatives, locals, outputs) from parameters, inputs and start
    /// values. In initialization mode it is called again for each request after a set, so it must not depend on
    /// earlier calls; importers set parameters one by one, so they may be temporarily contradictory.
    ///
    /// By default, states take their start values, and [`Stepper::calculate_parameters`] and [`Stepper::refresh`] compute
    /// the rest.
    ///
    /// # Errors
    /// When no such values exist.
    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        Self::Variables::calculate_parameters(variables, |parameters, calculated| {
            self.calculate_parameters(parameters, calculated);
        });
        variables.states_from_start();
        self.refresh(context.experiment.start_time, variables);
        Ok(())
    }

    /// Advances the model by one communication step and leaves the values at its end in `variables`.
    ///
    /// # Errors
    /// When the step cannot be completed; the instance then rejects further steps until it is reset.
    fn step(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, <Self::Variables as Accessed>::Inputs>,
        context: &mut Context<'_>,
    ) -> Result<(), Error>;

    /// Recomputes, at a time (s) between steps, what depends directly on changed inputs or tunable parameters.
    fn refresh(&mut self, time: f64, variables: &mut Self::Variables) {
        let _ = (time, variables);
    }

    /// Calculates the *variables* that depend on parameters only (calculated parameters, and locals whose variability
    /// is `fixed` or `tunable`) after tunable parameters changed, before anything is computed. [`Stepper::initialize`]
    /// calculates them itself.
    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    ) {
        let _ = (parameters, calculated);
    }

    /// Receives the parameters after [`Stepper::calculate_parameters`], so that the model can store derived values in
    /// *fields*. Parameters may contradict each other until [`Stepper::check_parameters`].
    fn take_parameters(&mut self, variables: &Self::Variables) {
        let _ = variables;
    }

    /// Recomputes, after reading a serialized state, what the state omits because it follows from the rest; by default,
    /// what follows from the parameters.
    fn restored(&mut self, variables: &Self::Variables) {
        self.take_parameters(variables);
    }

    /// How the calculated variables change, at a time (s) between steps, when time, inputs, states and parameters
    /// change along a direction: the directional derivative of derivatives, locals and outputs.
    ///
    /// `direction` holds inputs and parameters in their places, and states in `start`; the result holds derivatives in
    /// the variables' places. Inputs held at a bound do not change, nor do parameters in FMI 2.0.
    ///
    /// # Errors
    /// When there is no such derivative, or the model does not provide it (`directional_derivatives` in its JSON).
    fn differentiate(
        &self,
        time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        let _ = (time, variables, direction);
        Err(provides_no("derivatives"))
    }

    /// The directional derivative of what initialization computes at the start time (s), including the states, when
    /// inputs, parameters and start values change along a direction.
    ///
    /// # Errors
    /// As [`Stepper::differentiate`].
    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        let _ = (start_time, variables, direction);
        Err(provides_no("derivatives of its initialization"))
    }

    /// How a weighted sum of calculated variables changes, at a time (s) between steps, with each input and state: the
    /// adjoint derivative, in FMI 3.0 only. [`Tape`] computes it.
    ///
    /// `weights` holds weights in the variables' places; the result holds derivatives in the places of inputs and
    /// `states`, and with `by_parameters` also of parameters. Its value for an input held at a bound is ignored.
    ///
    /// # Errors
    /// As [`Stepper::differentiate`] (`adjoint_derivatives` in its JSON).
    fn differentiate_backwards(
        &self,
        time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        by_parameters: bool,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        let _ = (time, variables, weights, by_parameters, tape);
        Err(provides_no("adjoint derivatives"))
    }

    /// The adjoint derivative of what initialization computes at the start time (s), including the states: how it
    /// changes with each input, parameter and start value. The derivatives by start values are in `states`.
    ///
    /// # Errors
    /// As [`Stepper::differentiate_backwards`].
    fn differentiate_initialization_backwards(
        &self,
        start_time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        let _ = (start_time, variables, weights, tape);
        Err(provides_no("adjoint derivatives of its initialization"))
    }
}

/// A model that steps itself, as the runtime sees it.
#[derive(Clone, Debug, Default)]
pub struct Stepped<S> {
    /// The model that steps itself.
    pub stepper: S,
}

crate::persistent!(<S: Stepper> Stepped<S> { stepper });

impl<S: Stepper> Fmu for Stepped<S> {
    type Model = Self;
}

impl<S: Stepper> Model for Stepped<S> {
    type Variables = S::Variables;
    const LONGEST_STEP: f64 = S::LONGEST_STEP;

    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        const { assert_double_precision::<S::Variables>() };
        S::check_parameters(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.stepper.initialize(variables, context)
    }

    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    ) {
        self.stepper.calculate_parameters(parameters, calculated);
    }

    fn take_parameters(&mut self, variables: &Self::Variables) {
        self.stepper.take_parameters(variables);
    }

    fn restored(&mut self, variables: &Self::Variables) {
        self.stepper.restored(variables);
    }

    fn step(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.stepper.step(variables, step, context)
    }

    fn refresh(&mut self, time: f64, variables: &mut Self::Variables) {
        self.stepper.refresh(time, variables);
    }

    fn differentiate(
        &self,
        time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        self.stepper.differentiate(time, variables, direction)
    }

    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        self.stepper.differentiate_initialization(start_time, variables, direction)
    }

    fn differentiate_backwards(
        &self,
        time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        by_parameters: bool,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        self.stepper.differentiate_backwards(time, variables, weights, by_parameters, tape)
    }

    fn differentiate_initialization_backwards(
        &self,
        start_time: f64,
        variables: &Self::Variables,
        weights: &Self::Variables,
        tape: &mut Tape,
    ) -> Result<Self::Variables, Error> {
        self.stepper.differentiate_initialization_backwards(start_time, variables, weights, tape)
    }
}
