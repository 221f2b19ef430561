//! The functions of Scheduled Execution, and its locks.

use fmu_abi::fmi3::c_types::{
    Boolean, ClockUpdateCallback, Instance, InstanceEnvironment, LogMessageCallback, PreemptionCallback,
    Status, String, ValueReference,
};
use fmu_abi::fmi3::calling_sequence;
use fmu_solve::Error;
use fmu_terms::InstanceType;

use super::instantiation::{Options, instantiate};
use crate::c_boundary::{Exported, call, refuse, silence_panics};
#[cfg(target_family = "wasm")]
use crate::host;
use crate::instance::{self, Preemption};
use crate::kinds::Model;

/// `fmi3InstantiateScheduledExecution`: null and a message if an argument is wrong, or the FMU does not offer it.
#[must_use]
pub unsafe fn fmi3InstantiateScheduledExecution<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
    clock_update: Option<ClockUpdateCallback>,
    lock_preemption: Option<PreemptionCallback>,
    unlock_preemption: Option<PreemptionCallback>,
) -> Instance {
    silence_panics();
    let strings = [instance_name, instantiation_token, resource_path];
    let offer = instance::Instance::<M>::SCHEDULED_EXECUTION;
    let (instance_type, options) = if const { instance::Instance::<M>::SCHEDULED_EXECUTION.is_made } {
        #[cfg(target_family = "wasm")]
        let (clock_update, lock_preemption, unlock_preemption) = (
            clock_update.map(|_| host::clock_update as ClockUpdateCallback),
            lock_preemption.map(|_| host::lock_preemption as PreemptionCallback),
            unlock_preemption.map(|_| host::unlock_preemption as PreemptionCallback),
        );
        let preemption = Preemption { lock: lock_preemption, unlock: unlock_preemption };
        (Ok(InstanceType::ScheduledExecution), Options { preemption, clock_update, ..Options::default() })
    } else {
        (Err(Error::new(offer.refusal)), Options::default())
    };
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateScheduledExecution",
            instance_type,
            strings,
            logging_on,
            options,
            environment,
            log_message,
        )
    }
}

/// Calls a function between the importer's lock callbacks, so that no task of higher priority calls another function
/// of the same instance (section 5.1.2).
pub unsafe fn locked<M: Model, T>(instance: Instance, function: impl FnOnce() -> T) -> T {
    if const { !instance::Instance::<M>::SCHEDULED_EXECUTION.is_made } {
        // Nothing preempts it.
        return function();
    }
    // SAFETY: the instance is the importer's (see the module).
    let Some(preemption) = (unsafe { Exported::<M>::preemption(instance) }) else { return function() };
    if let Some(lock) = preemption.lock {
        // SAFETY: the importer passed the callback for this purpose; no reference to an instance exists here.
        unsafe { lock() }
    }
    let result = function();
    if let Some(unlock) = preemption.unlock {
        // SAFETY: as above.
        unsafe { unlock() }
    }
    result
}

/// `fmi3ActivateModelPartition`. If the partition ticked a clock or set an interval, the importer is notified; the call
/// may be preempted meanwhile.
pub unsafe fn fmi3ActivateModelPartition<M: Model>(
    instance: Instance,
    clock: ValueReference,
    time: f64,
) -> Status {
    if const { !instance::Instance::<M>::SCHEDULED_EXECUTION.is_made } {
        let offer = instance::Instance::<M>::SCHEDULED_EXECUTION;
        // SAFETY: the instance is the importer's (see the module).
        return unsafe { refuse::<M>(instance, &calling_sequence::fmi3ActivateModelPartition, offer) };
    }
    let activate = |instance: &mut instance::Instance<M>| instance.activate(clock, time);
    // SAFETY: the instance is the importer's (see the module); the references end before the importer is called.
    let (status, update) = unsafe {
        locked::<M, _>(instance, || {
            let status = call::<M>(instance, &calling_sequence::fmi3ActivateModelPartition, activate);
            let computed = Exported::<M>::instance_of(instance).filter(|_| status <= Status::Warning);
            (status, computed.and_then(instance::Instance::begin_clock_update))
        })
    };
    if let Some(update) = update {
        // SAFETY: the importer passed the callback for this purpose (section 5.2.1). No reference to an instance
        // exists during the call.
        unsafe { (update.function)(update.environment) }
        // SAFETY: as above.
        unsafe {
            locked::<M, _>(instance, || {
                Exported::<M>::instance_of(instance).map(instance::Instance::end_clock_update)
            })
        };
    }
    status
}
