//! The functions of Scheduled Execution.

use super::{
    Boolean, ClockUpdateCallback, Enumeration, Error, Exported, Function, Instance, InstanceEnvironment,
    Interface, LogMessageCallback, Options, Preemption, PreemptionCallback, Status, String, ValueReference,
    call, elements, instance, instantiate, write_elements,
};
use crate::instance::activation::fraction;
use crate::scheduled_execution::ScheduledExecution;
#[cfg(target_family = "wasm")]
use crate::wasm::host;

/// `fmi3InstantiateScheduledExecution`: null, and a message, when an argument is wrong. There is no clock to be updated.
#[must_use]
pub unsafe fn instantiate_scheduled_execution<M: ScheduledExecution>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
    _clock_update: Option<ClockUpdateCallback>,
    lock_preemption: Option<PreemptionCallback>,
    unlock_preemption: Option<PreemptionCallback>,
) -> Instance {
    let strings = [instance_name, instantiation_token, resource_path];
    #[cfg(target_family = "wasm")]
    let (lock_preemption, unlock_preemption) = (
        lock_preemption.map(|_| host::lock_preemption as PreemptionCallback),
        unlock_preemption.map(|_| host::unlock_preemption as PreemptionCallback),
    );
    let preemption = Preemption { lock: lock_preemption, unlock: unlock_preemption };
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateScheduledExecution",
            Ok(Interface::ScheduledExecution),
            strings,
            logging_on,
            Options { preemption, ..Options::default() },
            environment,
            log_message,
        )
    }
}

/// Calls a function between the importer's callbacks, so that no task of a higher priority calls another one for the
/// same instance (section 5.1.2).
pub unsafe fn locked<M: ScheduledExecution>(instance: Instance, function: impl FnOnce() -> Status) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    let Some(preemption) = (unsafe { Exported::<M>::preemption(instance) }) else { return function() };
    if let Some(lock) = preemption.lock {
        // SAFETY: the importer passed the callback for this purpose; no reference to an instance exists here.
        unsafe { lock() }
    }
    let status = function();
    if let Some(unlock) = preemption.unlock {
        // SAFETY: as above.
        unsafe { unlock() }
    }
    status
}

/// `fmi3ActivateModelPartition`.
pub unsafe fn activate_model_partition<M: ScheduledExecution>(
    instance: Instance,
    clock: ValueReference,
    time: f64,
) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::ActivateModelPartition, |instance| instance.activate(clock, time))
    }
}

/// `fmi3GetIntervalDecimal`.
pub unsafe fn get_interval_decimal<M: ScheduledExecution>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    intervals: *mut f64,
    qualifiers: *mut Enumeration,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        get_intervals::<M>(
            instance,
            Function::GetIntervalDecimal,
            (references, count),
            qualifiers,
            |interval| write_all("intervals", intervals, count, interval),
        )
    }
}

/// `fmi3GetIntervalFraction`: the simplest fraction that is the interval.
pub unsafe fn get_interval_fraction<M: ScheduledExecution>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    counters: *mut u64,
    resolutions: *mut u64,
    qualifiers: *mut Enumeration,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        get_intervals::<M>(
            instance,
            Function::GetIntervalFraction,
            (references, count),
            qualifiers,
            |interval| {
                let [counter, resolution] = fraction(interval).ok_or_else(|| {
                    Error::new(format!("the interval {interval:?} s is not a fraction of 64-bit numbers"))
                })?;
                write_all("counters", counters, count, counter)?;
                write_all("resolutions", resolutions, count, resolution)
            },
        )
    }
}

/// Gets the interval of clocks.
///
/// # Safety
/// As for [`call`]; the arrays have as many elements as counted.
unsafe fn get_intervals<M: ScheduledExecution>(
    instance: Instance,
    function: Function,
    (references, count): (*const ValueReference, usize),
    qualifiers: *mut Enumeration,
    write: impl FnOnce(f64) -> Result<(), Error>,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        call::<M>(instance, function, |instance| {
            instance::Instance::<M>::check_clocks(&elements("valueReferences", references, count)?)?;
            if count > 0 {
                let (interval, qualifier) = instance.interval()?;
                write(interval)?;
                write_all("qualifiers", qualifiers, count, qualifier as Enumeration)?;
            }
            Ok(Status::Ok)
        })
    }
}

/// `fmi3GetShiftDecimal`: the first tick is at the start.
pub unsafe fn get_shift_decimal<M: ScheduledExecution>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    shifts: *mut f64,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetShiftDecimal, |_| {
            instance::Instance::<M>::check_clocks(&elements("valueReferences", references, count)?)?;
            write_all("shifts", shifts, count, 0.0)?;
            Ok(Status::Ok)
        })
    }
}

/// `fmi3GetShiftFraction`.
pub unsafe fn get_shift_fraction<M: ScheduledExecution>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    counters: *mut u64,
    resolutions: *mut u64,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetShiftFraction, |_| {
            instance::Instance::<M>::check_clocks(&elements("valueReferences", references, count)?)?;
            write_all("counters", counters, count, 0)?;
            write_all("resolutions", resolutions, count, 1)?;
            Ok(Status::Ok)
        })
    }
}

/// Writes a value to all elements of an array.
///
/// # Safety
/// As for [`write_elements`].
unsafe fn write_all<T: Copy>(name: &str, array: *mut T, count: usize, value: T) -> Result<(), Error> {
    // SAFETY: the caller's promise.
    let written = unsafe {
        write_elements(name, array, count, |elements| {
            elements.fill(value);
            Ok(Status::Ok)
        })
    };
    written.map(|_| ())
}
