//! The macro that defines a library's C functions.

/// Defines the 75 C functions of FMI 3.0 of an [`Fmu`], in a library of crate type `cdylib`. Those of what the FMU does not
/// offer fail.
///
/// [`Fmu`]: crate::Fmu
#[macro_export]
macro_rules! fmi3_functions {
    ($model:ty) => {
        const _: () = {
            use $crate::fmi3::c_api as functions;
            use $crate::fmi3::c_types::*;

            $crate::exported_model! { $model }
            $crate::fmi3_calls!($crate::exports, locked);
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
}
