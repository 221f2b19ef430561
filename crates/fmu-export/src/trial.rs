//! A model without an FMU: for its tests, and for programs in Rust.

pub mod dependencies;
pub mod simulation;
