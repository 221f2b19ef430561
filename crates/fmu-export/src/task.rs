//! A sampled model without an FMU, as firmware runs it.

use fmu_solve::Error;

use crate::calibration;
use crate::model::context::{Context, Experiment, Log};
use crate::model::inputs::{Inputs as _, bound};
use crate::model::sampled::{Sampled, Samples, check_parameters};
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
    /// None before initialization, and after a failed sample.
    samples: Option<Samples>,
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
        (self.sampled, self.samples) = (S::default(), None);
        check_parameters::<S>(&self.variables)?;
        self.bound_inputs();
        self.calculate_parameters();
        self.sampled.initialize(&mut self.variables, &mut Context::new(Experiment::default(), log))?;
        self.sampled.refresh(0.0, &mut self.variables);
        self.samples = Some(Samples::new(0.0, self.period()));
        Ok(())
    }

    /// The sample period in s.
    #[must_use]
    pub fn period(&self) -> f64 {
        S::period(&self.variables)
    }

    /// Whether the task can execute samples.
    #[must_use]
    pub fn is_initialized(&self) -> bool {
        self.samples.is_some()
    }

    /// Executes the next sample, with the inputs within their bounds.
    ///
    /// # Errors
    /// When the task is not [initialized](Task::initialize), or when the model cannot continue; it must then be initialized
    /// anew.
    pub fn sample(&mut self, log: &mut dyn Log) -> Result<(), Error> {
        let mut samples =
            self.samples.take().ok_or_else(|| Error::new("the task is not initialized, or has failed"))?;
        self.bound_inputs();
        let sample = samples.next();
        let mut context = Context::new(Experiment::default(), log);
        context.at(sample.time);
        self.sampled.sample(sample, &mut self.variables, &mut context)?;
        samples.executed += 1;
        self.samples = Some(samples);
        Ok(())
    }

    /// Takes the parameters of a [page](crate::calibration) before [`Task::initialize`], or after it, for the next sample,
    /// those that are tunable.
    ///
    /// # Errors
    /// When the page has another length, the first parameter that has not a value of its type and range, or that is fixed
    /// and differs after initialization, or what the model has against them. The parameters are then those of before.
    pub fn take_page(&mut self, page: &[u64]) -> Result<(), Error> {
        let mut variables = self.variables.clone();
        calibration::take_page(&mut variables, page, self.is_initialized())?;
        check_parameters::<S>(&variables)?;
        self.variables = variables;
        if let Some(mut samples) = self.samples {
            self.calculate_parameters();
            let next = samples.next().time;
            self.sampled.refresh(next, &mut self.variables);
            // The last sample is the present: there is no time between samples.
            samples.take_period(self.period(), next - samples.period);
            self.samples = Some(samples);
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
