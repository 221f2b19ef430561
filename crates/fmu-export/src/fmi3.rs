//! FMI 3.0: its C functions.

pub mod c_api;
mod functions;

#[doc(hidden)]
pub use fmu_abi::fmi3::c_types;
