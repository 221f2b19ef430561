//! A sampled model without an FMU, as firmware runs it.

use fmu_solve::Error;

use crate::calibration;
use crate::model::context::{Context, Experiment, Log};
use crate::model::inputs::{Inputs as _, bound};
use crate::model::sampled::{Sample, Sampled};
use crate::model::variables::{Accessed as _, Described as _, Numbered as _};

/// A sampled model with its variables, which computes when it is told to: firmware calls [`Task::sample`] once per
/// [period](Sampled::period), from a timer or when measurements arrive. It computes what the FMU computes, bit for bit where
/// its [functions](crate::Number) do.
///
/// ```ignore
/// let mut task = Task::<Controller>::default();
/// task.initialize(&mut log)?;
/// loop {
///     wait_for_timer();
///     task.variables.inputs.speed = measured_speed();
///     task.sample(&mut log)?;
///     command(task.variables.outputs.duty);
/// }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Task<S: Sampled> {
    sampled: S,
    /// The variables: the inputs of the next sample, the outputs of the last one.
    pub variables: S::Variables,
    /// The number of the next sample.
    number: u64,
    /// The time of the next sample, in s after the start.
    time: f64,
    /// The number and the time (s) of the first sample with the present period, and the period (s).
    since: (u64, f64, f64),
}

impl<S: Sampled> Task<S> {
    /// Starts anew: checks the parameters, and computes the outputs before the first sample from them and the inputs.
    ///
    /// # Errors
    /// When the model refuses its parameters, or has no such outputs.
    pub fn initialize(&mut self, log: &mut dyn Log) -> Result<(), Error> {
        const {
            assert!(
                !S::Variables::HAS_CLOCKS,
                "a `Task` has one period: omit the clocks, variables of the type Clock, in the model's JSON"
            );
        }
        S::check_parameters(&self.variables)?;
        let period = S::period(&self.variables);
        if !(period > 0.0 && period.is_finite()) {
            return Err(Error::new(format_args!(
                "the sample period is {period} s; it must be finite and above 0"
            )));
        }
        (self.sampled, self.number, self.time, self.since) = (S::default(), 0, 0.0, (0, 0.0, period));
        self.bound_inputs();
        self.calculate_parameters();
        self.sampled.initialize(&mut self.variables, &mut Context::new(Experiment::default(), log))?;
        self.sampled.refresh(0.0, &mut self.variables);
        Ok(())
    }

    /// Executes the next sample, with the inputs within their bounds.
    ///
    /// # Errors
    /// When the model cannot continue. It must then be [initialized](Task::initialize).
    pub fn sample(&mut self, log: &mut dyn Log) -> Result<(), Error> {
        self.bound_inputs();
        let sample = Sample { number: self.number, time: self.time };
        let mut context = Context::new(Experiment::default(), log);
        context.at(sample.time);
        self.sampled.sample(sample, &mut self.variables, &mut context)?;
        self.number += 1;
        let (first, origin, period) = self.since;
        self.time = origin + (self.number - first) as f64 * period;
        Ok(())
    }

    /// Takes the parameters of a [page](crate::calibration) before [`Task::initialize`], or after it, for the next sample,
    /// those that are tunable.
    ///
    /// # Errors
    /// The first parameter that has not a value of its type and range, or that is fixed and differs after initialization,
    /// or what the model has against them. The parameters are then those of before.
    pub fn take_page(&mut self, page: &[u64]) -> Result<(), Error> {
        let is_initialized = self.since.2 > 0.0;
        let mut variables = self.variables.clone();
        calibration::take_page(&mut variables, page, is_initialized)?;
        S::check_parameters(&variables)?;
        self.variables = variables;
        if is_initialized {
            self.calculate_parameters();
            self.sampled.refresh(self.time, &mut self.variables);
            let (first, origin, before) = self.since;
            let period = S::period(&self.variables);
            if period.to_bits() != before.to_bits() && self.number > first {
                // The next sample is a new period after the last one.
                let last = origin + (self.number - 1 - first) as f64 * before;
                self.time = last + period;
                self.since = (self.number, self.time, period);
            }
        }
        Ok(())
    }

    fn bound_inputs(&mut self) {
        let set = self.variables.inputs().clone();
        self.variables.inputs_mut().set_reals(|position| {
            bound::<<S::Variables as crate::Accessed>::Inputs>(position, set.real(position))
        });
    }

    fn calculate_parameters(&mut self) {
        let sampled = &self.sampled;
        S::Variables::calculate_parameters(&mut self.variables, |parameters, calculated| {
            sampled.calculate_parameters(parameters, calculated);
        });
    }
}
