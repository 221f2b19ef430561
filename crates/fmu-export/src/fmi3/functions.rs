//! The macros that define a library's C functions, for the interfaces that an FMU offers.

/// Defines the 75 C functions of FMI 3.0 for a [`Model`] with Co-Simulation, in a library of crate type `cdylib`.
///
/// [`Model`]: crate::Model
#[macro_export]
macro_rules! fmi3_co_simulation {
    ($model:ty) => {
        $crate::fmi3_functions! { $model: Model, co_simulation }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi3_model_exchange {
    ($model:ty) => {
        $crate::fmi3_functions! { $model: ModelExchange, model_exchange }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model with [`EventMode`] in Co-Simulation, and Model Exchange if the
/// FMU offers it.
///
/// [`EventMode`]: crate::EventMode
#[macro_export]
macro_rules! fmi3_event_mode {
    ($model:ty) => {
        $crate::fmi3_functions! { $model: EventMode, event_mode }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model that implements [`ScheduledExecution`] and offers nothing else.
///
/// [`ScheduledExecution`]: crate::ScheduledExecution
#[macro_export]
macro_rules! fmi3_scheduled_execution {
    ($model:ty) => {
        $crate::fmi3_functions! { $model: ScheduledExecution, scheduled_execution }
    };
}

/// Explains why a model without a clock has no library for Scheduled Execution.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi3_without_clock {
    ($model:ty) => {
        ::core::compile_error!(
            "Scheduled Execution needs a clock in the model's JSON: a variable of the type Clock, or of a sampled model \
             \"clock\": {\"name\": \"sample_clock\"}"
        );
    };
}

/// Defines the C functions of FMI 3.0, those of a module of `c_api`.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi3_functions {
    ($model:ty: $kind:ident, $module:ident) => {
        const _: () = {
            use $crate::fmi3::c_api::$module as functions;
            use $crate::fmi3::c_types::*;

            $crate::exported_model! { $model: $kind }
            $crate::fmi3_calls!($crate::exports, locked);
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
}
