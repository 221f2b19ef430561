//! The macros that define a library's C functions, for the interfaces that an FMU offers.

/// Defines the 34 C functions of FMI 2.0 Co-Simulation for a [`Model`], in a library of crate type `cdylib`.
///
/// [`Model`]: crate::Model
#[macro_export]
macro_rules! fmi2_co_simulation {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: Model; exit_initialization_mode; co_simulation }
    };
}

/// Defines the 35 C functions of FMI 2.0 Model Exchange for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi2_model_exchange {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: ModelExchange; exit_initialization_mode_with_events; model_exchange }
    };
}

/// Defines the 44 C functions of FMI 2.0 with both interfaces for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi2_both {
    ($model:ty) => {
        $crate::fmi2_functions! { $model: ModelExchange; exit_initialization_mode_with_events; co_simulation, model_exchange }
    };
}

/// Defines the C functions of FMI 2.0: those of all FMUs, and those of interfaces.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi2_functions {
    ($model:ty: $kind:ident; $exit_initialization_mode:ident; $($interface:ident),*) => {
        const _: () = {
            use ::core::ffi::{c_char, c_int};
            use $crate::fmi2::c_types::{
                Boolean, Byte, CallbackFunctions, Component, EventInfo, FmuState, Integer, Status, ValueReference,
            };

            $crate::exported_model! { $model: $kind }

            #[unsafe(no_mangle)]
            extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
                $crate::fmi2::c_api::TYPES_PLATFORM.as_ptr()
            }

            #[unsafe(no_mangle)]
            extern "C" fn fmi2GetVersion() -> *const c_char {
                $crate::fmi2::c_api::VERSION.as_ptr()
            }

            $crate::exported_function! {
                fmi2Instantiate(
                    instance_name: *const c_char,
                    fmu_type: c_int,
                    guid: *const c_char,
                    resource_location: *const c_char,
                    functions: *const CallbackFunctions,
                    visible: Boolean,
                    logging_on: Boolean,
                ) -> Component,
                |F| {
                    $crate::fmi2::c_api::silence_panics();
                    $crate::fmi2::c_api::instantiate::<F::Model>(
                        instance_name, fmu_type, guid, resource_location, functions, visible, logging_on,
                    )
                }
            }

            $crate::exported_function! {
                fmi2FreeInstance(component: Component),
                |F| $crate::fmi2::c_api::free_instance::<F::Model>(component)
            }

            $crate::fmi2_functions! { @functions
                fmi2SetDebugLogging = set_debug_logging(
                    on: Boolean, count: usize, categories: *const *const c_char);
                fmi2SetupExperiment = setup_experiment(
                    tolerance_defined: Boolean, tolerance: f64, start_time: f64,
                    stop_time_defined: Boolean, stop_time: f64);
                fmi2EnterInitializationMode = enter_initialization_mode();
                fmi2ExitInitializationMode = $exit_initialization_mode();
                fmi2Terminate = terminate();
                fmi2Reset = reset();
                fmi2GetReal = get_real(vr: *const ValueReference, count: usize, values: *mut f64);
                fmi2GetInteger = get_integer(vr: *const ValueReference, count: usize, values: *mut Integer);
                fmi2GetBoolean = get_boolean(vr: *const ValueReference, count: usize, values: *mut Boolean);
                fmi2GetString = get_string(
                    vr: *const ValueReference, count: usize, values: *mut *const c_char);
                fmi2SetReal = set_real(vr: *const ValueReference, count: usize, values: *const f64);
                fmi2SetInteger = set_integer(
                    vr: *const ValueReference, count: usize, values: *const Integer);
                fmi2SetBoolean = set_boolean(
                    vr: *const ValueReference, count: usize, values: *const Boolean);
                fmi2SetString = set_string(
                    vr: *const ValueReference, count: usize, values: *const *const c_char);
                fmi2GetFMUstate = get_fmu_state(state: *mut FmuState);
                fmi2SetFMUstate = set_fmu_state(state: FmuState);
                fmi2FreeFMUstate = free_fmu_state(state: *mut FmuState);
                fmi2SerializedFMUstateSize = serialized_fmu_state_size(state: FmuState, size: *mut usize);
                fmi2SerializeFMUstate = serialize_fmu_state(state: FmuState, bytes: *mut Byte, size: usize);
                fmi2DeSerializeFMUstate = deserialize_fmu_state(
                    bytes: *const Byte, size: usize, state: *mut FmuState);
                fmi2GetDirectionalDerivative = get_directional_derivative(
                    unknowns: *const ValueReference, unknown_count: usize,
                    knowns: *const ValueReference, known_count: usize,
                    seed: *const f64, sensitivity: *mut f64);
            }
            $($crate::fmi2_functions! { @$interface })*
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
    (@co_simulation) => {
        $crate::fmi2_functions! { @functions
            fmi2SetRealInputDerivatives = set_real_input_derivatives(
                vr: *const ValueReference, count: usize, orders: *const Integer, values: *const f64);
            fmi2GetRealOutputDerivatives = get_real_output_derivatives(
                vr: *const ValueReference, count: usize, orders: *const Integer, values: *mut f64);
            fmi2DoStep = do_step(time: f64, size: f64, no_set_fmu_state_prior: Boolean);
            fmi2CancelStep = cancel_step();
            fmi2GetStatus = get_status(kind: c_int, value: *mut c_int);
            fmi2GetRealStatus = get_real_status(kind: c_int, value: *mut f64);
            fmi2GetIntegerStatus = get_integer_status(kind: c_int, value: *mut Integer);
            fmi2GetBooleanStatus = get_boolean_status(kind: c_int, value: *mut Boolean);
            fmi2GetStringStatus = get_string_status(kind: c_int, value: *mut *const c_char);
        }
    };
    (@model_exchange) => {
        $crate::fmi2_functions! { @functions
            fmi2EnterEventMode = enter_event_mode();
            fmi2NewDiscreteStates = new_discrete_states(info: *mut EventInfo);
            fmi2EnterContinuousTimeMode = enter_continuous_time_mode();
            fmi2CompletedIntegratorStep = completed_integrator_step(
                no_set_fmu_state_prior: Boolean, enter_event_mode: *mut Boolean, terminate: *mut Boolean);
            fmi2SetTime = set_time(time: f64);
            fmi2SetContinuousStates = set_continuous_states(states: *const f64, count: usize);
            fmi2GetDerivatives = get_derivatives(derivatives: *mut f64, count: usize);
            fmi2GetEventIndicators = get_event_indicators(indicators: *mut f64, count: usize);
            fmi2GetContinuousStates = get_continuous_states(states: *mut f64, count: usize);
            fmi2GetNominalsOfContinuousStates = get_nominals_of_continuous_states(
                nominals: *mut f64, count: usize);
        }
    };
    (@functions $($symbol:ident = $function:ident($($argument:ident: $type:ty),* $(,)?);)*) => {$(
        $crate::exported_function! {
            $symbol(component: Component, $($argument: $type),*) -> Status,
            |F| $crate::fmi2::c_api::$function::<F::Model>(component, $($argument),*)
        }
    )*};
}
