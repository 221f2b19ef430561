#![doc = include_str!("../README.md")]

// The runtime's modules, of which each depends on those below it only:
//
//   c_api                                 the functions of FMI 2.0
//   instance                              one instance of an FMU
//   model                                 what a model implements and is given
//   inputs, logger, calling_sequence
//   serialized_state, saved_states
//   persistence, panics
//   error, description, c_types

pub mod c_api;
pub mod c_types;
pub mod calling_sequence;
pub mod description;
mod error;
mod inputs;
mod instance;
mod logger;
mod model;
mod panics;
pub mod persistence;
mod saved_states;
mod serialized_state;
mod typed;

pub use error::Error;
pub use inputs::{InputSignal, Inputs, MAX_ORDER, RealInput};
pub use model::{Context, Experiment, InputsOf, Model, Step, Variables};

/// Includes the typed interface that `fmu_export_build::generate` made of a model's
/// JSON, by the model's identifier.
#[macro_export]
macro_rules! include_variables {
    ($model_identifier:literal) => {
        include!(concat!(env!("OUT_DIR"), "/", $model_identifier, "/variables.rs"));
    };
}
