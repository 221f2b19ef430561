//! A model called directly, without FMI.

use fmu_export::{Accessed as _, Context, Experiment, InputSignal, InputsOf, Model, Step};

/// A model with its variables, inputs and time.
#[derive(Clone)]
pub struct Direct<M: Model> {
    /// The model.
    pub model: M,
    /// The model's variables.
    pub variables: M::Variables,
    /// The inputs during the next step.
    inputs: InputSignal<InputsOf<M>>,
    /// The end of the last step in s.
    pub time: f64,
}

impl<M: Model> Direct<M> {
    /// A model, initialized at time 0 with its inputs and changed variables.
    ///
    /// # Panics
    /// When it cannot be initialized.
    pub fn new(inputs: InputsOf<M>, change: impl FnOnce(&mut M::Variables)) -> Self {
        let (mut model, mut variables) = (M::default(), M::Variables::default());
        let signal = InputSignal::constant(&inputs);
        *variables.inputs_mut() = inputs;
        change(&mut variables);
        M::check_parameters(&variables).expect("the parameters are consistent");
        let mut log = |_, _: std::fmt::Arguments<'_>| {};
        let mut context = Context::new(Experiment::default(), &mut log);
        model.initialize(&mut variables, &mut context).expect("initialization succeeds");
        Self { model, variables, inputs: signal, time: 0.0 }
    }

    /// Sets the inputs.
    pub fn set(&mut self, inputs: InputsOf<M>) {
        self.inputs = InputSignal::constant(&inputs);
        *self.variables.inputs_mut() = inputs;
    }

    /// A communication step with its size in s.
    ///
    /// # Panics
    /// When it fails.
    pub fn step(&mut self, size: f64) {
        let mut log = |_, _: std::fmt::Arguments<'_>| {};
        let mut context = Context::new(Experiment::default(), &mut log);
        let step = Step::new(self.time, size, &self.inputs);
        self.model.step(&mut self.variables, &step, &mut context).expect("the step succeeds");
        self.time += size;
    }
}
