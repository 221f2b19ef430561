#![doc = include_str!("../README.md")]

pub mod c_api;
pub mod c_types;
pub mod calling_sequence;
pub mod description;
mod inputs;
mod instance;
mod logger;
mod model;
mod panics;
pub mod persistence;
mod saved_states;
mod serialized_state;

#[cfg(feature = "build")]
pub mod build;
#[cfg(feature = "package")]
pub mod package;
#[cfg(any(feature = "build", feature = "package"))]
mod xml;

pub use inputs::{InputSignal, MAX_ORDER};
pub use model::{Context, Error, Experiment, Inputs, InputsOf, Model, RealInput, Step, Variables};

/// Includes the typed interface that [`build::generate`](https://docs.rs/fmi2-export) made of a model's
/// JSON, by the model's identifier.
#[macro_export]
macro_rules! include_variables {
    ($model_identifier:literal) => {
        include!(concat!(env!("OUT_DIR"), "/", $model_identifier, "/variables.rs"));
    };
}
