//! The Scheduled Execution functions of an FMU without it.

use super::instantiation::{Options, instantiate};
use crate::c_boundary::refusals;
use crate::error::Error;
use crate::fmi3::c_types::{
    Boolean, ClockUpdateCallback, Instance, InstanceEnvironment, LogMessageCallback, PreemptionCallback,
    Status, String, ValueReference,
};
use crate::fmi3::calling_sequence::Function;
use crate::model::Model;

const REASON: &str = "this FMU does not offer Scheduled Execution";

/// `fmi3InstantiateScheduledExecution`: null and a message.
#[must_use]
pub unsafe fn fmi3InstantiateScheduledExecution<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
    _clock_update: Option<ClockUpdateCallback>,
    _lock_preemption: Option<PreemptionCallback>,
    _unlock_preemption: Option<PreemptionCallback>,
) -> Instance {
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateScheduledExecution",
            Err(Error::new(REASON)),
            strings,
            logging_on,
            Options::default(),
            environment,
            log_message,
        )
    }
}

refusals! {
    fmi3ActivateModelPartition(ValueReference, f64), REASON;
}

/// Calls a function: nothing preempts it.
pub unsafe fn locked<M: Model, T>(_instance: Instance, function: impl FnOnce() -> T) -> T {
    function()
}
