//! The C types of FMI 2.0.5 (fmi2TypesPlatform.h, fmi2FunctionTypes.h), hand-written from the standard: they are few,
//! and a binding generator would need libclang wherever a model is built.

use core::ffi::{c_char, c_int, c_uint, c_void};

pub use crate::Status;

/// `fmi2Component`: an instance.
pub type Component = *mut c_void;
/// `fmi2FMUstate`: a saved state.
pub type FmuState = *mut c_void;
/// `fmi2Boolean`: 0 is false.
pub type Boolean = c_int;
/// `fmi2Integer`.
pub type Integer = c_int;
/// `fmi2ValueReference`.
pub type ValueReference = c_uint;
/// `fmi2Byte`.
pub type Byte = c_char;
/// `fmi2String`.
pub type String = *const c_char;
/// `fmi2Type` and `fmi2StatusKind`, as importers pass them, and `fmi2Status` in their memory.
pub type Enumeration = c_int;

/// `fmi2True`.
pub const TRUE: Boolean = 1;
/// `fmi2False`.
pub const FALSE: Boolean = 0;
/// The `fmi2ModelExchange` of `fmi2Type`.
pub const MODEL_EXCHANGE: Enumeration = 0;
/// The `fmi2CoSimulation` of `fmi2Type`.
pub const CO_SIMULATION: Enumeration = 1;

/// The values of `fmi2StatusKind`. Not a Rust enum: the importer may pass any number.
pub mod status_kind {
    use core::ffi::c_int;

    /// `fmi2LastSuccessfulTime`.
    pub const LAST_SUCCESSFUL_TIME: c_int = 2;
    /// `fmi2Terminated`.
    pub const TERMINATED: c_int = 3;
}

/// `fmi2CallbackLogger`.
pub type CallbackLogger =
    unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`. Only the logger and its environment are used; the other fields complete the layout.
#[derive(Debug)]
#[repr(C)]
pub struct CallbackFunctions {
    /// Receives messages.
    pub logger: Option<CallbackLogger>,
    /// Unused: memory comes from Rust's allocator.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Unused.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Unused: steps are synchronous.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
    /// Passed to the logger.
    pub component_environment: *mut c_void,
}

/// `fmi2EventInfo`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
#[allow(missing_docs)]
pub struct EventInfo {
    pub new_discrete_states_needed: Boolean,
    pub terminate_simulation: Boolean,
    pub nominals_of_continuous_states_changed: Boolean,
    pub values_of_continuous_states_changed: Boolean,
    pub next_event_time_defined: Boolean,
    pub next_event_time: f64,
}

crate::fmi2_calls!(crate::function_types);
