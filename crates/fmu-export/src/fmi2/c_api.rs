//! The functions of FMI 2.0, generic over the model. [`fmi2_co_simulation!`] and its siblings export them.
//!
//! [`fmi2_co_simulation!`]: crate::fmi2_co_simulation

#![allow(clippy::missing_safety_doc, clippy::too_many_arguments)]
#![allow(non_snake_case, reason = "the standard's names")]

use core::ffi::{CStr, c_void};
use core::ptr;
use std::ffi::CString;

use fmu_abi::fmi2::c_types::{
    Boolean, Byte, CO_SIMULATION, CallbackFunctions, CallbackLogger, Component, Enumeration, EventInfo,
    FALSE, FmuState, Integer, MODEL_EXCHANGE, Status, String, ValueReference, status_kind,
};
use fmu_abi::fmi2::calling_sequence;
use fmu_solve::Error;
use fmu_terms::InstanceType;

use crate::c_boundary::arguments::{c_string, elements, not_null, write_elements};
use crate::c_boundary::{self, c_functions, get_values, held, set_values, states};
use crate::instance::logger::{Logger, Recipient};
use crate::instance::{Answer, Instance};
use crate::kinds::Model;
use crate::model::context::Experiment;
use crate::model::resources::Resources;
use crate::model::variables::Described as _;

/// `fmi2GetTypesPlatform`.
#[must_use]
pub fn fmi2GetTypesPlatform<M: Model>() -> String {
    c"default".as_ptr()
}

/// `fmi2GetVersion`.
#[must_use]
pub fn fmi2GetVersion<M: Model>() -> String {
    c"2.0".as_ptr()
}

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
        unsafe { crate::host::log(self.environment, status, category.as_ptr(), text.as_ptr()) }
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
pub unsafe fn fmi2Instantiate<M: Model>(
    instance_name: String,
    fmu_type: Enumeration,
    guid: String,
    resource_location: String,
    functions: *const CallbackFunctions,
    _visible: Boolean,
    logging_on: Boolean,
) -> Component {
    c_boundary::silence_panics();
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
    let logger = Logger::new(recipient, description, logging_on != FALSE);
    let check = || -> Result<InstanceType, Error> {
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
            CO_SIMULATION if interfaces.co_simulation() => Ok(InstanceType::CoSimulation),
            MODEL_EXCHANGE if interfaces.model_exchange() => Ok(InstanceType::ModelExchange),
            CO_SIMULATION => Err(Error::new("this FMU is for Model Exchange, not for Co-Simulation")),
            MODEL_EXCHANGE => Err(Error::new("this FMU is for Co-Simulation, not for Model Exchange")),
            other => Err(Error::new(format!("the argument fmuType is {other}, which is not an fmi2Type"))),
        }
    };
    c_boundary::instantiate::<M>("fmi2Instantiate", logger, check(), |instance| {
        if const { M::Variables::RESOURCES.is_some() } {
            // SAFETY: the importer passes null or a string.
            let location = unsafe { c_string("fmuResourceLocation", resource_location) };
            instance.resources = Resources::at(location.ok().map(CStr::to_bytes));
        }
    })
}

/// `fmi2FreeInstance`; frees the remaining states, too.
pub unsafe fn fmi2FreeInstance<M: Model>(component: Component) {
    // SAFETY: the component is the importer's (see the module).
    unsafe { c_boundary::free::<M>(component) }
}

c_functions! {
    fmi2ExitInitializationMode(), Instance::exit_initialization_mode;
    fmi2SetDebugLogging(on: Boolean, count: usize, categories: *const String),
        |instance| c_boundary::set_debug_logging(instance, on != FALSE, (categories, count));
    fmi2SetupExperiment(
        tolerance_defined: Boolean, tolerance: f64, start_time: f64, stop_time_defined: Boolean,
        stop_time: f64,
    ), |instance| {
        instance.setup_experiment(Experiment {
            start_time,
            stop_time: (stop_time_defined != FALSE).then_some(stop_time),
            tolerance: (tolerance_defined != FALSE).then_some(tolerance),
        })
    };
    fmi2EnterInitializationMode(), Instance::enter_initialization_mode;
    fmi2Terminate(), Instance::terminate;
    fmi2Reset(), Instance::reset;

    /// Creates a saved state if `*state` is null, otherwise overwrites that one.
    fmi2GetFMUstate(state: *mut FmuState),
        |instance| states::get_state(instance, state);
    fmi2SetFMUstate(state: FmuState), |instance| states::set_state(instance, state);
    /// Null is a no-op.
    fmi2FreeFMUstate(state: *mut FmuState), |_| states::free_state::<M>(state);
    fmi2SerializedFMUstateSize(state: FmuState, size: *mut usize),
        |_| states::serialized_size::<M>(state, size);
    /// Writes as many bytes as `fmi2SerializedFMUstateSize` reports.
    fmi2SerializeFMUstate(state: FmuState, bytes: *mut Byte, size: usize),
        |_| states::serialize::<M>(state, (bytes.cast(), size));
    /// Always into a new state.
    fmi2DeSerializeFMUstate(bytes: *const Byte, size: usize, state: *mut FmuState),
        |instance| states::deserialize(instance, (bytes.cast(), size), state);

    fmi2GetDirectionalDerivative(
        unknowns: *const ValueReference, unknown_count: usize, knowns: *const ValueReference,
        known_count: usize, seeds: *const f64, sensitivities: *mut f64,
    ), |instance| {
        let unknowns = elements("vUnknown_ref", unknowns, unknown_count)?;
        let knowns = elements("vKnown_ref", knowns, known_count)?;
        let seeds = elements("dvKnown", seeds, known_count)?;
        write_elements("dvUnknown", sensitivities, unknown_count, |sensitivities| {
            instance.get_directional_derivative(&unknowns, &knowns, &seeds, sensitivities)
        })
    };
    fmi2GetRealOutputDerivatives(
        references: *const ValueReference, count: usize, orders: *const Integer, values: *mut f64,
    ), |instance| {
        let references = elements("vr", references, count)?;
        let orders = elements("order", orders, count)?;
        write_elements("value", values, count, |values| {
            instance.get_real_output_derivatives(&references, orders.iter().copied(), values)
        })
    };
    fmi2SetRealInputDerivatives(
        references: *const ValueReference, count: usize, orders: *const Integer, values: *const f64,
    ), |instance| {
        instance.set_real_input_derivatives(
            &elements("vr", references, count)?,
            &elements("order", orders, count)?,
            &elements("value", values, count)?,
        )
    };

    fmi2DoStep(start: f64, size: f64, _no_set_fmu_state_prior: Boolean),
        |instance| instance.do_step(start, size);
    /// Steps are never pending.
    fmi2GetStatus(_kind: Enumeration, value: *mut Enumeration), |instance| status(instance, value, None);
    /// The end of the last completed step.
    fmi2GetRealStatus(kind: Enumeration, value: *mut f64), |instance| {
        let time = (kind == status_kind::LAST_SUCCESSFUL_TIME).then(|| instance.last_successful_time());
        status(instance, value, time)
    };
    /// No status is an Integer.
    fmi2GetIntegerStatus(_kind: Enumeration, value: *mut Integer),
        |instance| status(instance, value, None);
    /// Whether the model requests the end of the simulation.
    fmi2GetBooleanStatus(kind: Enumeration, value: *mut Boolean), |instance| {
        let ends = (kind == status_kind::TERMINATED).then(|| Boolean::from(instance.asks_for_end()));
        status(instance, value, ends)
    };
    /// Steps are never pending.
    fmi2GetStringStatus(_kind: Enumeration, value: *mut String),
        |instance| status(instance, value, None);

    fmi2EnterEventMode() if EVENTS, Instance::enter_event_mode;
    fmi2NewDiscreteStates(info: *mut EventInfo) if EVENTS, |instance| {
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
    };
    fmi2EnterContinuousTimeMode() if EVENTS, Instance::enter_continuous_time_mode;
    /// Does nothing: the description has `completedIntegratorStepNotNeeded`.
    fmi2CompletedIntegratorStep(
        _no_set_fmu_state_prior: Boolean, event_mode: *mut Boolean, terminate: *mut Boolean,
    ) if EVENTS, |_| c_boundary::completed_integrator_step(event_mode, terminate);
    fmi2SetTime(time: f64) if EVENTS, |instance| instance.set_time(time);
    fmi2SetContinuousStates(states: *const f64, count: usize) if EVENTS,
        |instance| c_boundary::set_continuous_states(instance, ["x", "nx"], (states, count));
}

/// Defines functions that get an array of all states or event indicators.
macro_rules! arrays {
    ($($name:ident: $get:ident, $arguments:expr, $elements:ident;)*) => {
        c_functions! { $(
            $name(values: *mut f64, count: usize) if EVENTS, |instance| {
                let expected = M::Variables::$elements.len();
                c_boundary::get_array($arguments, expected, (values, count), |values| instance.$get(values))
            };
        )* }
    };
}

arrays! {
    fmi2GetDerivatives: get_derivatives, ["derivatives", "nx"], STATE_NOMINALS;
    fmi2GetEventIndicators: get_event_indicators, ["eventIndicators", "ni"], EVENT_INDICATORS;
    fmi2GetContinuousStates: get_continuous_states, ["x", "nx"], STATE_NOMINALS;
    fmi2GetNominalsOfContinuousStates: get_nominals_of_continuous_states, ["x_nominal", "nx"], STATE_NOMINALS;
}

c_functions! {
    /// An error.
    fmi2CancelStep(), |_| Err(Error::new("not supported by this FMU (canRunAsynchronuously is false)"));
}

/// Returns the status of a step. Status information of asynchronous steps is discarded, as section 2.1.3 requires of
/// unavailable information.
///
/// # Safety
/// `value` is null or may be written to.
unsafe fn status<M: Model, T>(instance: &Instance<M>, value: *mut T, known: Option<T>) -> Answer {
    let value = not_null("value", value)?;
    let Some(known) = known else {
        instance.log_discarded(format_args!("a step has no such status"));
        return Ok(Status::Discard);
    };
    // SAFETY: the caller's promise.
    unsafe { value.write_unaligned(known) };
    Ok(Status::Ok)
}

/// Defines functions that get or set values.
macro_rules! accessors {
    ($($name:ident, $access:ident($values:ty), $body:expr;)*) => {$(
        #[doc = concat!("`", stringify!($name), "`.")]
        pub unsafe fn $name<M: Model>(
            component: Component,
            references: *const ValueReference,
            count: usize,
            values: $values,
        ) -> Status {
            let (references, values) = ((references, count), (values, count));
            // SAFETY: the component and the arrays are the importer's (see the module).
            unsafe { $access::<M, _>(component, &calling_sequence::$name, references, values, $body) }
        }
    )*};
}

accessors! {
    fmi2GetReal, get_values(*mut f64), Instance::get_real;
    fmi2SetReal, set_values(*const f64), Instance::set_real;
    fmi2GetInteger, get_values(*mut Integer), Instance::get_integers;
    fmi2SetInteger, set_values(*const Integer), Instance::set_integers;
    fmi2GetBoolean, get_values(*mut Boolean), Instance::get_boolean;
    fmi2SetBoolean, set_values(*const Boolean), Instance::set_boolean;
    fmi2GetString, get_values(*mut String), c_boundary::get_strings;
    fmi2SetString, set_values(*const String), |instance, references, values| {
        c_boundary::set_strings(instance, calling_sequence::CONVENTIONS.values, references, values)
    };
}

crate::fmi2_calls!(held);
