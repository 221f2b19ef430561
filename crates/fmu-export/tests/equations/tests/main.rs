//! The integrator, on models of equations.

mod allocations;
mod arrays;
mod branches;
mod calculated_parameters;
mod enumerations;
mod event_mode;
mod foreign_state;
mod importer;
mod intermediate_update;
mod look_ahead;
mod nested;
mod pulses;
mod rod;
mod samples;
mod solutions;
mod termination;
mod times;
mod two_parts;
mod two_rates;
mod vessels;
mod wrong_models;

use std::ffi::CString;
use std::ptr;

use fmu_export::fmi2::{c_api, c_types};
use fmu_export::{Described as _, Model};

/// An instance of a model's FMU of FMI 2.0, for co-simulation or Model Exchange, to be freed.
fn instantiate<M: Model>(of: c_types::Enumeration) -> c_types::Component {
    let token = CString::new(M::Variables::DESCRIPTION.guid).expect("it is text");
    let callbacks = c_types::CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: ptr::null_mut(),
    };
    let (name, token, callbacks) = (c"model".as_ptr(), token.as_ptr(), &raw const callbacks);
    // SAFETY: strings and callbacks outlive the call; without a logger, nothing refers to the callbacks later.
    let instance = unsafe { c_api::fmi2Instantiate::<M>(name, of, token, ptr::null(), callbacks, 0, 0) };
    assert!(!instance.is_null());
    instance
}
