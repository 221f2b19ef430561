//! The macros that define a library's C functions, for the interfaces that an FMU offers.

/// Defines the 34 C functions of FMI 2.0 Co-Simulation for a [`Model`], in a library of crate type `cdylib`.
///
/// [`Model`]: crate::Model
#[macro_export]
macro_rules! fmi2_co_simulation {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: Model, co_simulation, CoSimulation }
    };
}

/// Defines the 35 C functions of FMI 2.0 Model Exchange for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi2_model_exchange {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: ModelExchange, model_exchange, ModelExchange }
    };
}

/// Defines the 44 C functions of FMI 2.0 with both interfaces for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi2_both {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: ModelExchange, model_exchange, Both }
    };
}

/// Defines the C functions of FMI 2.0 for the offered interfaces, those of a module of `c_api`.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi2_functions {
    ($model:ty: $kind:ident, $module:ident, $offered:ident) => {
        const _: () = {
            use $crate::fmi2::c_api::$module as functions;
            use $crate::fmi2::c_types::*;

            $crate::exported_model! { $model: $kind }
            $crate::fmi2_calls!($crate::exports, $offered);
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
}
