#![doc = include_str!("../README.md")]

// The runtime's modules; each depends only on those below it:
//
//   c_api                                 the functions of FMI 2.0
//   instance, simulation                  an instance of an FMU; a model without an FMU
//   model                                 the trait of models
//   inputs, logger, calling_sequence
//   serialized_state, saved_states
//   persistence, panics
//   error, description, c_types

// This crate's macros refer to it by this name.
#[cfg(all(test, feature = "derive"))]
extern crate self as fmu_export;

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
mod simulation;
mod typed;

pub use error::Error;
#[cfg(feature = "derive")]
pub use fmu_export_derive::Persistent;
pub use inputs::{InputSignal, Inputs, MAX_ORDER, RealInput};
pub use model::{Context, Experiment, InputsOf, Model, Step, Variables};
pub use persistence::Persistent;
pub use simulation::Simulation;

/// Defines the FMU of a crate whose library has the model identifier as its name: the module `variables` that
/// `fmu_export_build::generate` generated from the model's JSON, its items in scope, and the functions of FMI for a
/// type that implements [`Model`]. `struct` before the type's name declares it, for a model without other memory.
///
/// ```ignore
/// fmu_export::fmu!(struct Lag);
///
/// impl fmu_export::Model for Lag {
///     type Variables = Variables;
///     // ...
/// }
/// ```
#[macro_export]
macro_rules! fmu {
    (struct $model:ident) => {
        /// The model.
        #[derive(Clone, Debug, Default)]
        pub struct $model;
        $crate::persistent!($model {});
        $crate::fmu!($model);
    };
    ($model:ident) => {
        /// The model's variables.
        pub mod variables {
            include!(concat!(env!("OUT_DIR"), "/", env!("CARGO_CRATE_NAME"), "/variables.rs"));
        }
        #[allow(unused_imports)]
        use variables::*;
        $crate::export_fmi2!($model);
    };
}

/// Includes the typed interface that `fmu_export_build::generate` generated, by the model identifier. For a model
/// that another crate exports; [`fmu!`] includes it by itself.
#[macro_export]
macro_rules! include_variables {
    ($model_identifier:literal) => {
        include!(concat!(env!("OUT_DIR"), "/", $model_identifier, "/variables.rs"));
    };
}
