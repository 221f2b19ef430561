//! What a sampled model is, such as a digital controller.

use fmu_solve::Error;
use fmu_solve::persistence::Persistent;

use crate::model::context::Context;
use crate::model::variables::{Described as _, Numbered, Variables};

/// A model that computes at its samples; nothing changes in between. It has one [`period`](Sampled::period), or its JSON
/// declares named clocks, variables of type `Clock` in the field `clocks`, each tick of which is a sample.
///
/// `Clone` and [`Persistent`] must cover its whole memory, as in [`Stepper`](crate::Stepper).
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Sampled`: write `fmu!(equations {Self})` or `fmu!(stepper {Self})` if it implements \
               `Equations` or `Stepper`",
    label = "exported as a `Sampled`"
)]
pub trait Sampled: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables;

    /// The longest communication step in s, as in [`Stepper::LONGEST_STEP`](crate::Stepper::LONGEST_STEP).
    const LONGEST_STEP: f64 = f64::MAX;

    /// The sample period in s, finite and above 0. If it depends on a tunable parameter and changes, the next sample is a
    /// new period after the last one, or at once if that has passed. Models whose JSON declares clocks omit it.
    fn period(variables: &Self::Variables) -> f64 {
        const {
            assert!(
                Self::Variables::HAS_CLOCKS,
                "a `Sampled` model needs `fn period`, or clocks in its JSON: variables of the type Clock"
            );
        }
        let _ = variables;
        f64::NAN
    }

    /// Rejects contradictory parameters.
    ///
    /// # Errors
    /// A message with the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Calculates what depends on parameters only: all calculated parameters, and all locals whose variability is
    /// `fixed` or `tunable`. No other hook sets them. Called before [`Sampled::initialize`], and after each change of
    /// tunable parameters.
    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Numbered>::Parameters<f64>,
        calculated: &mut <Self::Variables as Numbered>::CalculatedParameters<f64>,
    ) {
        let _ = (parameters, calculated);
    }

    /// Computes the outputs before the first sample, which is at the start time if there is a period, and sets clock
    /// intervals that depend on parameters. Called on a new model, possibly several times, like
    /// [`Stepper::initialize`](crate::Stepper::initialize).
    ///
    /// # Errors
    /// When no such outputs exist.
    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (variables, context);
        Ok(())
    }

    /// Recomputes, at a time (s) between samples, what belongs to no clock and depends on inputs or tunable parameters
    /// that have changed, including the intervals of tunable clocks.
    fn refresh(&mut self, time: f64, variables: &mut Self::Variables) {
        let _ = (time, variables);
    }

    /// Executes a sample: reads the inputs, which are within their bounds, and sets outputs and locals. If the model
    /// has clocks, exactly one input clock [ticks](crate::Clock::ticks); simultaneous ticks are one call each, ordered by
    /// `priority`.
    ///
    /// # Errors
    /// When the model cannot continue.
    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error>;
}

/// Identifies a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The sample's number, from 0; with clocks, among the ticks of the same clock.
    pub number: u64,
    /// The sample's time in s.
    pub time: f64,
}
