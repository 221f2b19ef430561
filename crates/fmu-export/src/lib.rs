#![doc = include_str!("../README.md")]
// The equations of models may one day run without the standard library.
#![warn(clippy::std_instead_of_core)]

// The runtime's modules; each depends only on those below it:
//
//   wasm                                  the functions of a WebAssembly module
//   fmi2, fmi3                            the functions of an FMI version
//   c_boundary                            what the functions of all versions share
//   instance, simulation, dependencies    an FMU instance; for a model's tests: the model without one, and its dependencies
//   integrated, sampled                   models of equations (integrated) and sampled ones as models
//   equations, integration                the trait of models of equations, and how they are integrated
//   event_loop, integrator, search        from event to event, the integrator, and the first event in its step
//   events, audit, typed                  when and why a model has an event, what its equations set, typed numbers
//   table, space                          tables for equations, and vectors and rotations
//   model                                 the trait of models
//   context                               what a model receives besides variables and inputs
//   serialized_state, calling_sequence, variables
//   clock, inputs, logger, number, tape, resources, saved_states
//   persistence, checksum, wasm::host
//   panics, floating_point
//   error, display, description, status

// This crate's macros refer to it by this name.
#[cfg(all(test, feature = "derive"))]
extern crate self as fmu_export;

mod audit;
mod c_boundary;
mod calling_sequence;
mod checksum;
mod clock;
mod context;
mod dependencies;
pub mod description;
pub mod display;
mod equations;
mod error;
pub mod event_loop;
mod events;
pub mod floating_point;
pub mod fmi2;
pub mod fmi3;
#[doc = include_str!("generic_code.md")]
pub mod generic_code {}
mod inputs;
mod instance;
mod integrated;
mod integration;
pub mod integrator;
mod logger;
mod model;
mod number;
mod panics;
pub mod persistence;
mod resources;
mod sampled;
mod saved_states;
pub mod search;
mod serialized_state;
mod simulation;
pub mod space;
mod status;
pub mod steady_state;
mod stops;
pub mod table;
mod tape;
#[doc(hidden)]
pub mod time;
#[doc(hidden)]
pub mod typed;
mod variables;
#[cfg(target_family = "wasm")]
#[doc(hidden)]
pub mod wasm;

pub use clock::Clock;
pub use context::{Context, Experiment, Log};
pub use dependencies::check_dependencies;
pub use equations::{Equations, EvaluationOf, Multirate, VariablesOf};
pub use error::Error;
pub use events::{Event, Events};
#[cfg(feature = "derive")]
pub use fmu_export_derive::Persistent;
pub use inputs::{InputSignal, Inputs, MAX_ORDER, RealInput};
#[doc(hidden)]
pub use integrated::{Integrate, Integrated};
pub use integration::{DEFAULT_TOLERANCE, Integration};
pub use integrator::{Part, TwoRates};
#[doc(hidden)]
pub use model::Serves;
pub use model::{Fmu, InputsOf, Model, Step};
pub use number::{Dual, Number};
pub use persistence::Persistent;
#[doc(hidden)]
pub use sampled::SampledModel;
pub use sampled::{Sample, Sampled};
pub use simulation::Simulation;
#[doc(hidden)]
pub use stops::{EventsLeft, Stop, Stops};
pub use tape::{Recorded, Tape};
pub use variables::Variables;

/// Defines the FMU of a crate whose library is named after the model identifier: the module `variables` that
/// `fmu_export_build::generate` generated from the model's JSON, with its items in scope, and the FMI functions for a
/// type that implements [`Model`], or after `equations`, [`Equations`], or after `sampled`, [`Sampled`]. `struct` before
/// the type's name declares it, for a model without other memory.
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
    (equations struct $model:ident, $integrator:ty) => {
        $crate::fmu!(@struct $model);
        $crate::fmu!(equations $model, $integrator);
    };
    (equations $model:ident $(, $integrator:ty)?) => {
        $crate::fmu!(@exported $model, $crate::Integrated<$model $(, $integrator)?>);
    };
    (sampled struct $model:ident) => {
        $crate::fmu!(@struct $model);
        $crate::fmu!(sampled $model);
    };
    (sampled $model:ident) => {
        $crate::fmu!(@exported $model, $crate::SampledModel<$model>);
    };
    ($model:ident) => {
        $crate::fmu!(@exported $model, $model);
    };
    (@struct $model:ident) => {
        /// The model.
        #[derive(Clone, Debug, Default)]
        pub struct $model;
        $crate::persistent!($model {});
    };
    (@exported $exported:ident, $model:ty) => {
        /// The model's variables.
        pub mod variables {
            include!(env!(
                concat!("FMU_VARIABLES_OF_", env!("CARGO_CRATE_NAME")),
                concat!(
                    "the library is called `", env!("CARGO_CRATE_NAME"), "`, and the model of the JSON `",
                    env!("FMU_DECLARED", "(no build script calls `fmu_export_build::generate`)"), "`: write \"model_identifier\": \"",
                    env!("CARGO_CRATE_NAME"), "\" in the JSON"
                )
            ));
        }
        #[allow(unused_imports)]
        use variables::*;

        impl $crate::Fmu for $exported {
            type Model = $model;
        }

        variables::export_functions!($exported);
    };
    ($($other:tt)*) => {
        ::core::compile_error!(::core::concat!(
            "`fmu!(", ::core::stringify!($($other)*), ")` is none of `fmu!(equations NAME)`, `fmu!(sampled NAME)` and \
             `fmu!(NAME)` for a `Model`; `struct NAME` instead of `NAME` also declares the type"
        ));
    };
}

/// Includes the typed interface that `fmu_export_build::generate` generated for a model identifier. For a model that
/// another crate exports; [`fmu!`] includes it itself.
#[macro_export]
macro_rules! include_variables {
    ($model_identifier:literal) => {
        include!(concat!(env!("OUT_DIR"), "/", $model_identifier, "/variables.rs"));
    };
}
