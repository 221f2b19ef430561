//! A model without an FMU, for tests and programs in Rust.

use fmu_solve::Error;
use fmu_solve::time::Ahead;

use crate::kinds::input_signal::InputSignal;
use crate::kinds::{Fmu, InputsOf, Model, Step, calculate_parameters};
use crate::model::clock::Clock;
use crate::model::context::{Context, Experiment, Log, Timed};
use crate::model::resources::Resources;
use crate::model::variables::{Accessed as _, Numbered as _};

/// A model with its variables and messages, and the resources of its package. Unlike in an FMU, values are not checked.
///
/// ```ignore
/// let mut simulation = Simulation::<Lag>::default();
/// simulation.variables.parameters.time_constant = 0.5;
/// simulation.initialize()?;
/// simulation.variables.inputs.voltage = 1.0;
/// simulation.step(0.1)?;
/// assert!(simulation.variables.outputs.voltage_lagged < 1.0);
/// ```
#[derive(Clone)]
pub struct Simulation<F: Fmu> {
    /// The model.
    pub model: F::Model,
    /// The variables, at their start values until initialization. Their inputs are those of the next step.
    pub variables: VariablesOf<F>,
    /// The experiment that an importer would set up.
    pub experiment: Experiment,
    /// The time in seconds.
    pub time: f64,
    /// The logged messages: category and text.
    pub messages: Vec<(&'static str, String)>,
    /// The variables with the parameters that the model took last.
    #[doc(hidden)]
    pub taken: Option<VariablesOf<F>>,
    /// The inputs of the last step, if they were constant, and the states at its end.
    #[doc(hidden)]
    pub left: Option<(InputsOf<F::Model>, Vec<f64>)>,
    /// The end of the last step (s), and the clock there.
    #[doc(hidden)]
    pub reached: (f64, Ahead),
}

type VariablesOf<F> = <<F as Fmu>::Model as Model>::Variables;

impl<F: Fmu> Default for Simulation<F> {
    fn default() -> Self {
        let variables = VariablesOf::<F>::default();
        Self {
            model: F::Model::default(),
            variables,
            experiment: Experiment::default(),
            time: 0.0,
            messages: vec![],
            taken: None,
            left: None,
            reached: (0.0, Ahead::default()),
        }
    }
}

impl<F: Fmu> Simulation<F> {
    /// Checks the parameters and computes the values at the experiment's start time.
    ///
    /// # Errors
    /// When the model refuses its parameters or fails.
    pub fn initialize(&mut self) -> Result<(), Error> {
        F::Model::check_parameters(&self.variables)?;
        self.time = self.experiment.start_time;
        self.left = None;
        self.reached = (self.time, Ahead::default());
        let Self { model, variables, experiment, messages, .. } = self;
        self.taken = Some(variables.clone());
        let mut log = log_to(messages, experiment.start_time);
        let resources = Resources::of::<VariablesOf<F>>();
        let mut context =
            Context::new(experiment.of::<VariablesOf<F>>(), &mut log).with_resources(&resources);
        model.initialize(variables, &mut context)
    }

    /// Advances by a communication step of a size in seconds with constant inputs. Clocks whose interval does not change
    /// tick.
    ///
    /// # Errors
    /// When the model fails, or requests the end, at [`Simulation::time`].
    pub fn step(&mut self, size: f64) -> Result<(), Error> {
        let mut inputs = InputSignal::constant(self.variables.inputs());
        if self.left.as_ref().is_some_and(|left| *left == self.inputs_and_states()) {
            inputs = inputs.kept();
        }
        self.step_with(size, &inputs)?;
        self.left = F::Model::LOOKS_AHEAD.then(|| self.inputs_and_states());
        Ok(())
    }

    fn inputs_and_states(&self) -> (InputsOf<F::Model>, Vec<f64>) {
        let mut states = vec![];
        VariablesOf::<F>::each_state(&self.variables, |_, state: f64| states.push(state));
        (self.variables.inputs().clone(), states)
    }

    /// Ticks a clock at the present time, such as `|variables| &mut variables.clocks.sample`.
    ///
    /// # Errors
    /// When the model fails.
    pub fn tick(&mut self, clock: impl Fn(&mut VariablesOf<F>) -> &mut Clock) -> Result<(), Error> {
        self.take_parameters();
        let Self { model, variables, experiment, messages, time, .. } = self;
        clock(variables).ticks = true;
        let mut log = log_to(messages, *time);
        let resources = Resources::of::<VariablesOf<F>>();
        let mut context =
            Context::new(experiment.of::<VariablesOf<F>>(), &mut log).with_resources(&resources);
        let ticked = model.tick(*time, variables, &mut context);
        clock(variables).ticks = false;
        ticked
    }

    /// Advances by a communication step of a size in seconds with Real inputs that may change during it, to those at its
    /// end.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn step_with(&mut self, size: f64, inputs: &InputSignal<InputsOf<F::Model>>) -> Result<(), Error> {
        self.take_parameters();
        let Self { model, variables, experiment, messages, time, left, reached, .. } = self;
        *left = None;
        let mut log = log_to(messages, *time);
        let ahead = reached.1.at_start(reached.0, *time).after(*time, size);
        let step = Step { start: *time, size, inputs, ahead, since: experiment.start_time };
        let resources = Resources::of::<VariablesOf<F>>();
        let mut context =
            Context::new(experiment.of::<VariablesOf<F>>(), &mut log).with_resources(&resources);
        inputs.restart(variables.inputs_mut());
        model.step(variables, &step, &mut context)?;
        inputs.move_to(size, variables.inputs_mut());
        if let Some(end) = context.end {
            *time = end;
            return Err(Error::new(format!("the model requests the end at {end:?} s")));
        }
        *time += size;
        *reached = (*time, ahead);
        Ok(())
    }

    /// Computes what follows from the parameters, if they changed.
    fn take_parameters(&mut self) {
        let Self { model, variables, taken, .. } = self;
        if F::Model::TAKES_PARAMETERS
            && taken.as_ref().is_none_or(|taken| !variables.has_parameters_of(taken))
        {
            calculate_parameters(model, variables);
            model.take_parameters(variables);
            *taken = Some(variables.clone());
        }
    }
}

fn log_to(messages: &mut Vec<(&'static str, String)>, time: f64) -> impl Log {
    Timed::new(time, |category, message| messages.push((category, message.to_string())))
}
