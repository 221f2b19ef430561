#![doc = include_str!("../README.md")]

// The runtime's modules; each depends only on those below it:
//
//   c_api                                 the functions of FMI 2.0
//   instance, simulation                  an instance of an FMU; a model without an FMU
//   co_simulation                         a model of equations as a model with an integrator
//   equations, integrator                 the trait of models of equations; Rodas5P
//   model                                 the trait of models
//   inputs, logger, calling_sequence, number, linear
//   serialized_state, saved_states
//   persistence, panics
//   error, description, c_types

// This crate's macros refer to it by this name.
#[cfg(all(test, feature = "derive"))]
extern crate self as fmu_export;

pub mod c_api;
pub mod c_types;
pub mod calling_sequence;
mod co_simulation;
pub mod description;
mod equations;
mod error;
mod inputs;
mod instance;
mod integrator;
mod linear;
mod logger;
mod model;
mod number;
mod panics;
pub mod persistence;
mod saved_states;
mod serialized_state;
mod simulation;
mod typed;

pub use co_simulation::{CoSimulation, DEFAULT_TOLERANCE};
pub use equations::{Equations, Event, VariablesOf};
pub use error::Error;
#[cfg(feature = "derive")]
pub use fmu_export_derive::Persistent;
pub use inputs::{InputSignal, Inputs, MAX_ORDER, RealInput};
pub use model::{Context, Experiment, InputsOf, Model, Step, Variables};
pub use number::{Dual, Number};
pub use persistence::Persistent;
pub use simulation::Simulation;

/// Defines the FMU of a crate whose library has the model identifier as its name: the module `variables` that
/// `fmu_export_build::generate` generated from the model's JSON, its items in scope, and the functions of FMI for a
/// type that implements [`Model`], or after `equations`, [`Equations`]. `struct` before the type's name declares it, for
/// a model without other memory.
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
        $crate::fmu!(@struct $model);
        $crate::fmu!($model);
    };
    (equations struct $model:ident) => {
        $crate::fmu!(@struct $model);
        $crate::fmu!(equations $model);
    };
    (equations $model:ident) => {
        $crate::fmu!(@variables);
        variables::export_fmi2!($crate::CoSimulation<$model>);
    };
    ($model:ident) => {
        $crate::fmu!(@variables);
        variables::export_fmi2!($model);
    };
    (@struct $model:ident) => {
        /// The model.
        #[derive(Clone, Debug, Default)]
        pub struct $model;
        $crate::persistent!($model {});
    };
    (@variables) => {
        /// The model's variables.
        pub mod variables {
            include!(concat!(env!("OUT_DIR"), "/", env!("CARGO_CRATE_NAME"), "/variables.rs"));
        }
        #[allow(unused_imports)]
        use variables::*;
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
