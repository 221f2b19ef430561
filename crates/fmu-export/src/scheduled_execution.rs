//! Scheduled Execution of FMI 3.0: which models have partitions that the importer schedules.

use crate::model::Model;

/// A model for Scheduled Execution (FMI 3.0.2, chapter 5), each of whose clocks has a model partition,
/// [`Model::tick`]: a [`Clocked`](crate::Clocked) one, or a [`Sampled`](crate::Sampled) one.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be exported for Scheduled Execution",
    note = "`Clocked` and `Sampled` models can be"
)]
pub trait ScheduledExecution: Model {}
