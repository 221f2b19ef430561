#![doc = include_str!("../README.md")]
// The equations of models may one day run without the standard library.
#![warn(clippy::std_instead_of_core)]

// The runtime's modules, of which each uses only those below it, as `tests/circles` checks:
//
//   fmi2, fmi3         the functions of an FMI version
//   wasm               the functions that a WebAssembly module has besides
//   c_boundary         what the functions of all versions share
//   trial              a model without an FMU, for its tests
//   instance           an FMU instance: the functions of the standard, without C
//   kinds              the kinds of models: of equations, sampled, or stepping themselves
//   model              what a model knows, and what the runtime sees of it
//   host               of a WebAssembly module
//   panics             caught where a function begins
//   allocation, checksum
//
// Below all of them are the crates fmu-solve, whose names a model uses as if they stood here, and fmu-abi.

mod allocation;
mod c_boundary;
mod checksum;
pub mod fmi2;
pub mod fmi3;
#[doc = include_str!("generic_code.md")]
pub mod generic_code {}
#[cfg(target_family = "wasm")]
mod host;
mod instance;
mod kinds;
mod model;
mod panics;
mod trial;
#[cfg(target_family = "wasm")]
#[doc(hidden)]
pub mod wasm;

#[doc(hidden)]
pub use fmu_abi::{fmi2_calls, fmi3_calls};
#[cfg(feature = "derive")]
pub use fmu_export_derive::Persistent;
#[doc(inline)]
pub use fmu_solve::{
    DEFAULT_TOLERANCE, Dual, Error, Event, Events, Integration, Number, Persistent, Recorded, Tape, display,
    event_loop, integrator, integrator::Part, integrator::TwoRates, persistence, persistent, search, space,
    steady_state, table,
};
#[doc(hidden)]
pub use fmu_solve::{EventsLeft, Stop, Stops, time};
pub use kinds::equations::{Equations, EvaluationOf, Multirate, VariablesOf};
#[doc(hidden)]
pub use kinds::integrated::{Integrate, Integrated};
#[doc(hidden)]
pub use kinds::sampled::SampledModel;
pub use kinds::sampled::{Sample, Sampled};
#[doc(hidden)]
pub use kinds::stepper::Stepped;
pub use kinds::stepper::Stepper;
pub use model::clock::Clock;
pub use model::context::{Context, Experiment, Log};
pub use model::description;
pub use model::inputs::{InputSignal, Inputs, MAX_ORDER, RealInput};
#[doc(hidden)]
pub use model::typed;
pub use model::variables::{Accessed, Described, Numbered, Variables};
pub use model::{Fmu, InputsOf, Step};
#[doc(hidden)]
pub use model::{Model, Serves};
pub use trial::dependencies::check_dependencies;
pub use trial::simulation::Simulation;

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

        impl $crate::Fmu for $exported {
            type Model = $model;
        }

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
