//! What a sampled model is, such as a digital controller.

use fmu_solve::Error;
use fmu_solve::display::Shown;
use fmu_solve::persistence::Persistent;
use fmu_solve::time::{nearer, rounding};

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

/// The samples of a period, counted in integers, so that they do not drift: sample k is at the start plus k periods, and
/// after a change of the period those that follow count from there.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Samples {
    /// How many were executed: the number of the next one.
    pub(crate) executed: u64,
    /// The time in s of the first one with the present period, which is the start with the first period.
    pub(crate) origin: f64,
    /// The number of the first one with the present period.
    first: u64,
    /// The present period in s.
    pub(crate) period: f64,
}

crate::persistent!(Samples { executed, origin, first, period });

impl Samples {
    /// The samples from a time on, with a period, both in s.
    pub(crate) fn new(origin: f64, period: f64) -> Self {
        Self { origin, period, ..Self::default() }
    }

    /// The next one.
    #[inline]
    pub(crate) fn next(&self) -> Sample {
        let Self { executed, origin, first, period } = *self;
        Sample { number: executed, time: origin + (executed - first) as f64 * period }
    }

    /// Takes a period that has changed by a time, both in s. One that is not valid is refused before the next step.
    #[cold]
    pub(crate) fn take_period(&mut self, period: f64, now: f64) {
        let Sample { number, time } = self.next();
        let is_due = time <= now + self.rounding(time);
        // A sample that is due now comes first.
        if !is_valid(period) || number > 0 && is_due {
            return;
        }
        if number > 0 {
            (self.origin, self.first) = ((time - self.period + period).max(now), number);
        }
        self.period = period;
    }

    /// How much earlier than a time another sample may be, in s, to be at the same time.
    fn rounding(&self, time: f64) -> f64 {
        same_time(time, self.origin, self.period)
    }
}

/// How much earlier than a sample another one may be to be at the same time, all in s: of the sample's time, of that from
/// which it is counted, and of the period.
pub(crate) fn same_time(time: f64, origin: f64, period: f64) -> f64 {
    nearer(rounding(time.abs().max(origin.abs())), period)
}

/// Whether a sample period in s is possible.
fn is_valid(period: f64) -> bool {
    period > 0.0 && period.is_finite()
}

/// Rejects what the model rejects, and a sample period that is none.
pub(crate) fn check_parameters<S: Sampled>(variables: &S::Variables) -> Result<(), Error> {
    S::check_parameters(variables)?;
    let period = S::period(variables);
    let (is_right, rule) = if S::Variables::HAS_CLOCKS {
        (period.is_nan(), "the clocks in the JSON have intervals of their own: omit `period`")
    } else {
        (is_valid(period), "it must be finite and above 0")
    };
    let reason = || Error::new(format_args!("the sample period is {} s; {rule}", Shown(period)));
    if is_right { Ok(()) } else { Err(reason()) }
}
