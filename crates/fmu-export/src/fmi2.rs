//! FMI 2.0: its C functions.

pub mod c_api;
mod functions;

#[doc(hidden)]
pub use fmu_abi::fmi2::c_types;
