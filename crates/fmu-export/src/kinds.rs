//! The kinds of models: the traits that users implement, and what the runtime makes of each, a [`Model`].

pub(crate) mod audit;
pub mod equations;
pub mod input_signal;
pub mod integrated;
pub mod sampled;
pub mod stepper;

use fmu_solve::persistence::Persistent;
use fmu_solve::time::{Ahead, End};
use fmu_solve::{Dual, Error, Event, Events, Stop, Stops, Tape};

use crate::kinds::input_signal::InputSignal;
use crate::model::context::Context;
use crate::model::description::ModelDescription;
use crate::model::variables::{Accessed, Described, Numbered, Variables};

/// A model of any kind.
///
/// The inputs in its variables are those that it computes with: within their bounds, and at the time of the call.
pub trait Model: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables;

    /// What the runtime can do with the model beside co-simulation.
    const SERVES: Serves = Serves::CO_SIMULATION;

    /// The longest communication step in seconds.
    const LONGEST_STEP: f64;

    /// Whether a step may compute what lies beyond its end, if no input changes.
    const LOOKS_AHEAD: bool = false;

    /// Whether [`Model::calculate_parameters`] and [`Model::take_parameters`] do anything: if not,
    /// [`Simulation`](crate::Simulation) need not look for changes.
    const TAKES_PARAMETERS: bool = true;

    /// Rejects contradictory parameters. Called at the end of initialization, and before the step after a change of a
    /// tunable parameter.
    ///
    /// # Errors
    /// A message with the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error>;

    /// Computes the values at the start time (states, derivatives, locals, outputs) from parameters, inputs and start
    /// values. In initialization mode it is called again for each request after a set.
    ///
    /// # Errors
    /// When no such values exist.
    fn initialize(&mut self, variables: &mut Self::Variables, context: &mut Context<'_>)
    -> Result<(), Error>;

    /// Calculates the *variables* that depend on parameters only, after tunable parameters changed, before anything is
    /// computed.
    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    );

    /// Receives the parameters after [`Model::calculate_parameters`].
    fn take_parameters(&mut self, variables: &Self::Variables) {
        let _ = variables;
    }

    /// Recomputes, after reading a serialized state, what the state omits because it follows from the rest.
    fn restored(&mut self, variables: &Self::Variables) {
        self.take_parameters(variables);
    }

    /// Advances the model by one communication step and leaves the values at its end in `variables`, whose inputs may be
    /// those of any time in the step.
    ///
    /// # Errors
    /// When the step cannot be completed; the instance then rejects further steps until it is reset.
    fn step(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error>;

    /// Recomputes, at a time (s) between steps, what depends directly on changed inputs or tunable parameters; in
    /// Model Exchange, on time and states too.
    fn refresh(&mut self, time: f64, variables: &mut Self::Variables);

    /// As [`Stepper::differentiate`](crate::Stepper::differentiate).
    ///
    /// # Errors
    /// When there is no such derivative, or the model does not provide it.
    fn differentiate(
        &self,
        time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        let _ = (time, variables, direction);
        Err(provides_no("derivatives"))
    }

    /// As [`Stepper::differentiate_initialization`](crate::Stepper::differentiate_initialization).
    ///
    /// # Errors
    /// As [`Model::differentiate`].
    fn differentiate_initialization(
        &self,
        start_time: Dual,
        variables: &Self::Variables,
        direction: &Self::Variables,
    ) -> Result<Self::Variables, Error> {
        let _ = (start_time, variables, direction);
        Err(provides_no("derivatives of its initialization"))
    }

    /// As [`Stepper::differentiate_backwards`](crate::Stepper::differentiate_backwards).
    ///
    /// # Errors
    /// As [`Model::differentiate`].
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

    /// As [`Stepper::differentiate_initialization_backwards`](crate::Stepper::differentiate_initialization_backwards).
    ///
    /// # Errors
    /// As [`Model::differentiate`].
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

    /// As [`Equations::event_indicators`](crate::Equations::event_indicators), after [`Model::refresh`].
    fn event_indicators(&self, time: f64, variables: &Self::Variables, indicators: &mut [f64]) {
        let _ = (time, variables, indicators);
    }

    /// As [`Equations::next_event`](crate::Equations::next_event).
    fn next_event(&self, time: f64, variables: &Self::Variables) -> Option<f64> {
        let _ = (time, variables);
        None
    }

    /// As [`Equations::event`](crate::Equations::event); [`Model::refresh`] follows.
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

    /// Computes a clock's tick at a time in s, in FMI 3.0: exactly one input clock [ticks](crate::Clock::ticks).
    ///
    /// # Errors
    /// When the model cannot continue.
    fn tick(
        &mut self,
        time: f64,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (time, variables, context);
        Err(Error::new("this model computes nothing when clocks tick"))
    }

    /// Advances over a communication step, or to an earlier stop (FMI 3.0.2, section 4.2). Without `events`, the model uses
    /// its own.
    ///
    /// # Errors
    /// As [`Model::step`].
    fn step_to_event(
        &mut self,
        variables: &mut Self::Variables,
        step: &Step<'_, InputsOf<Self>>,
        events: Option<&mut Events>,
        stops: Stops,
        context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error> {
        let _ = (events, stops);
        self.step(variables, step, context).map(|()| None)
    }

    /// After a panic in a step: goes back to a time that it has reached.
    fn leave_step(&mut self, variables: &mut Self::Variables, inputs: &InputSignal<InputsOf<Self>>) {
        let _ = (variables, inputs);
    }

    /// Begins the next step after an event.
    fn enter_step_mode(&mut self) {}
}

/// The error of a model without what is asked of it.
pub(crate) fn provides_no(what: &str) -> Error {
    Error::new(format!("this model provides no {what}"))
}

/// What [`fmu!`](crate::fmu) exports, and [`Simulation`](crate::Simulation) runs: a model of any kind.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no FMU: write `fmu!(equations {Self})`, `fmu!(sampled {Self})` or `fmu!(stepper {Self})` if it implements \
               `Equations`, `Sampled` or `Stepper`"
)]
pub trait Fmu {
    /// What the runtime makes of it.
    type Model: Model;
    /// Fails to compile if the model's interfaces are impossible.
    #[doc(hidden)]
    const CHECKED: () = check_interfaces::<Self::Model>();
}

/// What the runtime can do with a kind of models beside co-simulation.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Serves {
    pub model_exchange: bool,
    /// Event Mode of Co-Simulation in FMI 3.0.
    pub event_mode: bool,
    pub scheduled_execution: bool,
}

impl Serves {
    /// Nothing but co-simulation.
    pub const CO_SIMULATION: Self =
        Self { model_exchange: false, event_mode: false, scheduled_execution: false };
    /// Everything.
    pub const ALL: Self = Self { model_exchange: true, event_mode: true, scheduled_execution: true };
}

/// Refuses, while the model is compiled, interfaces for which it cannot be exported.
const fn check_interfaces<M: Model>() {
    let ModelDescription { interfaces, capabilities, .. } = M::Variables::DESCRIPTION;
    let Serves { model_exchange, event_mode, scheduled_execution } = M::SERVES;
    assert!(
        model_exchange || !interfaces.model_exchange(),
        "this model cannot be exported for Model Exchange: models of `Equations` and `Sampled` models can be"
    );
    assert!(
        event_mode || !capabilities.event_mode || !interfaces.co_simulation(),
        "this model has no Event Mode, which `event_mode` in its JSON's capabilities declares: models of `Equations` and \
         `Sampled` models have it"
    );
    assert!(
        scheduled_execution || !interfaces.scheduled_execution(),
        "this model cannot be exported for Scheduled Execution: `Sampled` models can be"
    );
    assert!(
        !interfaces.scheduled_execution() || !M::Variables::CLOCKS.is_empty(),
        "Scheduled Execution needs a clock in the model's JSON: a variable of the type Clock, or if the model has a period \
         \"clock\": {{\"name\": \"sample_clock\"}}"
    );
}

/// Calculates what follows from the parameters of a model only.
pub(crate) fn calculate_parameters<M: Model>(model: &M, variables: &mut M::Variables) {
    M::Variables::calculate_parameters(variables, |parameters, calculated| {
        model.calculate_parameters(parameters, calculated);
    });
}

/// The inputs of a model.
pub type InputsOf<M> = <<M as Model>::Variables as Accessed>::Inputs;

/// One communication step from [`Step::start`] to [`Step::end`]. The inputs in the model's variables are those at its
/// start; [`InputSignal::move_to`] moves them to another time in it.
#[derive(Debug)]
pub struct Step<'a, I> {
    /// Start time in seconds.
    pub start: f64,
    /// Length in seconds, finite and greater than 0.
    pub size: f64,
    /// The inputs during the step.
    pub inputs: &'a InputSignal<I>,
    /// The importer's clock at the end.
    pub(crate) ahead: Ahead,
    /// The start of the experiment in s.
    pub(crate) since: f64,
}

impl<'a, I> Step<'a, I> {
    /// A step from a start by a size, both in s.
    #[must_use]
    pub fn new(start: f64, size: f64, inputs: &'a InputSignal<I>) -> Self {
        Self { start, size, inputs, ahead: Ahead::default(), since: start }
    }

    /// The time in seconds at which the step ends.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.start + self.size
    }

    /// The end, and what is the same time.
    pub(crate) fn instant_of_end(&self) -> End {
        End::of_sum((self.start, self.size), self.ahead, self.since)
    }
}

/// Refuses single precision: derivatives are computed with `f64`.
const fn assert_double_precision<V: Described>() {
    assert!(
        !V::IS_SINGLE_PRECISION,
        "FMU_PRECISION is single, but only a `Sampled` model computes with `f32`"
    );
}
