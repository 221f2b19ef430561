//! FMI 2.0: the types of its C functions, the functions, and the allowed order of calls.

pub mod c_types;
pub mod calling_sequence;
