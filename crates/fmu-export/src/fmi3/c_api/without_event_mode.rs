//! The functions that differ without Event Mode in Co-Simulation.

use super::accessors;
use super::steps::step_by;
use crate::c_boundary::{c_functions, refusals, set_values};
use crate::error::Error;
use crate::fmi3::c_types::{self, Boolean, Status, ValueReference};
use crate::fmi3::calling_sequence::Function;
use crate::instance::Instance;
use crate::model::Model;

c_functions! {
    /// If the model requests the end, the step ends there.
    fmi3DoStep<Model>(
        start: f64, size: f64, _no_set_fmu_state_prior: Boolean, event_handling_needed: *mut Boolean,
        terminate: *mut Boolean, early_return: *mut Boolean, last_successful_time: *mut f64,
    ), |instance| {
        let flags = [event_handling_needed, terminate, early_return];
        step_by(instance, (start, size), flags, last_successful_time, |instance, start, size| {
            instance.do_step(start, size).map(|status| (status, false))
        })
    };
}

refusals! {
    fmi3EnterStepMode(), super::WITHOUT_EVENT_MODE;
}

accessors! {
    fmi3SetFloat64<Model>, set_values(*const f64), Instance::set_real;
}
