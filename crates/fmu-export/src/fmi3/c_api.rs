//! The functions of FMI 3.0, generic over the model. [`fmi3_co_simulation!`] and its siblings define their symbols in the
//! exported library: all 75, whatever the FMU offers.
//!
//! [`fmi3_co_simulation!`]: crate::fmi3_co_simulation

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]

use core::ffi::{CStr, c_char};
use core::ptr;

use super::c_types::{
    Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FALSE, FmuState, Instance,
    InstanceEnvironment, IntermediateUpdateCallback, LogMessageCallback, PreemptionCallback, Status, String,
    ValueReference,
};
use super::calling_sequence::Function;
use crate::c_boundary::{
    self, Exported, c_string, call, elements, get_values, not_null, set_values, write_elements,
};
use crate::calling_sequence::{Function as _, Interface};
use crate::description::DataType;
use crate::error::Error;
use crate::instance::{self, Answer};
use crate::logger::{Logger, Recipient};
use crate::model::{Experiment, Model, Variables};
use crate::model_exchange::ModelExchange;
use crate::resources::Resources;

pub use crate::c_boundary::silence_panics;

/// `fmi3GetVersion`.
pub const VERSION: &CStr = c"3.0";

/// The importer's logger, with its argument that identifies the instance.
#[derive(Debug)]
struct Callback {
    function: LogMessageCallback,
    environment: InstanceEnvironment,
}

impl Recipient for Callback {
    fn receive(&self, status: Status, category: &CStr, text: &CStr) {
        // SAFETY: the importer passed the callback for this purpose (section 2.3.1); the strings outlive the call. No
        // reference to an instance exists during the call.
        unsafe { (self.function)(self.environment, status, category.as_ptr(), text.as_ptr()) }
    }
}

/// Instantiates for an interface: null, and a message, when an argument is wrong or `refusal` says why not.
///
/// # Safety
/// The strings are null or end in NUL.
unsafe fn instantiate<M: Model>(
    function: &str,
    interface: Result<Interface, Error>,
    [instance_name, token, resource_path]: [String; 3],
    logging_on: Boolean,
    early_return_allowed: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
) -> Instance {
    let description = M::Variables::DESCRIPTION;
    let recipient = log_message.map(|function| Callback { function, environment });
    let logger = Logger::new(recipient, description.log_categories, logging_on != FALSE, false);
    let check = || -> Result<Interface, Error> {
        // SAFETY: the caller's promise.
        let (name, token) =
            unsafe { (c_string("instanceName", instance_name)?, c_string("instantiationToken", token)?) };
        if name.to_bytes().iter().all(|byte| matches!(byte, b' ' | b'\t'..=b'\r')) {
            return Err(Error::new("the argument instanceName is blank"));
        }
        if token.to_bytes() != description.guid.as_bytes() {
            return Err(Error::new(format!(
                "the instantiation token {token:?} is another FMU's; the one of {} is {}",
                description.model_identifier, description.guid
            )));
        }
        let interface = interface?;
        let is_offered = match interface {
            Interface::CoSimulation => description.interfaces.co_simulation,
            Interface::ModelExchange => description.interfaces.model_exchange,
        };
        if is_offered {
            Ok(interface)
        } else {
            Err(Error::new(format!("this FMU does not offer {interface}")))
        }
    };
    let resources = if description.has_resources {
        // SAFETY: the caller's promise.
        let path = unsafe { c_string("resourcePath", resource_path) };
        Resources::at_path(path.ok().map(CStr::to_bytes))
    } else {
        Resources::none()
    };
    match check().and_then(instance::Instance::<M>::new_memory) {
        Ok(memory) => {
            let mut instance = instance::Instance::new(logger, memory, resources);
            instance.early_return_allowed = early_return_allowed != FALSE;
            Exported::handle(instance)
        }
        Err(error) => {
            logger.error(format_args!("{function}: {error}"));
            if let Some(messages) = logger.take() {
                messages.deliver();
            }
            ptr::null_mut()
        }
    }
}

/// `fmi3InstantiateCoSimulation`: null, and a message, when an argument is wrong.
#[must_use]
pub unsafe fn instantiate_co_simulation<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    event_mode_used: Boolean,
    early_return_allowed: Boolean,
    required_intermediate_variables: *const ValueReference,
    required_intermediate_variable_count: usize,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
    _intermediate_update: Option<IntermediateUpdateCallback>,
) -> Instance {
    let interface = if event_mode_used != FALSE {
        Err(Error::new("eventModeUsed is true, but this FMU has no Event Mode (hasEventMode is false)"))
    } else if required_intermediate_variable_count > 0 {
        // SAFETY: the array is the importer's (see the module).
        unsafe {
            elements(
                "requiredIntermediateVariables",
                required_intermediate_variables,
                required_intermediate_variable_count,
            )
        }
        .and_then(|references| {
            let first = references[0];
            let name = M::Variables::description(first).map_or("unknown", |variable| variable.name);
            Err(Error::new(format!(
                "requiredIntermediateVariables: the variable {name} with the value reference {first} is not \
                 available in Intermediate Update Mode (intermediateUpdate is false)"
            )))
        })
    } else {
        Ok(Interface::CoSimulation)
    };
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateCoSimulation",
            interface,
            strings,
            logging_on,
            early_return_allowed,
            environment,
            log_message,
        )
    }
}

/// `fmi3InstantiateModelExchange`: null, and a message, when an argument is wrong.
#[must_use]
pub unsafe fn instantiate_model_exchange<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
) -> Instance {
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateModelExchange",
            Ok(Interface::ModelExchange),
            strings,
            logging_on,
            FALSE,
            environment,
            log_message,
        )
    }
}

/// `fmi3InstantiateScheduledExecution`: null, and a message.
#[must_use]
pub unsafe fn instantiate_scheduled_execution<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
    _clock_update: Option<ClockUpdateCallback>,
    _lock_preemption: Option<PreemptionCallback>,
    _unlock_preemption: Option<PreemptionCallback>,
) -> Instance {
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateScheduledExecution",
            Err(Error::new("this FMU does not offer Scheduled Execution")),
            strings,
            logging_on,
            FALSE,
            environment,
            log_message,
        )
    }
}

/// `fmi3FreeInstance`; the states that were not freed are freed too.
pub unsafe fn free_instance<M: Model>(instance: Instance) {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { c_boundary::free::<M>(instance) }
}

/// `fmi3SetDebugLogging`.
pub unsafe fn set_debug_logging<M: Model>(
    instance: Instance,
    logging_on: Boolean,
    count: usize,
    categories: *const String,
) -> Status {
    let (function, categories) = (Function::SetDebugLogging, (categories, count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe { c_boundary::set_debug_logging::<M>(instance, function, logging_on != FALSE, categories) }
}

/// `fmi3EnterInitializationMode`.
pub unsafe fn enter_initialization_mode<M: Model>(
    instance: Instance,
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
    // SAFETY: the instance is the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::EnterInitializationMode, |instance| {
            let status = instance.setup_experiment(experiment)?;
            Ok(status.max(instance.enter_initialization_mode()?))
        })
    }
}

/// Defines functions whose only argument is the instance.
macro_rules! transitions {
    ($($model:ident: $name:ident: $function:ident;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`.")]
        pub unsafe fn $name<M: $model>(instance: Instance) -> Status {
            // SAFETY: the instance is the importer's (see the module).
            unsafe { call::<M>(instance, Function::$function, instance::Instance::$name) }
        }
    )*};
}

transitions! {
    Model: exit_initialization_mode: ExitInitializationMode;
    ModelExchange: exit_initialization_mode_with_events: ExitInitializationMode;
    ModelExchange: enter_continuous_time_mode: EnterContinuousTimeMode;
    Model: terminate: Terminate;
    Model: reset: Reset;
}

/// `fmi3EnterEventMode`: in co-simulation an error, as `hasEventMode` is false.
pub unsafe fn enter_event_mode<M: ModelExchange>(instance: Instance) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::EnterEventMode, |instance| {
            if instance.interface() == Interface::CoSimulation {
                return Err(without("hasEventMode"));
            }
            instance.enter_event_mode()
        })
    }
}

/// What a function answers that needs a capability which the FMU does not have.
fn without(capability: &str) -> Error {
    Error::new(format!("not supported by this FMU ({capability} is false)"))
}

/// Defines functions that get or set arrays of types that C and Rust share.
macro_rules! accessors {
    ($($get:ident: $get_function:ident, $set:ident: $set_function:ident, $type:ty,
        $get_values:expr, $set_values:expr;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($get_function), "`.")]
        pub unsafe fn $get<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            values: *mut $type,
            value_count: usize,
        ) -> Status {
            let (references, values) = ((references, count), (values, value_count));
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe { get_values::<M, _, _>(instance, Function::$get_function, references, values, $get_values) }
        }

        #[doc = concat!("`fmi3", stringify!($set_function), "`.")]
        pub unsafe fn $set<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            values: *const $type,
            value_count: usize,
        ) -> Status {
            let (references, values) = ((references, count), (values, value_count));
            // SAFETY: the instance and the arrays are the importer's (see the module).
            unsafe { set_values::<M, _, _>(instance, Function::$set_function, references, values, $set_values) }
        }
    )*};
}

accessors! {
    get_float64: GetFloat64, set_float64: SetFloat64, f64,
        instance::Instance::get_real, instance::Instance::set_real;
    get_boolean: GetBoolean, set_boolean: SetBoolean, Boolean,
        instance::Instance::get_boolean, instance::Instance::set_boolean;
    get_int32: GetInt32, set_int32: SetInt32, i32,
        |instance, references, values| instance.get_integers(references, values, &[DataType::Integer]),
        |instance, references, values| instance.set_integers(references, values, &[DataType::Integer]);
    get_int64: GetInt64, set_int64: SetInt64, i64,
        |instance, references, values| instance.get_integers(references, values, &[DataType::Enumeration]),
        set_items;
}

/// Sets enumerations, which the functions for Int64 access.
fn set_items<M: Model>(
    instance: &mut instance::Instance<M>,
    references: &[ValueReference],
    values: &[i64],
) -> Answer {
    let item = |&value: &i64| {
        i32::try_from(value).map_err(|_| Error::new(format!("{value} is not an item of an enumeration")))
    };
    let items = values.iter().map(item).collect::<Result<Vec<_>, _>>()?;
    instance.set_integers(references, &items, &[DataType::Enumeration])
}

/// `fmi3GetFloat64` of an FMU that has Model Exchange, where event indicators are variables.
pub unsafe fn get_float64_with_indicators<M: ModelExchange>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> Status {
    let (function, references, values) = (Function::GetFloat64, (references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        get_values::<M, _, _>(instance, function, references, values, |instance, references, values| {
            instance.get_real_with_indicators(references, values)
        })
    }
}

/// Defines functions for types that no variable has.
macro_rules! absent {
    ($($get:ident: $get_function:ident, $set:ident: $set_function:ident, $type:ty;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($get_function), "`: no variable is of this type.")]
        pub unsafe fn $get<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            _values: *mut $type,
            _value_count: usize,
        ) -> Status {
            // SAFETY: the instance and the array are the importer's (see the module).
            unsafe { refuse_all::<M>(instance, Function::$get_function, (references, count)) }
        }

        #[doc = concat!("`fmi3", stringify!($set_function), "`: no variable is of this type.")]
        pub unsafe fn $set<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            _values: *const $type,
            _value_count: usize,
        ) -> Status {
            // SAFETY: the instance and the array are the importer's (see the module).
            unsafe { refuse_all::<M>(instance, Function::$set_function, (references, count)) }
        }
    )*};
}

absent! {
    get_float32: GetFloat32, set_float32: SetFloat32, f32;
    get_int8: GetInt8, set_int8: SetInt8, i8;
    get_uint8: GetUInt8, set_uint8: SetUInt8, u8;
    get_int16: GetInt16, set_int16: SetInt16, i16;
    get_uint16: GetUInt16, set_uint16: SetUInt16, u16;
    get_uint32: GetUInt32, set_uint32: SetUInt32, u32;
    get_uint64: GetUInt64, set_uint64: SetUInt64, u64;
}

/// Refuses every variable, as none is of the function's type.
///
/// # Safety
/// As for [`call`]; there are as many value references as counted.
unsafe fn refuse_all<M: Model>(
    instance: Instance,
    function: Function,
    (references, count): (*const ValueReference, usize),
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        call::<M>(instance, function, |_| {
            instance::Instance::<M>::refuse_all(&elements("valueReferences", references, count)?)
        })
    }
}

/// `fmi3GetBinary`: no variable is of this type.
pub unsafe fn get_binary<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    _sizes: *mut usize,
    _values: *mut Binary,
    _value_count: usize,
) -> Status {
    // SAFETY: the instance and the array are the importer's (see the module).
    unsafe { refuse_all::<M>(instance, Function::GetBinary, (references, count)) }
}

/// `fmi3SetBinary`: no variable is of this type.
pub unsafe fn set_binary<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    _sizes: *const usize,
    _values: *const Binary,
    _value_count: usize,
) -> Status {
    // SAFETY: the instance and the array are the importer's (see the module).
    unsafe { refuse_all::<M>(instance, Function::SetBinary, (references, count)) }
}

/// Defines functions of clocks, of which there are none.
macro_rules! clocks {
    ($($name:ident($($argument:ty),*): $function:ident;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`: no variable is a clock.")]
        pub unsafe fn $name<M: Model>(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            $(_: $argument),*
        ) -> Status {
            // SAFETY: the instance and the array are the importer's (see the module).
            unsafe { refuse_all::<M>(instance, Function::$function, (references, count)) }
        }
    )*};
}

clocks! {
    get_clock(*mut Clock): GetClock;
    set_clock(*const Clock): SetClock;
    get_interval_decimal(*mut f64, *mut Enumeration): GetIntervalDecimal;
    get_interval_fraction(*mut u64, *mut u64, *mut Enumeration): GetIntervalFraction;
    get_shift_decimal(*mut f64): GetShiftDecimal;
    get_shift_fraction(*mut u64, *mut u64): GetShiftFraction;
    set_interval_decimal(*const f64): SetIntervalDecimal;
    set_interval_fraction(*const u64, *const u64): SetIntervalFraction;
    set_shift_decimal(*const f64): SetShiftDecimal;
    set_shift_fraction(*const u64, *const u64): SetShiftFraction;
}

/// `fmi3GetString`. The strings stay valid until its next call for this instance.
pub unsafe fn get_string<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *mut *const c_char,
    value_count: usize,
) -> Status {
    let (references, values) = ((references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe { c_boundary::get_strings::<M>(instance, Function::GetString, references, values) }
}

/// `fmi3SetString`. The strings are copied.
pub unsafe fn set_string<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const *const c_char,
    value_count: usize,
) -> Status {
    let (references, values) = ((references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe { c_boundary::set_strings::<M, _>(instance, Function::SetString, references, values) }
}

/// `fmi3GetFMUState`: into a new state where `*state` is null, otherwise over the one that is there.
pub unsafe fn get_fmu_state<M: Model>(instance: Instance, state: *mut FmuState) -> Status {
    // SAFETY: the instance and the state are the importer's (see the module).
    unsafe { c_boundary::get_state::<M>(instance, Function::GetFMUState, state) }
}

/// `fmi3SetFMUState`.
pub unsafe fn set_fmu_state<M: Model>(instance: Instance, state: FmuState) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { c_boundary::set_state::<M>(instance, Function::SetFMUState, state) }
}

/// `fmi3FreeFMUState`: a null state is freed already.
pub unsafe fn free_fmu_state<M: Model>(instance: Instance, state: *mut FmuState) -> Status {
    // SAFETY: the instance and the state are the importer's (see the module).
    unsafe { c_boundary::free_state::<M>(instance, Function::FreeFMUState, state) }
}

/// `fmi3SerializedFMUStateSize`.
pub unsafe fn serialized_fmu_state_size<M: Model>(
    instance: Instance,
    state: FmuState,
    size: *mut usize,
) -> Status {
    // SAFETY: the instance and the size are the importer's (see the module).
    unsafe { c_boundary::serialized_size::<M>(instance, Function::SerializedFMUStateSize, state, size) }
}

/// `fmi3SerializeFMUState`: into as many bytes as `fmi3SerializedFMUStateSize` says.
pub unsafe fn serialize_fmu_state<M: Model>(
    instance: Instance,
    state: FmuState,
    serialized_state: *mut Byte,
    size: usize,
) -> Status {
    let bytes = (serialized_state, size);
    // SAFETY: the instance and the array are the importer's (see the module).
    unsafe { c_boundary::serialize::<M>(instance, Function::SerializeFMUState, state, bytes) }
}

/// `fmi3DeserializeFMUState`: always into a new state.
pub unsafe fn deserialize_fmu_state<M: Model>(
    instance: Instance,
    serialized_state: *const Byte,
    size: usize,
    state: *mut FmuState,
) -> Status {
    let bytes = (serialized_state, size);
    // SAFETY: the instance, the array and the state are the importer's (see the module).
    unsafe { c_boundary::deserialize::<M>(instance, Function::DeserializeFMUState, bytes, state) }
}

/// `fmi3GetDirectionalDerivative`.
pub unsafe fn get_directional_derivative<M: Model>(
    instance: Instance,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetDirectionalDerivative, |instance| {
            let unknowns = elements("unknowns", unknowns, unknown_count)?;
            let unknowns = Function::scalars::<M::Variables>(unknowns, sensitivity_count)?;
            let knowns = elements("knowns", knowns, known_count)?;
            let knowns = Function::scalars::<M::Variables>(knowns, seed_count)?;
            let seed = elements("seed", seed, seed_count)?;
            write_elements("sensitivity", sensitivity, sensitivity_count, |sensitivity| {
                instance.get_directional_derivative(&unknowns, &knowns, &seed, sensitivity)
            })
        })
    }
}

/// `fmi3GetOutputDerivatives`.
pub unsafe fn get_output_derivatives<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    orders: *const i32,
    values: *mut f64,
    value_count: usize,
) -> Status {
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::GetOutputDerivatives, |instance| {
            let references = elements("valueReferences", references, count)?;
            let orders = elements("orders", orders, count)?;
            let mut spread = Vec::with_capacity(value_count);
            let mut spread_orders = Vec::with_capacity(value_count);
            for (&reference, &order) in references.iter().zip(orders.iter()) {
                let elements = Function::elements::<M::Variables>(reference)?;
                spread_orders.resize(spread_orders.len() + elements.len(), order);
                spread.extend_from_slice(&elements);
            }
            Function::check_values(spread.len(), value_count)?;
            write_elements("values", values, value_count, |values| {
                instance.get_real_output_derivatives(&spread, &spread_orders, values)
            })
        })
    }
}

/// `fmi3DoStep`. Where the model asks for the end, the step ends there.
pub unsafe fn do_step<M: Model>(
    instance: Instance,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    event_handling_needed: *mut Boolean,
    terminate_simulation: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut f64,
) -> Status {
    // SAFETY: the instance and the results are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::DoStep, |instance| {
            let event_handling_needed = not_null("eventHandlingNeeded", event_handling_needed)?;
            let terminate_simulation = not_null("terminateSimulation", terminate_simulation)?;
            let early_return = not_null("earlyReturn", early_return)?;
            let last_successful_time = not_null("lastSuccessfulTime", last_successful_time)?;
            let write = |instance: &instance::Instance<M>, ends: bool| {
                let time = instance.last_successful_time();
                let is_early = ends && time < current_communication_point + communication_step_size;
                event_handling_needed.write_unaligned(FALSE);
                terminate_simulation.write_unaligned(Boolean::from(ends));
                early_return.write_unaligned(Boolean::from(is_early && instance.early_return_allowed));
                last_successful_time.write_unaligned(time);
            };
            // After an error, too.
            write(instance, false);
            let status = instance.do_step(current_communication_point, communication_step_size)?;
            let ends = instance.asks_for_end();
            write(instance, ends);
            Ok(if ends { Status::Ok } else { status })
        })
    }
}

/// `fmi3UpdateDiscreteStates`.
pub unsafe fn update_discrete_states<M: ModelExchange>(
    instance: Instance,
    discrete_states_need_update: *mut Boolean,
    terminate_simulation: *mut Boolean,
    nominals_of_continuous_states_changed: *mut Boolean,
    values_of_continuous_states_changed: *mut Boolean,
    next_event_time_defined: *mut Boolean,
    next_event_time: *mut f64,
) -> Status {
    // SAFETY: the instance and the results are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::UpdateDiscreteStates, |instance| {
            let again = not_null("discreteStatesNeedUpdate", discrete_states_need_update)?;
            let terminate = not_null("terminateSimulation", terminate_simulation)?;
            let nominals =
                not_null("nominalsOfContinuousStatesChanged", nominals_of_continuous_states_changed)?;
            let values = not_null("valuesOfContinuousStatesChanged", values_of_continuous_states_changed)?;
            let is_defined = not_null("nextEventTimeDefined", next_event_time_defined)?;
            let next = not_null("nextEventTime", next_event_time)?;
            let (status, found) = instance.new_discrete_states()?;
            again.write_unaligned(Boolean::from(found.again));
            terminate.write_unaligned(Boolean::from(found.terminate));
            nominals.write_unaligned(FALSE);
            values.write_unaligned(Boolean::from(found.states_changed));
            is_defined.write_unaligned(Boolean::from(found.next.is_some()));
            next.write_unaligned(found.next.unwrap_or_default());
            Ok(status)
        })
    }
}

/// `fmi3CompletedIntegratorStep`: of no consequence, as `needsCompletedIntegratorStep` says.
pub unsafe fn completed_integrator_step<M: ModelExchange>(
    instance: Instance,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate_simulation: *mut Boolean,
) -> Status {
    // SAFETY: the instance and the results are the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::CompletedIntegratorStep, |_| {
            let enter_event_mode = not_null("enterEventMode", enter_event_mode)?;
            let terminate_simulation = not_null("terminateSimulation", terminate_simulation)?;
            enter_event_mode.write_unaligned(FALSE);
            terminate_simulation.write_unaligned(FALSE);
            Ok(Status::Ok)
        })
    }
}

/// `fmi3SetTime`.
pub unsafe fn set_time<M: ModelExchange>(instance: Instance, time: f64) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { call::<M>(instance, Function::SetTime, |instance| instance.set_time(time)) }
}

/// `fmi3SetContinuousStates`.
pub unsafe fn set_continuous_states<M: ModelExchange>(
    instance: Instance,
    states: *const f64,
    count: usize,
) -> Status {
    let (function, states) = (Function::SetContinuousStates, (states, count));
    // SAFETY: the instance and the array are the importer's (see the module).
    unsafe {
        c_boundary::set_continuous_states::<M>(
            instance,
            function,
            ["continuousStates", "nContinuousStates"],
            states,
        )
    }
}

/// Defines functions that get an array for all states or event indicators.
macro_rules! arrays {
    ($($name:ident: $function:ident, $get:ident, $arguments:expr, $elements:ident;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`.")]
        pub unsafe fn $name<M: ModelExchange>(instance: Instance, values: *mut f64, count: usize) -> Status {
            let (function, of) = (Function::$function, ($arguments, M::Variables::$elements));
            // SAFETY: the instance and the array are the importer's (see the module).
            unsafe { c_boundary::get_array::<M>(instance, function, of, (values, count), instance::Instance::$get) }
        }
    )*};
}

arrays! {
    get_continuous_state_derivatives: GetContinuousStateDerivatives, get_derivatives, ["derivatives", "nContinuousStates"], STATE_NAMES;
    get_event_indicators: GetEventIndicators, get_event_indicators, ["eventIndicators", "nEventIndicators"], EVENT_INDICATORS;
    get_continuous_states: GetContinuousStates, get_continuous_states, ["continuousStates", "nContinuousStates"], STATE_NAMES;
    get_nominals_of_continuous_states: GetNominalsOfContinuousStates, get_nominals_of_continuous_states,
        ["nominals", "nContinuousStates"], STATE_NAMES;
}

/// Defines functions that get the number of states or event indicators.
macro_rules! counts {
    ($($name:ident: $function:ident, $argument:literal, $elements:ident;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`.")]
        pub unsafe fn $name<M: Model>(instance: Instance, count: *mut usize) -> Status {
            // SAFETY: the instance and the result are the importer's (see the module).
            unsafe {
                call::<M>(instance, Function::$function, |_| {
                    not_null($argument, count)?.write_unaligned(M::Variables::$elements.len());
                    Ok(Status::Ok)
                })
            }
        }
    )*};
}

counts! {
    get_number_of_event_indicators: GetNumberOfEventIndicators, "nEventIndicators", EVENT_INDICATORS;
    get_number_of_continuous_states: GetNumberOfContinuousStates, "nContinuousStates", STATE_NAMES;
}

/// Defines functions of capabilities that an FMU does not have.
macro_rules! not_supported {
    ($($name:ident($($argument:ty),*): $function:ident, $capability:literal;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`: an error, as `", $capability, "` is false.")]
        pub unsafe fn $name<M: Model>(instance: Instance, $(_: $argument),*) -> Status {
            // SAFETY: the instance is the importer's (see the module).
            unsafe { call::<M>(instance, Function::$function, |_| Err(without($capability))) }
        }
    )*};
}

not_supported! {
    get_number_of_variable_dependencies(ValueReference, *mut usize):
        GetNumberOfVariableDependencies, "providesPerElementDependencies";
    get_variable_dependencies(
        ValueReference, *mut usize, *mut ValueReference, *mut usize, *mut Enumeration, usize):
        GetVariableDependencies, "providesPerElementDependencies";
    get_adjoint_derivative(
        *const ValueReference, usize, *const ValueReference, usize, *const f64, usize, *mut f64, usize):
        GetAdjointDerivative, "providesAdjointDerivatives";
    evaluate_discrete_states(): EvaluateDiscreteStates, "providesEvaluateDiscreteStates";
    enter_step_mode(): EnterStepMode, "hasEventMode";
    enter_event_mode_of_co_simulation(): EnterEventMode, "hasEventMode";
}

/// Defines functions of which the FMU has nothing that they are for.
macro_rules! of_nothing {
    ($($name:ident($($argument:ty),*): $function:ident, $reason:literal;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`: an error: ", $reason, ".")]
        pub unsafe fn $name<M: Model>(instance: Instance, $(_: $argument),*) -> Status {
            // SAFETY: the instance is the importer's (see the module).
            unsafe { call::<M>(instance, Function::$function, |_| Err(Error::new($reason))) }
        }
    )*};
}

of_nothing! {
    enter_configuration_mode(): EnterConfigurationMode, "this FMU has no structural parameters";
    exit_configuration_mode(): ExitConfigurationMode, "this FMU has no structural parameters";
    activate_model_partition(ValueReference, f64): ActivateModelPartition, "this FMU has no model partitions";
}

/// The functions of Model Exchange of an FMU that does not offer it; the calling sequence refuses them.
pub mod without_model_exchange {
    use super::{Boolean, Error, Function, Instance, Model, Status, call};

    of_nothing! {
        update_discrete_states(
            *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64):
            UpdateDiscreteStates, "this FMU does not offer Model Exchange";
        enter_continuous_time_mode(): EnterContinuousTimeMode, "this FMU does not offer Model Exchange";
        completed_integrator_step(Boolean, *mut Boolean, *mut Boolean):
            CompletedIntegratorStep, "this FMU does not offer Model Exchange";
        set_time(f64): SetTime, "this FMU does not offer Model Exchange";
        set_continuous_states(*const f64, usize):
            SetContinuousStates, "this FMU does not offer Model Exchange";
        get_continuous_state_derivatives(*mut f64, usize):
            GetContinuousStateDerivatives, "this FMU does not offer Model Exchange";
        get_event_indicators(*mut f64, usize): GetEventIndicators, "this FMU does not offer Model Exchange";
        get_continuous_states(*mut f64, usize): GetContinuousStates, "this FMU does not offer Model Exchange";
        get_nominals_of_continuous_states(*mut f64, usize):
            GetNominalsOfContinuousStates, "this FMU does not offer Model Exchange";
    }
}

/// Makes the 75 C functions of FMI 3.0 for a [`Model`] that offers Co-Simulation, in a library of the crate type `cdylib`.
#[macro_export]
macro_rules! fmi3_co_simulation {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model; exit_initialization_mode; get_float64; enter_event_mode_of_co_simulation; without_model_exchange::
        }
    };
}

/// Makes the 75 C functions of FMI 3.0 for a model that implements [`ModelExchange`].
///
/// [`ModelExchange`]: crate::ModelExchange
#[macro_export]
macro_rules! fmi3_model_exchange {
    ($model:ty) => {
        $crate::fmi3_functions! {
            $model; exit_initialization_mode_with_events; get_float64_with_indicators; enter_event_mode;
        }
    };
}

/// Makes the C functions of FMI 3.0.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi3_functions {
    ($model:ty; $exit_initialization_mode:ident; $get_float64:ident; $enter_event_mode:ident;
        $($model_exchange:ident::)?) => {
        const _: () = {
            use $crate::fmi3::c_types::{
                Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FmuState, Instance,
                InstanceEnvironment, IntermediateUpdateCallback, LogMessageCallback, PreemptionCallback, Status,
                String, ValueReference,
            };

            #[unsafe(no_mangle)]
            extern "C" fn fmi3GetVersion() -> String {
                $crate::fmi3::c_api::VERSION.as_ptr()
            }

            #[unsafe(no_mangle)]
            unsafe extern "C" fn fmi3FreeInstance(instance: Instance) {
                // SAFETY: the argument is the importer's, unchanged.
                unsafe { $crate::fmi3::c_api::free_instance::<$model>(instance) }
            }

            $crate::fmi3_functions! { @instantiate $model;
                fmi3InstantiateCoSimulation = instantiate_co_simulation(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    event_mode_used: Boolean, early_return_allowed: Boolean,
                    required_intermediate_variables: *const ValueReference, count: usize,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>,
                    intermediate_update: ::core::option::Option<IntermediateUpdateCallback>);
                fmi3InstantiateModelExchange = instantiate_model_exchange(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>);
                fmi3InstantiateScheduledExecution = instantiate_scheduled_execution(
                    name: String, token: String, resource_path: String, visible: Boolean, logging_on: Boolean,
                    environment: InstanceEnvironment, log_message: ::core::option::Option<LogMessageCallback>,
                    clock_update: ::core::option::Option<ClockUpdateCallback>,
                    lock_preemption: ::core::option::Option<PreemptionCallback>,
                    unlock_preemption: ::core::option::Option<PreemptionCallback>);
            }

            $crate::fmi3_functions! { @functions $model;
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
                fmi3GetClock = get_clock(vr: *const ValueReference, count: usize, values: *mut Clock);
                fmi3SetClock = set_clock(vr: *const ValueReference, count: usize, values: *const Clock);
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
                fmi3GetIntervalDecimal = get_interval_decimal(
                    vr: *const ValueReference, count: usize, intervals: *mut f64, qualifiers: *mut Enumeration);
                fmi3GetIntervalFraction = get_interval_fraction(
                    vr: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64,
                    qualifiers: *mut Enumeration);
                fmi3GetShiftDecimal = get_shift_decimal(
                    vr: *const ValueReference, count: usize, shifts: *mut f64);
                fmi3GetShiftFraction = get_shift_fraction(
                    vr: *const ValueReference, count: usize, counters: *mut u64, resolutions: *mut u64);
                fmi3SetIntervalDecimal = set_interval_decimal(
                    vr: *const ValueReference, count: usize, intervals: *const f64);
                fmi3SetIntervalFraction = set_interval_fraction(
                    vr: *const ValueReference, count: usize, counters: *const u64, resolutions: *const u64);
                fmi3SetShiftDecimal = set_shift_decimal(
                    vr: *const ValueReference, count: usize, shifts: *const f64);
                fmi3SetShiftFraction = set_shift_fraction(
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
                fmi3EnterStepMode = enter_step_mode();
                fmi3GetOutputDerivatives = get_output_derivatives(
                    vr: *const ValueReference, count: usize, orders: *const i32, values: *mut f64, n: usize);
                fmi3DoStep = do_step(
                    time: f64, size: f64, no_set_fmu_state_prior: Boolean, event_handling_needed: *mut Boolean,
                    terminate: *mut Boolean, early_return: *mut Boolean, last_successful_time: *mut f64);
                fmi3ActivateModelPartition = activate_model_partition(clock: ValueReference, time: f64);
            }
            $crate::fmi3_functions! { @accessors $model;
                fmi3GetFloat32 = get_float32, fmi3SetFloat32 = set_float32, f32;
                fmi3GetFloat64 = $get_float64, fmi3SetFloat64 = set_float64, f64;
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
        };
    };
    (@functions $model:ty; $($symbol:ident =
        $($function:ident)::+($($argument:ident: $type:ty),* $(,)?);)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $symbol(instance: Instance, $($argument: $type),*) -> Status {
            // SAFETY: the arguments are the importer's, unchanged.
            unsafe { $crate::fmi3::c_api::$($function)::+::<$model>(instance, $($argument),*) }
        }
    )*};
    (@accessors $model:ty; $($get:ident = $get_function:ident, $set:ident = $set_function:ident, $type:ty;)*) => {
        $crate::fmi3_functions! { @functions $model; $(
            $get = $get_function(vr: *const ValueReference, count: usize, values: *mut $type, n: usize);
            $set = $set_function(vr: *const ValueReference, count: usize, values: *const $type, n: usize);
        )* }
    };
    (@instantiate $model:ty; $($symbol:ident = $function:ident($($argument:ident: $type:ty),* $(,)?);)*) => {$(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $symbol($($argument: $type),*) -> Instance {
            $crate::fmi3::c_api::silence_panics();
            // SAFETY: the arguments are the importer's, unchanged.
            unsafe { $crate::fmi3::c_api::$function::<$model>($($argument),*) }
        }
    )*};
}
