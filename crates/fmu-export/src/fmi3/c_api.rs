//! The functions of FMI 3.0, generic over the model. [`fmi3_co_simulation!`] and its siblings define their symbols in the
//! exported library: all 75, whatever the FMU offers.
//!
//! [`fmi3_co_simulation!`]: crate::fmi3_co_simulation

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]

use core::ffi::{CStr, c_char};

use super::c_types::{
    Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FALSE, FmuState, Instance,
    InstanceEnvironment, IntermediateUpdateCallback, LogMessageCallback, PreemptionCallback, Status, String,
    TRUE, ValueReference,
};
use super::calling_sequence::Function;
use crate::c_boundary::{
    self, Exported, c_string, call, elements, get_values, not_null, set_values, write_elements,
};
use crate::calling_sequence::{Function as _, Interface};
use crate::context::Experiment;
use crate::description::DataType;
use crate::error::Error;
use crate::event_mode::EventMode;
use crate::instance::event_mode::has_intermediate_update;
use crate::instance::{self, ClockUpdate, IntermediateCallback, IntermediateUpdate, Preemption};
use crate::logger::{Logger, Recipient};
use crate::model::Model;
use crate::model_exchange::ModelExchange;
use crate::resources::Resources;
use crate::variables::Variables;
#[cfg(target_family = "wasm")]
use crate::wasm::host;

pub use crate::c_boundary::silence_panics;

pub mod clocks;
pub mod scheduled_execution;

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

/// What only instances of some interfaces receive.
#[derive(Clone, Debug, Default)]
struct Options {
    early_return_allowed: bool,
    intermediate_update: Option<IntermediateUpdate>,
    preemption: Preemption,
    clock_update: Option<ClockUpdateCallback>,
}

/// Instantiates for an interface: null and a message if an argument is wrong, or with `refusal` as the reason.
///
/// # Safety
/// The strings are null or end in NUL.
unsafe fn instantiate<M: Model>(
    function: &str,
    interface: Result<Interface, Error>,
    [instance_name, token, resource_path]: [String; 3],
    logging_on: Boolean,
    options: Options,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
) -> Instance {
    let description = M::Variables::DESCRIPTION;
    #[cfg(target_family = "wasm")]
    let log_message = log_message.map(|_| host::log as LogMessageCallback);
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
            Interface::CoSimulation | Interface::CoSimulationWithEvents => {
                description.interfaces.co_simulation
            }
            Interface::ModelExchange => description.interfaces.model_exchange,
            Interface::ScheduledExecution => description.interfaces.scheduled_execution,
        };
        if is_offered {
            Ok(interface)
        } else {
            Err(Error::new(format!("this FMU does not offer {interface}")))
        }
    };
    c_boundary::instantiate::<M>(function, logger, check(), |instance| {
        instance.early_return_allowed = options.early_return_allowed;
        instance.preemption = options.preemption;
        instance.clock_update = options.clock_update.map(|function| ClockUpdate { function, environment });
        instance.intermediate_update = options.intermediate_update;
        if description.has_resources {
            // SAFETY: the caller's promise.
            let path = unsafe { c_string("resourcePath", resource_path) };
            instance.resources = Resources::at_path(path.ok().map(CStr::to_bytes));
        }
    })
}

/// `fmi3InstantiateCoSimulation`: null and a message if an argument is wrong.
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
    intermediate_update: Option<IntermediateUpdateCallback>,
) -> Instance {
    let event_mode_used = event_mode_used != FALSE;
    let has_event_mode = M::Variables::DESCRIPTION.capabilities.event_mode;
    let has_clocks = M::Variables::DESCRIPTION.interfaces.co_simulation && !M::Variables::CLOCKS.is_empty();
    // SAFETY: the array is the importer's (see the module).
    let registered = unsafe {
        elements(
            "requiredIntermediateVariables",
            required_intermediate_variables,
            required_intermediate_variable_count,
        )
    }
    .and_then(|references| registered::<M>(&references));
    let (interface, registered) = match registered {
        Err(error) => (Err(error), Box::default()),
        Ok(_) if event_mode_used && !has_event_mode => {
            let error = "eventModeUsed is true, but this FMU has no Event Mode (hasEventMode is false)";
            (Err(Error::new(error)), Box::default())
        }
        Ok(_) if !event_mode_used && has_clocks => {
            let error = "eventModeUsed is false, but this FMU has clocks, which tick in Event Mode";
            (Err(Error::new(error)), Box::default())
        }
        Ok(registered) if event_mode_used => (Ok(Interface::CoSimulationWithEvents), registered),
        Ok(registered) => (Ok(Interface::CoSimulation), registered),
    };
    #[cfg(target_family = "wasm")]
    let intermediate_update =
        intermediate_update.map(|_| host::intermediate_update as IntermediateUpdateCallback);
    let intermediate_update = intermediate_update.filter(|_| has_event_mode).map(|function| {
        IntermediateUpdate { callback: IntermediateCallback { function, environment }, registered }
    });
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateCoSimulation",
            interface,
            strings,
            logging_on,
            Options {
                early_return_allowed: early_return_allowed != FALSE,
                intermediate_update,
                ..Options::default()
            },
            environment,
            log_message,
        )
    }
}

/// The scalars of the variables that an importer registers for intermediate updates.
fn registered<M: Model>(references: &[ValueReference]) -> Result<Box<[ValueReference]>, Error> {
    let mut scalars = Vec::with_capacity(references.len());
    for &reference in references {
        let variable = M::Variables::description(reference).filter(|variable| {
            M::Variables::DESCRIPTION.capabilities.event_mode && has_intermediate_update(variable)
        });
        if variable.is_none() {
            let name = M::Variables::description(reference).map_or("unknown", |variable| variable.name);
            return Err(Error::new(format!(
                "requiredIntermediateVariables: the variable {name} with the value reference {reference} is not \
                 available in Intermediate Update Mode (intermediateUpdate is false)"
            )));
        }
        scalars.extend_from_slice(&Function::elements::<M::Variables>(reference)?);
    }
    Ok(scalars.into())
}

/// `fmi3InstantiateModelExchange`: null and a message if an argument is wrong.
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
            Options::default(),
            environment,
            log_message,
        )
    }
}

/// `fmi3FreeInstance`; frees the remaining states, too.
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
    Model: enter_configuration_mode: EnterConfigurationMode;
    Model: exit_configuration_mode: ExitConfigurationMode;
    Model: terminate: Terminate;
    Model: reset: Reset;
    EventMode: enter_step_mode: EnterStepMode;
}

/// `fmi3EnterEventMode`: an error in co-simulation without Event Mode.
pub unsafe fn enter_event_mode<M: ModelExchange>(instance: Instance) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe {
        call::<M>(instance, Function::EnterEventMode, |instance| {
            if instance.interface() == Interface::CoSimulation {
                return Err(Error::new("Event Mode is not used (hasEventMode or eventModeUsed is false)"));
            }
            instance.enter_event_mode()
        })
    }
}

/// The error of a function whose capability the FMU lacks.
fn without(capability: &str) -> Error {
    Error::new(format!("not supported by this FMU ({capability} is false)"))
}

/// Defines functions that get or set arrays of types shared by C and Rust.
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
    get_float32: GetFloat32, set_float32: SetFloat32, f32,
        instance::Instance::get_float32, instance::Instance::set_float32;
}

/// Defines functions for integer types, from the data types that each accesses.
macro_rules! wholes {
    ($($get:ident: $get_function:ident, $set:ident: $set_function:ident, $type:ty, [$($data_type:ident),*];)*) => {
        accessors! { $(
            $get: $get_function, $set: $set_function, $type,
                |instance, references, values| instance.get_wholes(references, values, &[$(DataType::$data_type),*]),
                |instance, references, values| instance.set_wholes(references, values, &[$(DataType::$data_type),*]);
        )* }
    };
}

wholes! {
    get_int8: GetInt8, set_int8: SetInt8, i8, [Int8];
    get_uint8: GetUInt8, set_uint8: SetUInt8, u8, [UInt8];
    get_int16: GetInt16, set_int16: SetInt16, i16, [Int16];
    get_uint16: GetUInt16, set_uint16: SetUInt16, u16, [UInt16];
    get_uint32: GetUInt32, set_uint32: SetUInt32, u32, [UInt32];
    get_int64: GetInt64, set_int64: SetInt64, i64, [Int64, Enumeration];
    get_uint64: GetUInt64, set_uint64: SetUInt64, u64, [UInt64];
}

/// `fmi3GetFloat64` of an FMU with Model Exchange, where event indicators are variables.
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

/// `fmi3GetFloat64` of an FMU with Event Mode, and so intermediate updates.
pub unsafe fn get_float64_with_updates<M: EventMode>(
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
            instance.check_registered(references)?;
            instance.get_real_with_indicators(references, values)
        })
    }
}

/// `fmi3SetFloat64` likewise.
pub unsafe fn set_float64_with_updates<M: EventMode>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> Status {
    let (function, references, values) = (Function::SetFloat64, (references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        set_values::<M, _, _>(instance, function, references, values, |instance, references, values| {
            instance.check_registered(references)?;
            instance.set_real(references, values)
        })
    }
}

/// `fmi3GetBinary`. The values stay valid until the next call for this instance.
pub unsafe fn get_binary<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    sizes: *mut usize,
    values: *mut Binary,
    value_count: usize,
) -> Status {
    let (references, values) = ((references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        get_values::<M, _, _>(
            instance,
            Function::GetBinary,
            references,
            values,
            |instance, references, values| {
                write_elements("valueSizes", sizes, value_count, |sizes| {
                    instance.get_binary(references, sizes, values)
                })
            },
        )
    }
}

/// `fmi3SetBinary`. The values are copied.
pub unsafe fn set_binary<M: Model>(
    instance: Instance,
    references: *const ValueReference,
    count: usize,
    sizes: *const usize,
    values: *const Binary,
    value_count: usize,
) -> Status {
    let (references, values) = ((references, count), (values, value_count));
    // SAFETY: the instance and the arrays are the importer's (see the module).
    unsafe {
        set_values::<M, _, _>(
            instance,
            Function::SetBinary,
            references,
            values,
            |instance, references, values| {
                let sizes = elements("valueSizes", sizes, value_count)?;
                let values =
                    values.iter().zip(sizes.iter()).map(|(&value, &size)| elements("values", value, size));
                let values = values.collect::<Result<Vec<_>, _>>()?;
                instance.set_binary(references, &values.iter().map(AsRef::as_ref).collect::<Vec<_>>())
            },
        )
    }
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

/// `fmi3GetFMUState`: into a new state if `*state` is null, otherwise over the existing one.
pub unsafe fn get_fmu_state<M: Model>(instance: Instance, state: *mut FmuState) -> Status {
    // SAFETY: the instance and the state are the importer's (see the module).
    unsafe { c_boundary::get_state::<M>(instance, Function::GetFMUState, state) }
}

/// `fmi3SetFMUState`.
pub unsafe fn set_fmu_state<M: Model>(instance: Instance, state: FmuState) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { c_boundary::set_state::<M>(instance, Function::SetFMUState, state) }
}

/// `fmi3FreeFMUState`: null is a no-op.
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

/// `fmi3SerializeFMUState`: into as many bytes as `fmi3SerializedFMUStateSize` reports.
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

/// Defines functions of derivatives of unknowns with respect to knowns: the seed has as many values as one of them,
/// the sensitivity as the other.
macro_rules! derivatives {
    ($($name:ident: $function:ident, $seeds_unknowns:literal;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`.")]
        pub unsafe fn $name<M: Model>(
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
                call::<M>(instance, Function::$function, |instance| {
                    let [of_unknowns, of_knowns] = if $seeds_unknowns {
                        [seed_count, sensitivity_count]
                    } else {
                        [sensitivity_count, seed_count]
                    };
                    let unknowns = elements("unknowns", unknowns, unknown_count)?;
                    let unknowns = Function::scalars::<M::Variables>(unknowns, of_unknowns)?;
                    let knowns = elements("knowns", knowns, known_count)?;
                    let knowns = Function::scalars::<M::Variables>(knowns, of_knowns)?;
                    let seed = elements("seed", seed, seed_count)?;
                    write_elements("sensitivity", sensitivity, sensitivity_count, |sensitivity| {
                        instance.$name(&unknowns, &knowns, &seed, sensitivity)
                    })
                })
            }
        }
    )*};
}

derivatives! {
    get_directional_derivative: GetDirectionalDerivative, false;
    get_adjoint_derivative: GetAdjointDerivative, true;
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
            // Not as many as the importer says, which may be any number.
            let (mut spread, mut spread_orders) = (vec![], vec![]);
            for (&reference, &order) in references.iter().zip(orders.iter()) {
                let elements = Function::elements::<M::Variables>(reference)?;
                spread_orders.resize(spread_orders.len() + elements.len(), order);
                spread.extend_from_slice(&elements);
            }
            Function::check_values(spread.len(), value_count)?;
            instance.check_registered(&spread)?;
            write_elements("values", values, value_count, |values| {
                instance.get_real_output_derivatives(&spread, &spread_orders, values)
            })
        })
    }
}

/// `fmi3DoStep`. If the model requests the end, the step ends there.
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
    let step = (current_communication_point, communication_step_size);
    let flags = [event_handling_needed, terminate_simulation, early_return];
    // SAFETY: the instance and the results are the importer's (see the module).
    unsafe {
        step_by::<M>(instance, step, flags, last_successful_time, |instance, start, size| {
            instance.do_step(start, size).map(|status| (status, false))
        })
    }
}

/// `fmi3DoStep` of an FMU with Event Mode: the step may also end at an event, and at the end of each internal step but
/// the last the importer exchanges values and may request early return.
pub unsafe fn do_step_to_event<M: EventMode>(
    instance: Instance,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    event_handling_needed: *mut Boolean,
    terminate_simulation: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut f64,
) -> Status {
    let flags = [event_handling_needed, terminate_simulation, early_return];
    let (mut start, mut end) =
        (current_communication_point, current_communication_point + communication_step_size);
    let (mut size, asked_end) = (communication_step_size, end);
    let mut status = Status::Ok;
    loop {
        let do_step = instance::Instance::do_step_to_event;
        // SAFETY: the instance and the results are the importer's (see the module).
        status = status
            .max(unsafe { step_by::<M>(instance, (start, size), flags, last_successful_time, do_step) });
        // SAFETY: as above; the reference ends before the importer is called.
        let interrupted = unsafe { Exported::<M>::instance_of(instance) }
            .and_then(|instance| Some((instance.interruption()?, instance.early_return_allowed)));
        let Some(((time, callback), can_return_early)) = interrupted else {
            if end < asked_end && status <= Status::Warning {
                // SAFETY: the step checked the results.
                unsafe { early_return.write_unaligned(TRUE) };
            }
            return status;
        };
        let (mut is_asked, mut return_time) = (FALSE, end);
        // SAFETY: the importer passed the callback for this purpose (section 4.2.2); the results outlive the call. No
        // reference to an instance exists during the call.
        unsafe {
            (callback.function)(
                callback.environment,
                time,
                TRUE,
                TRUE,
                TRUE,
                Boolean::from(can_return_early),
                &raw mut is_asked,
                &raw mut return_time,
            );
        }
        // SAFETY: as above.
        if !unsafe { Exported::<M>::instance_of(instance) }.is_some_and(instance::Instance::resume) {
            return Status::Error;
        }
        if is_asked != FALSE && can_return_early {
            if return_time < end {
                end = return_time;
            }
            if end <= time {
                // SAFETY: the step checked the results.
                unsafe { early_return.write_unaligned(TRUE) };
                return status;
            }
        }
        (start, size) = (time, end - time);
    }
}

/// A communication step by a function that also returns whether the importer has an event to handle.
///
/// # Safety
/// As for [`call`]; the results are null or may be written to.
unsafe fn step_by<M: Model>(
    instance: Instance,
    (start, size): (f64, f64),
    [event_handling_needed, terminate_simulation, early_return]: [*mut Boolean; 3],
    last_successful_time: *mut f64,
    do_step: impl FnOnce(&mut instance::Instance<M>, f64, f64) -> Result<(Status, bool), Error>,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        call::<M>(instance, Function::DoStep, |instance| {
            let event_handling_needed = not_null("eventHandlingNeeded", event_handling_needed)?;
            let terminate_simulation = not_null("terminateSimulation", terminate_simulation)?;
            let early_return = not_null("earlyReturn", early_return)?;
            let last_successful_time = not_null("lastSuccessfulTime", last_successful_time)?;
            let write = |instance: &instance::Instance<M>, has_event: bool, ends: bool| {
                let time = instance.last_successful_time();
                let is_early = (has_event || ends) && time < start + size;
                event_handling_needed.write_unaligned(Boolean::from(has_event));
                terminate_simulation.write_unaligned(Boolean::from(ends));
                early_return.write_unaligned(Boolean::from(is_early && instance.early_return_allowed));
                last_successful_time.write_unaligned(time);
            };
            // After an error, too.
            write(instance, false, false);
            let (status, has_event) = do_step(instance, start, size)?;
            let ends = instance.asks_for_end();
            write(instance, has_event, ends);
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

/// `fmi3CompletedIntegratorStep`: does nothing, as `needsCompletedIntegratorStep` says.
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

/// Defines functions that get an array of all states or event indicators.
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

/// Defines functions of capabilities that an FMU lacks.
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
    refuse_step_mode(): EnterStepMode, "hasEventMode";
    enter_event_mode_of_co_simulation(): EnterEventMode, "hasEventMode";
}

/// `fmi3EvaluateDiscreteStates`: ignored, as section 2.3.5 says where `providesEvaluateDiscreteStates` is false. Ticks
/// are computed when values are requested.
pub unsafe fn evaluate_discrete_states<M: Model>(instance: Instance) -> Status {
    // SAFETY: the instance is the importer's (see the module).
    unsafe { call::<M>(instance, Function::EvaluateDiscreteStates, |_| Ok(Status::Ok)) }
}

/// Defines functions that apply to nothing in the FMU.
macro_rules! of_nothing {
    ($($name:ident($($argument:ty),*): $function:ident, $reason:literal;)*) => {$(
        #[doc = concat!("`fmi3", stringify!($function), "`: an error: ", $reason, ".")]
        pub unsafe fn $name<M: Model>(instance: Instance, $(_: $argument),*) -> Status {
            // SAFETY: the instance is the importer's (see the module).
            unsafe { call::<M>(instance, Function::$function, |_| Err(Error::new($reason))) }
        }
    )*};
}

/// The Model Exchange functions of an FMU without it; the calling sequence rejects them.
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

/// The Scheduled Execution functions of an FMU without it.
pub mod without_scheduled_execution {
    use super::{
        Boolean, ClockUpdateCallback, Error, Function, Instance, InstanceEnvironment, LogMessageCallback,
        Model, Options, PreemptionCallback, Status, String, ValueReference, call, instantiate,
    };

    /// `fmi3InstantiateScheduledExecution`: null and a message.
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
                Options::default(),
                environment,
                log_message,
            )
        }
    }

    of_nothing! {
        activate_model_partition(ValueReference, f64): ActivateModelPartition, "this FMU does not offer Scheduled Execution";
    }

    /// Calls a function: nothing preempts it.
    pub unsafe fn locked<M: Model, T>(_instance: Instance, function: impl FnOnce() -> T) -> T {
        function()
    }
}
