//! The functions of FMI 2.0, generic over the model. [`fmi2_co_simulation!`] and its siblings define their symbols in
//! the exported library.
//!
//! [`fmi2_co_simulation!`]: crate::fmi2_co_simulation

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]

use core::ffi::{CStr, c_char, c_int, c_void};
use core::ptr;
use std::ffi::CString;

pub use crate::c_boundary::silence_panics;

use super::c_types::{
    Boolean, Byte, CO_SIMULATION, CallbackFunctions, CallbackLogger, Component, EventInfo, FALSE, FmuState,
    Integer, MODEL_EXCHANGE, Status, ValueReference, status_kind,
};
use super::calling_sequence::Function;
use crate::c_boundary::{self, c_string, call, elements, get_values, not_null, set_values, write_elements};
use crate::calling_sequence::Interface;
use crate::context::Experiment;
use crate::description::DataType;
use crate::error::Error;
use crate::instance::Instance;
use crate::logger::{Logger, Recipient};
use crate::model::Model;
use crate::model_exchange::ModelExchange;
use crate::resources::Resources;
use crate::variables::Variables;

/// `fmi2GetVersion`.
pub const VERSION: &CStr = c"2.0";
/// `fmi2GetTypesPlatform`.
pub const TYPES_PLATFORM: &CStr = c"default";

/// The importer's logger, with its arguments that identify the instance.
#[derive(Debug)]
#[cfg_attr(target_family = "wasm", expect(dead_code, reason = "a module calls the host's function instead"))]
struct Callback {
    function: CallbackLogger,
    environment: *mut c_void,
    instance_name: CString,
}

impl Recipient for Callback {
    #[cfg(target_family = "wasm")]
    fn receive(&self, status: Status, category: &CStr, text: &CStr) {
        // SAFETY: the host reads the strings, which outlive the call. No reference to an instance exists during it.
        unsafe { crate::wasm::host::log(self.environment, status, category.as_ptr(), text.as_ptr()) }
    }

    #[cfg(not(target_family = "wasm"))]
    fn receive(&self, status: Status, category: &CStr, text: &CStr) {
        // SAFETY: the importer passed the callback for this purpose (section 2.1.5); every pointer is to a
        // NUL-terminated string that outlives the call, and "%s" reads the variadic argument. No reference to an
        // instance exists during the call.
        unsafe {
            (self.function)(
                self.environment,
                self.instance_name.as_ptr(),
                status,
                category.as_ptr(),
                c"%s".as_ptr(),
                text.as_ptr(),
            );
        }
    }
}

/// `fmi2Instantiate`: null and a message if an argument is wrong.
#[must_use]
pub unsafe fn instantiate<M: Model>(
    instance_name: *const c_char,
    fmu_type: c_int,
    guid: *const c_char,
    resource_location: *const c_char,
    functions: *const CallbackFunctions,
    _visible: Boolean,
    logging_on: Boolean,
) -> Component {
    if functions.is_null() {
        return ptr::null_mut();
    }
    // SAFETY: the importer passes null or a callbacks struct that is valid during this call. Only the needed fields
    // are read, and the struct may be at any address.
    let (callback, environment) = unsafe {
        let environment = (&raw const (*functions).component_environment).read_unaligned();
        ((&raw const (*functions).logger).read_unaligned(), environment)
    };
    let description = M::Variables::DESCRIPTION;
    // SAFETY: the importer passes null or a string.
    let name = unsafe { c_string("instanceName", instance_name) };
    let instance_name = name.as_ref().map_or_else(|_| c"".to_owned(), |&name| name.to_owned());
    let recipient = callback.map(|function| Callback { function, environment, instance_name });
    let logger = Logger::new(recipient, description.log_categories, logging_on != FALSE, true);
    let check = || -> Result<Interface, Error> {
        // C's white space: section 2.1.5 requires at least one other character.
        if name?.to_bytes().iter().all(|byte| matches!(byte, b' ' | b'\t'..=b'\r')) {
            return Err(Error::new("the argument instanceName is blank"));
        }
        // SAFETY: the importer passes null or a string.
        let guid = unsafe { c_string("fmuGUID", guid) }?;
        if guid.to_bytes() != description.guid.as_bytes() {
            return Err(Error::new(format!(
                "the GUID {guid:?} is another FMU's; the one of {} is {}",
                description.model_identifier, description.guid
            )));
        }
        let interfaces = description.interfaces;
        match fmu_type {
            CO_SIMULATION if interfaces.co_simulation => Ok(Interface::CoSimulation),
            MODEL_EXCHANGE if interfaces.model_exchange => Ok(Interface::ModelExchange),
            CO_SIMULATION => Err(Error::new("this FMU is for Model Exchange, not for Co-Simulation")),
            MODEL_EXCHANGE => Err(Error::new("this FMU is for Co-Simulation, not for Model Exchange")),
            other => Err(Error::new(format!("the argument fmuType is {other}, which is not an fmi2Type"))),
        }
    };
    c_boundary::instantiate::<M>("fmi2Instantiate", logger, check(), |instance| {
        if description.has_resources {
            // SAFETY: the importer passes null or a string.
            let location = unsafe { c_string("fmuResourceLocation", resource_location) };
            instance.resources = Resources::at(location.ok().map(CStr::to_bytes));
        }
    })
}

/// `fmi2FreeInstance`; frees the remaining states, too.
pub unsafe fn free_instance<M: Model>(component: Component) {
    // SAFETY: the component is the importer's (see the module).
    unsafe { c_boundary::free::<M>(component) }
}

/// `fmi2SetDebugLogging`.
pub unsafe fn set_debug_logging<M: Model>(
    component: Component,
    logging_on: Boolean,
    count: usize,
    categories: *const *const c_char,
) -> Status {
    let (function, categories) = (Function::SetDebugLogging, (categories, count));
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe { c_boundary::set_debug_logging::<M>(component, function, logging_on != FALSE, categories) }
}

/// `fmi2SetupExperiment`.
pub unsafe fn setup_experiment<M: Model>(
    component: Component,
    tolerance_defined: Boolean,
    tolerance: f64,
    start_time: f64,
    stop_time_defined: Boolean,
    stop_time: f64,
) -> Status {
    let experiment = Experiment {
        start_time,
        stop_time: (stop_time_defined != FALSE).then_some(stop_time),
        tolerance: (tolerance_defined != FALSE).then_some(tolerance),
    };
    // SAFETY: the component is the importer's (see the module).
    unsafe {
        call::<M>(component, Function::SetupExperiment, |instance| instance.setup_experiment(experiment))
    }
}

/// Defines functions whose only argument is the component.
macro_rules! transitions {
    ($($model:ident: $name:ident: $function:ident;)*) => {$(
        #[doc = concat!("`fmi2", stringify!($function), "`.")]
        pub unsafe fn $name<M: $model>(component: Component) -> Status {
            // SAFETY: the component is the importer's (see the module).
            unsafe { call::<M>(component, Function::$function, Instance::$name) }
        }
    )*};
}

transitions! {
    Model: enter_initialization_mode: EnterInitializationMode;
    Model: exit_initialization_mode: ExitInitializationMode;
    ModelExchange: exit_initialization_mode_with_events: ExitInitializationMode;
    ModelExchange: enter_event_mode: EnterEventMode;
    ModelExchange: enter_continuous_time_mode: EnterContinuousTimeMode;
    Model: terminate: Terminate;
    Model: reset: Reset;
}

/// Defines functions that get or set arrays of types shared by C and Rust.
macro_rules! accessors {
    ($($get:ident: $get_function:ident, $set:ident: $set_function:ident, $type:ty;)*) => {$(
        #[doc = concat!("`fmi2", stringify!($get_function), "`.")]
        pub unsafe fn $get<M: Model>(
            component: Component,
            references: *const ValueReference,
            count: usize,
            values: *mut $type,
        ) -> Status {
            let (function, references, values) = (Function::$get_function, (references, count), (values, count));
            // SAFETY: the component and the arrays are the importer's (see the module).
            unsafe { get_values::<M, _, _>(component, function, references, values, Instance::$get) }
        }

        #[doc = concat!("`fmi2", stringify!($set_function), "`.")]
        pub unsafe fn $set<M: Model>(
            component: Component,
            references: *const ValueReference,
            count: usize,
            values: *const $type,
        ) -> Status {
            let (function, references, values) = (Function::$set_function, (references, count), (values, count));
            // SAFETY: the component and the arrays are the importer's (see the module).
            unsafe { set_values::<M, _, _>(component, function, references, values, Instance::$set) }
        }
    )*};
}

accessors! {
    get_real: GetReal, set_real: SetReal, f64;
    get_boolean: GetBoolean, set_boolean: SetBoolean, Boolean;
}

/// The types accessed by the Integer functions.
const INTEGERS: &[DataType] = &[DataType::Integer, DataType::Enumeration];

/// `fmi2GetInteger`.
pub unsafe fn get_integer<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut Integer,
) -> Status {
    let (references, values) = ((references, count), (values, count));
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe {
        get_values::<M, _, _>(
            component,
            Function::GetInteger,
            references,
            values,
            |instance, references, values| instance.get_integers(references, values, INTEGERS),
        )
    }
}

/// `fmi2SetInteger`.
pub unsafe fn set_integer<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const Integer,
) -> Status {
    let (references, values) = ((references, count), (values, count));
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe {
        set_values::<M, _, _>(
            component,
            Function::SetInteger,
            references,
            values,
            |instance, references, values| instance.set_integers(references, values, INTEGERS),
        )
    }
}

/// `fmi2GetString`. The strings stay valid until its next call for this instance.
pub unsafe fn get_string<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *mut *const c_char,
) -> Status {
    let (references, values) = ((references, count), (values, count));
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe { c_boundary::get_strings::<M>(component, Function::GetString, references, values) }
}

/// `fmi2SetString`. The strings are copied.
pub unsafe fn set_string<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    values: *const *const c_char,
) -> Status {
    let (references, values) = ((references, count), (values, count));
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe { c_boundary::set_strings::<M, _>(component, Function::SetString, references, values) }
}

/// `fmi2GetFMUstate`: into a new state if `*state` is null, otherwise over the existing one.
pub unsafe fn get_fmu_state<M: Model>(component: Component, state: *mut FmuState) -> Status {
    // SAFETY: the component and the state are the importer's (see the module).
    unsafe { c_boundary::get_state::<M>(component, Function::GetFMUstate, state) }
}

/// `fmi2SetFMUstate`.
pub unsafe fn set_fmu_state<M: Model>(component: Component, state: FmuState) -> Status {
    // SAFETY: the component is the importer's (see the module).
    unsafe { c_boundary::set_state::<M>(component, Function::SetFMUstate, state) }
}

/// `fmi2FreeFMUstate`: null is a no-op.
pub unsafe fn free_fmu_state<M: Model>(component: Component, state: *mut FmuState) -> Status {
    // SAFETY: the component and the state are the importer's (see the module).
    unsafe { c_boundary::free_state::<M>(component, Function::FreeFMUstate, state) }
}

/// `fmi2SerializedFMUstateSize`.
pub unsafe fn serialized_fmu_state_size<M: Model>(
    component: Component,
    state: FmuState,
    size: *mut usize,
) -> Status {
    // SAFETY: the component and the size are the importer's (see the module).
    unsafe { c_boundary::serialized_size::<M>(component, Function::SerializedFMUstateSize, state, size) }
}

/// `fmi2SerializeFMUstate`: into as many bytes as `fmi2SerializedFMUstateSize` reports.
pub unsafe fn serialize_fmu_state<M: Model>(
    component: Component,
    state: FmuState,
    serialized_state: *mut Byte,
    size: usize,
) -> Status {
    let bytes = (serialized_state.cast(), size);
    // SAFETY: the component and the array are the importer's (see the module).
    unsafe { c_boundary::serialize::<M>(component, Function::SerializeFMUstate, state, bytes) }
}

/// `fmi2DeSerializeFMUstate`: always into a new state.
pub unsafe fn deserialize_fmu_state<M: Model>(
    component: Component,
    serialized_state: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let bytes = (serialized_state.cast(), size);
    // SAFETY: the component, the array and the state are the importer's (see the module).
    unsafe { c_boundary::deserialize::<M>(component, Function::DeSerializeFMUstate, bytes, state) }
}

/// Defines functions of capabilities that this crate's FMUs lack.
macro_rules! not_supported {
    ($($name:ident($($argument:ty),*): $function:ident, $capability:literal;)*) => {$(
        #[doc = concat!("`fmi2", stringify!($function), "`: an error, as `", $capability, "` says.")]
        pub unsafe fn $name<M: Model>(component: Component, $(_: $argument),*) -> Status {
            // SAFETY: the component is the importer's (see the module).
            unsafe {
                call::<M>(component, Function::$function, |_| {
                    Err(Error::new(concat!("not supported by this FMU (", $capability, ")")))
                })
            }
        }
    )*};
}

not_supported! {
    cancel_step(): CancelStep, "canRunAsynchronuously is false";
}

/// `fmi2GetDirectionalDerivative`.
pub unsafe fn get_directional_derivative<M: Model>(
    component: Component,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seeds: *const f64,
    sensitivities: *mut f64,
) -> Status {
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(component, Function::GetDirectionalDerivative, |instance| {
            let unknowns = elements("vUnknown_ref", unknowns, unknown_count)?;
            let knowns = elements("vKnown_ref", knowns, known_count)?;
            let seeds = elements("dvKnown", seeds, known_count)?;
            write_elements("dvUnknown", sensitivities, unknown_count, |sensitivities| {
                instance.get_directional_derivative(&unknowns, &knowns, &seeds, sensitivities)
            })
        })
    }
}

/// `fmi2GetRealOutputDerivatives`.
pub unsafe fn get_real_output_derivatives<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *mut f64,
) -> Status {
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(component, Function::GetRealOutputDerivatives, |instance| {
            let references = elements("vr", references, count)?;
            let orders = elements("order", orders, count)?;
            write_elements("value", values, count, |values| {
                instance.get_real_output_derivatives(&references, &orders, values)
            })
        })
    }
}

/// `fmi2SetRealInputDerivatives`.
pub unsafe fn set_real_input_derivatives<M: Model>(
    component: Component,
    references: *const ValueReference,
    count: usize,
    orders: *const Integer,
    values: *const f64,
) -> Status {
    // SAFETY: the component and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(component, Function::SetRealInputDerivatives, |instance| {
            instance.set_real_input_derivatives(
                &elements("vr", references, count)?,
                &elements("order", orders, count)?,
                &elements("value", values, count)?,
            )
        })
    }
}

/// `fmi2DoStep`.
pub unsafe fn do_step<M: Model>(
    component: Component,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
) -> Status {
    // SAFETY: the component is the importer's (see the module).
    unsafe {
        call::<M>(component, Function::DoStep, |instance| {
            instance.do_step(current_communication_point, communication_step_size)
        })
    }
}

/// Returns the status of a step. Status information of asynchronous steps is discarded, as section 2.1.3 requires of
/// unavailable information.
///
/// # Safety
/// As for [`call`]; `value` is null or may be written to.
unsafe fn status<M: Model, T>(
    component: Component,
    function: Function,
    value: *mut T,
    answer: impl FnOnce(&Instance<M>) -> Option<T>,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        call::<M>(component, function, |instance| {
            let value = not_null("value", value)?;
            if let Some(known) = answer(instance) {
                value.write_unaligned(known);
                return Ok(Status::Ok);
            }
            instance.log_discarded(format_args!("a step has no such status"));
            Ok(Status::Discard)
        })
    }
}

/// `fmi2GetStatus`: steps are never pending.
pub unsafe fn get_status<M: Model>(component: Component, _kind: c_int, value: *mut c_int) -> Status {
    // SAFETY: the component and the value are the importer's (see the module).
    unsafe { status::<M, _>(component, Function::GetStatus, value, |_| None) }
}

/// `fmi2GetRealStatus`: the end of the last completed step.
pub unsafe fn get_real_status<M: Model>(component: Component, kind: c_int, value: *mut f64) -> Status {
    // SAFETY: the component and the value are the importer's (see the module).
    unsafe {
        status::<M, _>(component, Function::GetRealStatus, value, |instance| {
            (kind == status_kind::LAST_SUCCESSFUL_TIME).then(|| instance.last_successful_time())
        })
    }
}

/// `fmi2GetIntegerStatus`: no status is an Integer.
pub unsafe fn get_integer_status<M: Model>(
    component: Component,
    _kind: c_int,
    value: *mut Integer,
) -> Status {
    // SAFETY: the component and the value are the importer's (see the module).
    unsafe { status::<M, _>(component, Function::GetIntegerStatus, value, |_| None) }
}

/// `fmi2GetBooleanStatus`: whether the model requests the end of the simulation.
pub unsafe fn get_boolean_status<M: Model>(component: Component, kind: c_int, value: *mut Boolean) -> Status {
    // SAFETY: the component and the value are the importer's (see the module).
    unsafe {
        status::<M, _>(component, Function::GetBooleanStatus, value, |instance| {
            (kind == status_kind::TERMINATED).then(|| Boolean::from(instance.asks_for_end()))
        })
    }
}

/// `fmi2GetStringStatus`: steps are never pending.
pub unsafe fn get_string_status<M: Model>(
    component: Component,
    _kind: c_int,
    value: *mut *const c_char,
) -> Status {
    // SAFETY: the component and the value are the importer's (see the module).
    unsafe { status::<M, _>(component, Function::GetStringStatus, value, |_| None) }
}

/// `fmi2NewDiscreteStates`.
pub unsafe fn new_discrete_states<M: ModelExchange>(component: Component, info: *mut EventInfo) -> Status {
    // SAFETY: the component and the result are the importer's (see the module).
    unsafe {
        call::<M>(component, Function::NewDiscreteStates, |instance| {
            let info = not_null("fmi2eventInfo", info)?;
            let (status, found) = instance.new_discrete_states()?;
            info.write_unaligned(EventInfo {
                new_discrete_states_needed: Boolean::from(found.again),
                terminate_simulation: Boolean::from(found.terminate),
                nominals_of_continuous_states_changed: FALSE,
                values_of_continuous_states_changed: Boolean::from(found.states_changed),
                next_event_time_defined: Boolean::from(found.next.is_some()),
                next_event_time: found.next.unwrap_or_default(),
            });
            Ok(status)
        })
    }
}

/// `fmi2CompletedIntegratorStep`: does nothing, as `completedIntegratorStepNotNeeded` says.
pub unsafe fn completed_integrator_step<M: ModelExchange>(
    component: Component,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate_simulation: *mut Boolean,
) -> Status {
    // SAFETY: the component and the results are the importer's (see the module).
    unsafe {
        call::<M>(component, Function::CompletedIntegratorStep, |_| {
            let enter_event_mode = not_null("enterEventMode", enter_event_mode)?;
            let terminate_simulation = not_null("terminateSimulation", terminate_simulation)?;
            enter_event_mode.write_unaligned(FALSE);
            terminate_simulation.write_unaligned(FALSE);
            Ok(Status::Ok)
        })
    }
}

/// `fmi2SetTime`.
pub unsafe fn set_time<M: ModelExchange>(component: Component, time: f64) -> Status {
    // SAFETY: the component is the importer's (see the module).
    unsafe { call::<M>(component, Function::SetTime, |instance| instance.set_time(time)) }
}

/// `fmi2SetContinuousStates`.
pub unsafe fn set_continuous_states<M: ModelExchange>(
    component: Component,
    states: *const f64,
    count: usize,
) -> Status {
    // SAFETY: the component and the array are the importer's (see the module).
    unsafe {
        c_boundary::set_continuous_states::<M>(
            component,
            Function::SetContinuousStates,
            ["x", "nx"],
            (states, count),
        )
    }
}

/// Defines functions that get an array of all states or event indicators.
macro_rules! arrays {
    ($($name:ident: $function:ident, $arguments:expr, $elements:ident;)*) => {$(
        #[doc = concat!("`fmi2", stringify!($function), "`.")]
        pub unsafe fn $name<M: ModelExchange>(component: Component, values: *mut f64, count: usize) -> Status {
            let (function, of) = (Function::$function, ($arguments, M::Variables::$elements));
            // SAFETY: the component and the array are the importer's (see the module).
            unsafe { c_boundary::get_array::<M>(component, function, of, (values, count), Instance::$name) }
        }
    )*};
}

arrays! {
    get_derivatives: GetDerivatives, ["derivatives", "nx"], STATE_NAMES;
    get_event_indicators: GetEventIndicators, ["eventIndicators", "ni"], EVENT_INDICATORS;
    get_continuous_states: GetContinuousStates, ["x", "nx"], STATE_NAMES;
    get_nominals_of_continuous_states: GetNominalsOfContinuousStates, ["x_nominal", "nx"], STATE_NAMES;
}

/// Defines the 34 C functions of FMI 2.0 Co-Simulation for a [`Model`], in a library of crate type `cdylib`.
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
