//! A controller on the bench: parameters set, initialized, stepped by a master.

use boost_fmu::controller::BoostController;
use boost_fmu::controller::variables::{Inputs, Outputs, Parameters, Variables};
use fmu_export::{Context, Error, Experiment, InputSignal, Model, Step};

pub struct Bench {
    pub model: BoostController,
    pub variables: Variables,
    experiment: Experiment,
    /// The log: category and message.
    pub log: Vec<(&'static str, String)>,
}

impl Bench {
    /// A controller with changed parameters, initialized at time 0.
    pub fn new(inputs: &Inputs, change: impl FnOnce(&mut Parameters)) -> Self {
        Self::starting_at(0.0, inputs, change)
    }

    pub fn starting_at(start_time: f64, inputs: &Inputs, change: impl FnOnce(&mut Parameters)) -> Self {
        let mut bench = Self {
            model: BoostController::default(),
            variables: Variables::default(),
            experiment: Experiment { start_time, ..Experiment::default() },
            log: Vec::new(),
        };
        change(&mut bench.variables.parameters);
        BoostController::check_parameters(&bench.variables).expect("the parameters are consistent");
        bench.initialize(inputs);
        bench
    }

    pub fn initialize(&mut self, inputs: &Inputs) {
        let log = &mut self.log;
        let mut log = |category, message: std::fmt::Arguments<'_>| log.push((category, message.to_string()));
        let mut context = Context::new(self.experiment, &mut log);
        self.model.initialize(&mut self.variables, inputs, &mut context).expect("initialization succeeds");
    }

    /// One communication step.
    pub fn step(&mut self, start: f64, size: f64, inputs: &Inputs) -> Outputs {
        let signal = InputSignal::constant(*inputs);
        let log = &mut self.log;
        let mut log = |category, message: std::fmt::Arguments<'_>| log.push((category, message.to_string()));
        let mut context = Context::new(self.experiment, &mut log);
        let step = Step { start, size, inputs: &signal };
        self.model.step(&mut self.variables, &step, &mut context).expect("the step succeeds");
        self.variables.outputs
    }

    /// The sample of a number, in steps of the controller's sample time.
    pub fn sample(&mut self, number: u32, inputs: &Inputs) -> Outputs {
        let sample_time = self.variables.parameters.sample_time;
        self.step(f64::from(number) * sample_time, sample_time, inputs)
    }
}

/// Why parameters are refused.
pub fn refusal(change: impl FnOnce(&mut Parameters)) -> Option<Error> {
    let mut variables = Variables::default();
    change(&mut variables.parameters);
    BoostController::check_parameters(&variables).err()
}
