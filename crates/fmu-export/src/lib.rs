#![doc = include_str!("../README.md")]
// What a sampled model is written against also runs where there is no operating system, without an allocator.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(
    target_os = "none",
    allow(dead_code, reason = "the runtime of FMUs uses more of what a model is written against")
)]
#![warn(clippy::std_instead_of_core)]

// The runtime's modules, of which each uses only those below it, as `tests/circles` checks:
//
//   fmi2, fmi3         the functions of an FMI version
//   wasm               the functions that a WebAssembly module has besides
//   c_boundary         what the functions of all versions share
//   trial              a model without an FMU, for its tests
//   instance           an FMU instance: the functions of the standard, without C
//   kinds              the kinds of models: of equations, sampled, or stepping themselves; what the runtime sees of them
//   task, frames       a sampled model without an FMU, as firmware runs it, and what it sends and receives
//   calibration        parameters and measurements as calibration tools see them
//   model              what a model is written against
//   host               of a WebAssembly module
//   panics             caught where a function begins
//   allocation, checksum
//
// Below all of them are the crates fmu-solve, whose names a model uses as if they stood here, and fmu-abi. Without an
// operating system there are those from task to model, and checksum.

#[cfg(not(target_os = "none"))]
mod allocation;
#[cfg(not(target_os = "none"))]
mod c_boundary;
pub mod calibration;
mod checksum;
#[cfg(not(target_os = "none"))]
pub mod fmi2;
#[cfg(not(target_os = "none"))]
pub mod fmi3;
pub mod frames;
#[doc = include_str!("generic_code.md")]
pub mod generic_code {}
#[cfg(target_family = "wasm")]
mod host;
#[cfg(not(target_os = "none"))]
mod instance;
#[cfg(not(target_os = "none"))]
mod kinds;
mod model;
#[cfg(not(target_os = "none"))]
mod panics;
mod task;
#[cfg(not(target_os = "none"))]
mod trial;
#[cfg(target_family = "wasm")]
#[doc(hidden)]
pub mod wasm;

#[cfg(feature = "derive")]
pub use fmu_export_derive::Persistent;
#[doc(inline)]
pub use fmu_solve::{Dual, Error, Float, Number, Persistent, display, persistence, persistent, space, table};
pub use model::clock::Clock;
pub use model::context::{Context, Experiment, Log};
pub use model::description;
pub use model::inputs::{Inputs, RealInput};
pub use model::sampled::{Sample, Sampled};
#[doc(hidden)]
pub use model::typed;
pub use model::variables::{Accessed, Described, Numbered, Variables};
pub use task::Task;

#[cfg(not(target_os = "none"))]
#[doc(inline)]
pub use fmu_solve::{
    DEFAULT_TOLERANCE, Event, Events, Integration, Recorded, Tape, event_loop, integrator, integrator::Part,
    integrator::TwoRates, search, steady_state,
};
#[cfg(not(target_os = "none"))]
#[doc(hidden)]
pub use {
    fmu_abi::{fmi2_calls, fmi3_calls},
    fmu_solve::{EventsLeft, Stop, Stops, time},
    kinds::integrated::{Integrate, Integrated},
    kinds::sampled::SampledModel,
    kinds::stepper::Stepped,
    kinds::{Model, Serves},
};
#[cfg(not(target_os = "none"))]
pub use {
    kinds::equations::{Equations, EvaluationOf, Multirate, VariablesOf},
    kinds::input_signal::{InputSignal, MAX_ORDER},
    kinds::stepper::Stepper,
    kinds::{Fmu, InputsOf, Step},
    trial::dependencies::check_dependencies,
    trial::simulation::Simulation,
};

/// Defines the FMU of a crate whose library is named after the model identifier: the module `variables` that
/// `fmu_export_build::generate` generated from the model's JSON, with its items in scope, and the FMI functions for a
/// type that implements [`Equations`], [`Sampled`] or [`Stepper`]. `struct` before the type's name declares it, for a model
/// without other memory.
///
/// ```ignore
/// fmu_export::fmu!(equations struct Lag);
///
/// impl fmu_export::Equations for Lag {
///     type Variables = Variables;
///     // ...
/// }
/// ```
#[macro_export]
macro_rules! fmu {
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
    (stepper struct $model:ident) => {
        $crate::fmu!(@struct $model);
        $crate::fmu!(stepper $model);
    };
    (stepper $model:ident) => {
        $crate::fmu!(@exported $model, $crate::Stepped<$model>);
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

        #[cfg(not(target_os = "none"))]
        impl $crate::Fmu for $exported {
            type Model = $model;
        }

        #[cfg(not(target_os = "none"))]
        variables::export_functions!($exported);
    };
    ($($other:tt)*) => {
        ::core::compile_error!(::core::concat!(
            "`fmu!(", ::core::stringify!($($other)*), ")` is none of `fmu!(equations NAME)`, `fmu!(sampled NAME)` and \
             `fmu!(stepper NAME)`; `struct NAME` instead of `NAME` also declares the type"
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
