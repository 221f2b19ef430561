//! FMI 2.0: its C functions, their types, and the allowed order of calls.

pub mod c_api;
pub mod c_types;
mod calling_sequence;
mod functions;
