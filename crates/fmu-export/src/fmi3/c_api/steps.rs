//! Communication steps.

use core::ffi::c_void;

use fmu_abi::fmi3::c_types::{Boolean, FALSE, Status, TRUE};
use fmu_abi::fmi3::calling_sequence;
use fmu_solve::Error;

use crate::c_boundary::arguments::not_null;
use crate::c_boundary::{Exported, c_functions, call};
use crate::instance::{Answer, Instance};
use crate::kinds::Model;

c_functions! {
    fmi3EnterStepMode() if EVENT_MODE, Instance::enter_step_mode;
}

/// `fmi3DoStep`. If the model requests the end, the step ends there; with Event Mode it may also end at an event, and at the
/// end of each internal step but the last the importer exchanges values and may request early return.
pub unsafe fn fmi3DoStep<M: Model>(
    instance: *mut c_void,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    event_handling_needed: *mut Boolean,
    terminate_simulation: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut f64,
) -> Status {
    let flags = [event_handling_needed, terminate_simulation, early_return];
    if const { !Instance::<M>::EVENT_MODE.is_made } {
        let (start, size) = (current_communication_point, communication_step_size);
        // SAFETY: the instance and the results are the importer's (see the module).
        return unsafe {
            call::<M>(instance, &calling_sequence::fmi3DoStep, |instance| {
                step_by(instance, (start, size), flags, last_successful_time, |instance, start, size| {
                    instance.do_step(start, size).map(|status| (status, false))
                })
            })
        };
    }
    let (mut start, mut end) =
        (current_communication_point, current_communication_point + communication_step_size);
    let (mut size, asked_end) = (communication_step_size, end);
    let mut status = Status::Ok;
    loop {
        // SAFETY: the instance and the results are the importer's (see the module).
        status = status.max(unsafe {
            call::<M>(instance, &calling_sequence::fmi3DoStep, |instance| {
                step_by(instance, (start, size), flags, last_successful_time, Instance::do_step_to_event)
            })
        });
        // SAFETY: as above; the reference ends before the importer is called.
        let interrupted = unsafe { Exported::<M>::instance_of(instance) }
            .and_then(|instance| Some((instance.interruption()?, instance.early_return_allowed)));
        let Some(((time, callback), can_return_early)) = interrupted else {
            if end < asked_end && status <= Status::Warning {
                // SAFETY: the step checked the results.
                unsafe { early_return.write_unaligned(TRUE) };
            }
            return status;
        };
        let (mut is_asked, mut return_time) = (FALSE, end);
        // SAFETY: the importer passed the callback for this purpose (section 4.2.2); the results outlive the call. No
        // reference to an instance exists during the call.
        unsafe {
            (callback.function)(
                callback.environment,
                time,
                TRUE,
                TRUE,
                TRUE,
                Boolean::from(can_return_early),
                &raw mut is_asked,
                &raw mut return_time,
            );
        }
        // SAFETY: as above.
        if !unsafe { Exported::<M>::instance_of(instance) }.is_some_and(Instance::resume) {
            return Status::Error;
        }
        if is_asked != FALSE && can_return_early {
            if return_time < end {
                end = return_time;
            }
            if end <= time {
                // SAFETY: the step checked the results.
                unsafe { early_return.write_unaligned(TRUE) };
                return status;
            }
        }
        (start, size) = (time, end - time);
    }
}

/// A communication step by a function that also returns whether the importer has an event to handle.
///
/// # Safety
/// The results are null or may be written to.
unsafe fn step_by<M: Model>(
    instance: &mut Instance<M>,
    (start, size): (f64, f64),
    [event_handling_needed, terminate, early_return]: [*mut Boolean; 3],
    last_successful_time: *mut f64,
    do_step: impl FnOnce(&mut Instance<M>, f64, f64) -> Result<(Status, bool), Error>,
) -> Answer {
    let event_handling_needed = not_null("eventHandlingNeeded", event_handling_needed)?;
    let terminate = not_null("terminateSimulation", terminate)?;
    let early_return = not_null("earlyReturn", early_return)?;
    let last_successful_time = not_null("lastSuccessfulTime", last_successful_time)?;
    let write = |instance: &Instance<M>, has_event: bool, ends: bool| {
        let time = instance.last_successful_time();
        let is_early = (has_event || ends) && time < start + size;
        // SAFETY: the caller's promise.
        unsafe {
            event_handling_needed.write_unaligned(Boolean::from(has_event));
            terminate.write_unaligned(Boolean::from(ends));
            early_return.write_unaligned(Boolean::from(is_early && instance.early_return_allowed));
            last_successful_time.write_unaligned(time);
        }
    };
    // After an error, too.
    write(instance, false, false);
    let (status, has_event) = do_step(instance, start, size)?;
    let ends = instance.asks_for_end();
    write(instance, has_event, ends);
    Ok(if ends { Status::Ok } else { status })
}
