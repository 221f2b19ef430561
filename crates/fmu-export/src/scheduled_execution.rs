//! Scheduled Execution of FMI 3.0: what a model implements whose clock the importer schedules.

use crate::error::Error;
use crate::model::{Context, InputsOf, Model};

/// A model for Scheduled Execution (FMI 3.0.2, chapter 5), with one clock and its model partition: a
/// [`Sampled`](crate::Sampled) one.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be exported for Scheduled Execution",
    note = "`Sampled` models can be"
)]
pub trait ScheduledExecution: Model {
    /// The clock's interval in s.
    #[doc(hidden)]
    fn interval(variables: &Self::Variables) -> f64;

    /// Computes the model partition at a time in s.
    ///
    /// # Errors
    /// When the model cannot go on.
    #[doc(hidden)]
    fn activate(
        &mut self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error>;
}
