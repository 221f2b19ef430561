//! The macros that define a library's C functions, for the interfaces that an FMU offers.

/// Defines the 75 C functions of FMI 3.0 for a [`Model`] with Co-Simulation, in a library of crate type `cdylib`.
///
/// [`Model`]: crate::Model
#[macro_export]
macro_rules! fmi3_co_simulation {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model: Model; exit_initialization_mode; get_float64; set_float64; enter_event_mode_of_co_simulation; refuse_step_mode; do_step;
            without_scheduled_execution; without_model_exchange::
        }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi3_model_exchange {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model: ModelExchange; exit_initialization_mode_with_events; get_float64_with_indicators; set_float64; enter_event_mode;
            refuse_step_mode; do_step; without_scheduled_execution;
        }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model with [`EventMode`] in Co-Simulation, and Model Exchange if the
/// FMU offers it.
///
/// [`EventMode`]: crate::EventMode
#[macro_export]
macro_rules! fmi3_event_mode {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model: EventMode; exit_initialization_mode_with_events; get_float64_with_updates; set_float64_with_updates; enter_event_mode;
            enter_step_mode; do_step_to_event; without_scheduled_execution;
        }
    };
}

/// Defines the 75 C functions of FMI 3.0 for a model that implements [`ScheduledExecution`] and offers nothing else.
///
/// [`ScheduledExecution`]: crate::ScheduledExecution
#[macro_export]
macro_rules! fmi3_scheduled_execution {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model: ScheduledExecution; exit_initialization_mode; get_float64; set_float64; enter_event_mode_of_co_simulation; refuse_step_mode; do_step;
            scheduled_execution; without_model_exchange::
        }
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

/// Defines the C functions of FMI 3.0.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi3_functions {
    ($model:ty: $kind:ident; $exit_initialization_mode:ident; $get_float64:ident; $set_float64:ident; $enter_event_mode:ident; $enter_step_mode:ident;
        $do_step:ident; $scheduled:ident; $($model_exchange:ident::)?) => {
        const _: () = {
            use $crate::fmi3::c_types::{
                Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FmuState, Instance,
                InstanceEnvironment, IntermediateUpdateCallback, LogMessageCallback, PreemptionCallback, Status,
                String, ValueReference,
            };

            $crate::exported_model! { $model: $kind }

            #[unsafe(no_mangle)]
            extern "C" fn fmi3GetVersion() -> String {
                $crate::fmi3::c_api::VERSION.as_ptr()
            }

            $crate::exported_function! {
                fmi3FreeInstance(instance: Instance),
                |F| $crate::fmi3::c_api::free_instance::<F::Model>(instance)
            }

            $crate::fmi3_functions! { @instantiate
                fmi3InstantiateCoSimulation = instantiate_co_simulation(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    event_mode_used: Boolean, early_return_allowed: Boolean,
                    required_intermediate_variables: *const ValueReference, count: usize,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>,
                    intermediate_update: ::core::option::Option<IntermediateUpdateCallback>);
                fmi3InstantiateModelExchange = instantiate_model_exchange(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>);
                fmi3InstantiateScheduledExecution = $scheduled::instantiate_scheduled_execution(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>,
                    clock_update: ::core::option::Option<ClockUpdateCallback>,
                    lock_preemption: ::core::option::Option<PreemptionCallback>,
                    unlock_preemption: ::core::option::Option<PreemptionCallback>);
            }

            $crate::fmi3_functions! { @functions $scheduled;
                fmi3SetDebugLogging = set_debug_logging(on: Boolean, count: usize, categories: *const String);
                fmi3EnterInitializationMode = enter_initialization_mode(
                    tolerance_defined: Boolean, tolerance: f64, start_time: f64,
                    stop_time_defined: Boolean, stop_time: f64);
                fmi3ExitInitializationMode = $exit_initialization_mode();
                fmi3EnterEventMode = $enter_event_mode();
                fmi3Terminate = terminate();
                fmi3Reset = reset();
                fmi3GetBinary = get_binary(
                    vr: *const ValueReference, count: usize, sizes: *mut usize, values: *mut Binary, n: usize);
                fmi3SetBinary = set_binary(
                    vr: *const ValueReference, count: usize, sizes: *const usize, values: *const Binary, n: usize);
                fmi3GetClock = clocks::get_clock(vr: *const ValueReference, count: usize, values: *mut Clock);
                fmi3SetClock = clocks::set_clock(vr: *const ValueReference, count: usize, values: *const Clock);
                fmi3GetNumberOfVariableDependencies = get_number_of_variable_dependencies(
                    vr: ValueReference, count: *mut usize);
                fmi3GetVariableDependencies = get_variable_dependencies(
                    vr: ValueReference, elements: *mut usize, independents: *mut ValueReference,
                    elements_of_independents: *mut usize, kinds: *mut Enumeration, count: usize);
                fmi3GetFMUState = get_fmu_state(state: *mut FmuState);
                fmi3SetFMUState = set_fmu_state(state: FmuState);
                fmi3FreeFMUState = free_fmu_state(state: *mut FmuState);
                fmi3SerializedFMUStateSize = serialized_fmu_state_size(state: FmuState, size: *mut usize);
                fmi3SerializeFMUState = serialize_fmu_state(state: FmuState, bytes: *mut Byte, size: usize);
                fmi3DeserializeFMUState = deserialize_fmu_state(
                    bytes: *const Byte, size: usize, state: *mut FmuState);
                fmi3GetDirectionalDerivative = get_directional_derivative(
                    unknowns: *const ValueReference, unknown_count: usize,
                    knowns: *const ValueReference, known_count: usize,
                    seed: *const f64, seed_count: usize, sensitivity: *mut f64, sensitivity_count: usize);
                fmi3GetAdjointDerivative = get_adjoint_derivative(
                    unknowns: *const ValueReference, unknown_count: usize,
                    knowns: *const ValueReference, known_count: usize,
                    seed: *const f64, seed_count: usize, sensitivity: *mut f64, sensitivity_count: usize);
                fmi3EnterConfigurationMode = enter_configuration_mode();
                fmi3ExitConfigurationMode = exit_configuration_mode();
                fmi3GetIntervalDecimal = clocks::get_interval_decimal(
                    vr: *const ValueReference, count: usize, intervals: *mut f64, qualifiers: *mut Enumeration);
                fmi3GetIntervalFraction = clocks::get_interval_fraction(
                    vr: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64,
                    qualifiers: *mut Enumeration);
                fmi3GetShiftDecimal = clocks::get_shift_decimal(
                    vr: *const ValueReference, count: usize, shifts: *mut f64);
                fmi3GetShiftFraction = clocks::get_shift_fraction(
                    vr: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64);
                fmi3SetIntervalDecimal = clocks::set_interval_decimal(
                    vr: *const ValueReference, count: usize, intervals: *const f64);
                fmi3SetIntervalFraction = clocks::set_interval_fraction(
                    vr: *const ValueReference, count: usize, counters: *const u64, resolutions: *const u64);
                fmi3SetShiftDecimal = clocks::set_shift_decimal(
                    vr: *const ValueReference, count: usize, shifts: *const f64);
                fmi3SetShiftFraction = clocks::set_shift_fraction(
                    vr: *const ValueReference, count: usize, counters: *const u64, resolutions: *const u64);
                fmi3EvaluateDiscreteStates = evaluate_discrete_states();
                fmi3UpdateDiscreteStates = $($model_exchange::)?update_discrete_states(
                    again: *mut Boolean, terminate: *mut Boolean, nominals: *mut Boolean, values: *mut Boolean,
                    next_defined: *mut Boolean, next: *mut f64);
                fmi3EnterContinuousTimeMode = $($model_exchange::)?enter_continuous_time_mode();
                fmi3CompletedIntegratorStep = $($model_exchange::)?completed_integrator_step(
                    no_set_fmu_state_prior: Boolean, enter_event_mode: *mut Boolean, terminate: *mut Boolean);
                fmi3SetTime = $($model_exchange::)?set_time(time: f64);
                fmi3SetContinuousStates = $($model_exchange::)?set_continuous_states(
                    states: *const f64, count: usize);
                fmi3GetContinuousStateDerivatives = $($model_exchange::)?get_continuous_state_derivatives(
                    derivatives: *mut f64, count: usize);
                fmi3GetEventIndicators = $($model_exchange::)?get_event_indicators(
                    indicators: *mut f64, count: usize);
                fmi3GetContinuousStates = $($model_exchange::)?get_continuous_states(
                    states: *mut f64, count: usize);
                fmi3GetNominalsOfContinuousStates = $($model_exchange::)?get_nominals_of_continuous_states(
                    nominals: *mut f64, count: usize);
                fmi3GetNumberOfEventIndicators = get_number_of_event_indicators(count: *mut usize);
                fmi3GetNumberOfContinuousStates = get_number_of_continuous_states(count: *mut usize);
                fmi3EnterStepMode = $enter_step_mode();
                fmi3GetOutputDerivatives = get_output_derivatives(
                    vr: *const ValueReference, count: usize, orders: *const i32, values: *mut f64, n: usize);
                fmi3DoStep = $do_step(
                    time: f64, size: f64, no_set_fmu_state_prior: Boolean, event_handling_needed: *mut Boolean,
                    terminate: *mut Boolean, early_return: *mut Boolean, last_successful_time: *mut f64);
            }
            // This function takes the lock itself, except while it notifies the importer of clocks.
            $crate::exported_function! {
                fmi3ActivateModelPartition(instance: Instance, clock: ValueReference, time: f64) -> Status,
                |F| $crate::fmi3::c_api::$scheduled::activate_model_partition::<F::Model>(instance, clock, time)
            }

            $crate::fmi3_functions! { @accessors $scheduled;
                fmi3GetFloat32 = get_float32, fmi3SetFloat32 = set_float32, f32;
                fmi3GetFloat64 = $get_float64, fmi3SetFloat64 = $set_float64, f64;
                fmi3GetInt8 = get_int8, fmi3SetInt8 = set_int8, i8;
                fmi3GetUInt8 = get_uint8, fmi3SetUInt8 = set_uint8, u8;
                fmi3GetInt16 = get_int16, fmi3SetInt16 = set_int16, i16;
                fmi3GetUInt16 = get_uint16, fmi3SetUInt16 = set_uint16, u16;
                fmi3GetInt32 = get_int32, fmi3SetInt32 = set_int32, i32;
                fmi3GetUInt32 = get_uint32, fmi3SetUInt32 = set_uint32, u32;
                fmi3GetInt64 = get_int64, fmi3SetInt64 = set_int64, i64;
                fmi3GetUInt64 = get_uint64, fmi3SetUInt64 = set_uint64, u64;
                fmi3GetBoolean = get_boolean, fmi3SetBoolean = set_boolean, Boolean;
                fmi3GetString = get_string, fmi3SetString = set_string, String;
            }
            #[cfg(target_family = "wasm")]
            $crate::wasm_functions! {}
        };
    };
    (@functions $scheduled:ident; $($symbol:ident =
        $($function:ident)::+($($argument:ident: $type:ty),* $(,)?);)*) => {$(
        $crate::exported_function! {
            $symbol(instance: Instance, $($argument: $type),*) -> Status,
            |F| $crate::fmi3::c_api::$scheduled::locked::<F::Model, _>(instance, || {
                $crate::fmi3::c_api::$($function)::+::<F::Model>(instance, $($argument),*)
            })
        }
    )*};
    (@accessors $scheduled:ident; $($get:ident = $get_function:ident, $set:ident = $set_function:ident, $type:ty;)*) => {
        $crate::fmi3_functions! { @functions $scheduled; $(
            $get = $get_function(vr: *const ValueReference, count: usize, values: *mut $type, n: usize);
            $set = $set_function(vr: *const ValueReference, count: usize, values: *const $type, n: usize);
        )* }
    };
    (@instantiate $($symbol:ident = $($function:ident)::+($($argument:ident: $type:ty),* $(,)?);)*) => {$(
        $crate::exported_function! {
            $symbol($($argument: $type),*) -> Instance,
            |F| {
                $crate::fmi3::c_api::silence_panics();
                $crate::fmi3::c_api::$($function)::+::<F::Model>($($argument),*)
            }
        }
    )*};
}
