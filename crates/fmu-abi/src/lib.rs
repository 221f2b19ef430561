#![doc = include_str!("../README.md")]
#![cfg_attr(target_os = "none", no_std)]
#![warn(clippy::std_instead_of_core)]

pub mod calling_sequence;
pub mod floating_point;
pub mod fmi2;
pub mod fmi3;
mod status;

pub use status::Status;

/// An importer's handle for a variable.
pub type ValueReference = u32;
