//! Scheduled Execution of FMI 3.0: the trait of models whose partitions the importer schedules.

use crate::model::Model;

/// A model for Scheduled Execution (FMI 3.0.2, chapter 5) with a model partition per clock, [`Model::tick`]: a
/// [`Clocked`](crate::Clocked) or [`Sampled`](crate::Sampled) one.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be exported for Scheduled Execution",
    note = "`Clocked` and `Sampled` models can be"
)]
pub trait ScheduledExecution: Model {}
