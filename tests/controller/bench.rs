//! A controller on the bench: parameters set, initialized, stepped by a master.

use std::ops::{Deref, DerefMut};

use boost_fmu::BoostController;
use boost_fmu::controller::variables::{Inputs, Outputs, Parameters, Strategy, Variables};
use fmu_export::{Error, Experiment, Model, Simulation};

pub struct Bench(Simulation<BoostController>);

impl Deref for Bench {
    type Target = Simulation<BoostController>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Bench {
    /// A controller with changed parameters, initialized at time 0.
    pub fn new(inputs: &Inputs, change: impl FnOnce(&mut Parameters)) -> Self {
        Self::starting_at(0.0, inputs, change)
    }

    /// The same with the strategy by speed.
    pub fn by_speed(inputs: &Inputs, change: impl FnOnce(&mut Parameters)) -> Self {
        Self::new(inputs, |parameters| {
            parameters.strategy = Strategy::BySpeed;
            change(parameters);
        })
    }

    pub fn starting_at(start_time: f64, inputs: &Inputs, change: impl FnOnce(&mut Parameters)) -> Self {
        let experiment = Experiment { start_time, ..Experiment::default() };
        let mut bench = Self(Simulation { experiment, ..Simulation::default() });
        // The inputs on the bench do not respond to commands, which is a fault.
        bench.variables.parameters.diagnosis.limp_home = false;
        bench.variables.parameters.integral_authority = 1e6;
        change(&mut bench.variables.parameters);
        bench.initialize(inputs);
        bench
    }

    pub fn initialize(&mut self, inputs: &Inputs) {
        self.variables.inputs = *inputs;
        self.0.initialize().expect("initialization succeeds");
    }

    /// One communication step.
    pub fn step(&mut self, start: f64, size: f64, inputs: &Inputs) -> Outputs {
        (self.time, self.variables.inputs) = (start, *inputs);
        self.0.step(size).expect("the step succeeds");
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
