//! The functions that differ with Event Mode in Co-Simulation, and therefore intermediate updates.

use core::ffi::c_void;

use super::accessors;
use super::steps::step_by;
use crate::c_boundary::{Exported, c_functions, call, get_values, set_values};
use crate::event_mode::EventMode;
use crate::fmi3::c_types::{self, Boolean, FALSE, Status, TRUE, ValueReference};
use crate::fmi3::calling_sequence::Function;
use crate::instance::Instance;

c_functions! {
    fmi3EnterStepMode<EventMode>(), Instance::enter_step_mode;
}

/// `fmi3DoStep` of an FMU with Event Mode: the step may also end at an event, and at the end of each internal step but
/// the last the importer exchanges values and may request early return.
pub unsafe fn fmi3DoStep<M: EventMode>(
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
    let (mut start, mut end) =
        (current_communication_point, current_communication_point + communication_step_size);
    let (mut size, asked_end) = (communication_step_size, end);
    let mut status = Status::Ok;
    loop {
        // SAFETY: the instance and the results are the importer's (see the module).
        status = status.max(unsafe {
            call::<M>(instance, Function::fmi3DoStep, |instance| {
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

accessors! {
    fmi3GetFloat64<EventMode>, get_values(*mut f64), |instance, references, values| {
        instance.check_registered(references)?;
        instance.get_real_with_indicators(references, values)
    };
    fmi3SetFloat64<EventMode>, set_values(*const f64), |instance, references, values| {
        instance.check_registered(references)?;
        instance.set_real(references, values)
    };
}
