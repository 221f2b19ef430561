//! The macros that define a library's C functions, for the interfaces that an FMU offers.

/// Defines the 34 C functions of FMI 2.0 Co-Simulation of an [`Fmu`], in a library of crate type `cdylib`.
///
/// [`Fmu`]: crate::Fmu
#[macro_export]
macro_rules! fmi2_co_simulation {
    ($model:ty) => {
        $crate::fmi2_functions! { $model, CoSimulation }
    };
}

/// Defines the 35 C functions of FMI 2.0 Model Exchange.
#[macro_export]
macro_rules! fmi2_model_exchange {
    ($model:ty) => {
        $crate::fmi2_functions! { $model, ModelExchange }
    };
}

/// Defines the 44 C functions of FMI 2.0 with both interfaces.
#[macro_export]
macro_rules! fmi2_both {
    ($model:ty) => {
        $crate::fmi2_functions! { $model, Both }
    };
}

/// Defines the C functions of FMI 2.0 for the offered interfaces.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi2_functions {
    ($model:ty, $offered:ident) => {
        const _: () = {
            use $crate::fmi2::c_api as functions;
            use $crate::fmi2::c_types::*;

            $crate::exported_model! { $model }
            $crate::fmi2_calls!($crate::exports, $offered);
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
}
