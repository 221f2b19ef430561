//! The C types of FMI 3.0.2 (fmi3PlatformTypes.h, fmi3FunctionTypes.h), hand-written from the standard.

use core::ffi::{c_char, c_int, c_void};

pub use crate::Status;
pub use crate::ValueReference;

/// `fmi3Instance`.
pub type Instance = *mut c_void;
/// `fmi3InstanceEnvironment`: passed to callbacks, never dereferenced.
pub type InstanceEnvironment = *mut c_void;
/// `fmi3FMUState`: a saved state.
pub type FmuState = *mut c_void;
/// `fmi3Boolean`, a C `bool`. Not Rust's: the importer's memory may hold any byte; 0 is false.
pub type Boolean = u8;
/// `fmi3Clock`, a C `bool`: any byte, as for [`Boolean`].
pub type Clock = u8;
/// `fmi3Byte`.
pub type Byte = u8;
/// `fmi3String`.
pub type String = *const c_char;
/// `fmi3Binary`.
pub type Binary = *const u8;
/// `fmi3IntervalQualifier` and `fmi3DependencyKind`, as stored in importers' memory.
pub type Enumeration = c_int;

/// `fmi3False`.
pub const FALSE: Boolean = 0;
/// `fmi3True`.
pub const TRUE: Boolean = 1;

/// `fmi3LogMessageCallback`.
pub type LogMessageCallback = unsafe extern "C" fn(InstanceEnvironment, Status, String, String);
/// `fmi3IntermediateUpdateCallback`.
pub type IntermediateUpdateCallback = unsafe extern "C" fn(
    InstanceEnvironment,
    f64,
    Boolean,
    Boolean,
    Boolean,
    Boolean,
    *mut Boolean,
    *mut f64,
);
/// `fmi3ClockUpdateCallback`.
pub type ClockUpdateCallback = unsafe extern "C" fn(InstanceEnvironment);
/// `fmi3LockPreemptionCallback` and `fmi3UnlockPreemptionCallback`.
pub type PreemptionCallback = unsafe extern "C" fn();

crate::fmi3_calls!(crate::function_types);
