//! The functions that instantiate.

use core::ffi::CStr;

use fmu_abi::fmi3::c_types::{
    Boolean, ClockUpdateCallback, FALSE, Instance, InstanceEnvironment, IntermediateUpdateCallback,
    LogMessageCallback, Status, String, ValueReference,
};
use fmu_solve::Error;
use fmu_terms::InstanceType;

use crate::c_boundary::arguments::{c_string, elements};
use crate::c_boundary::{self, silence_panics};
#[cfg(target_family = "wasm")]
use crate::host;
use crate::instance::event_mode::{has_intermediate_update, name_of};
use crate::instance::logger::{Logger, Recipient};
use crate::instance::{self, ClockUpdate, IntermediateCallback, IntermediateUpdate, Preemption};
use crate::kinds::Model;
use crate::model::resources::Resources;
use crate::model::variables::Described as _;

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

/// Arguments that only some interfaces have.
#[derive(Clone, Debug, Default)]
pub(super) struct Options {
    pub(super) early_return_allowed: bool,
    pub(super) intermediate_update: Option<IntermediateUpdate>,
    pub(super) preemption: Preemption,
    pub(super) clock_update: Option<ClockUpdateCallback>,
}

/// Instantiates for an interface: null and a message if an argument is wrong, or with `refusal` as the reason.
///
/// # Safety
/// The strings are null or end in NUL.
pub(super) unsafe fn instantiate<M: Model>(
    function: &str,
    instance_type: Result<InstanceType, Error>,
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
    let logger = Logger::new(recipient, description, logging_on != FALSE);
    let check = || -> Result<InstanceType, Error> {
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
        let instance_type = instance_type?;
        if description.interfaces.include(instance_type.interface()) {
            Ok(instance_type)
        } else {
            Err(Error::new(format!("this FMU does not offer {instance_type}")))
        }
    };
    c_boundary::instantiate::<M>(function, logger, check(), |instance| {
        instance.early_return_allowed = options.early_return_allowed;
        instance.preemption = options.preemption;
        instance.clock_update = options.clock_update.map(|function| ClockUpdate { function, environment });
        instance.intermediate_update = options.intermediate_update;
        if const { M::Variables::RESOURCES.is_some() } {
            // SAFETY: the caller's promise.
            let path = unsafe { c_string("resourcePath", resource_path) };
            instance.resources = Resources::at_path(path.ok().map(CStr::to_bytes));
        }
    })
}

/// `fmi3InstantiateCoSimulation`: null and a message if an argument is wrong.
#[must_use]
pub unsafe fn fmi3InstantiateCoSimulation<M: Model>(
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
    silence_panics();
    let event_mode_used = event_mode_used != FALSE;
    let has_event_mode = M::Variables::DESCRIPTION.capabilities.event_mode;
    let has_clocks = M::Variables::DESCRIPTION.interfaces.co_simulation() && !M::Variables::CLOCKS.is_empty();
    // SAFETY: the array is the importer's (see the module).
    let registered = unsafe {
        elements(
            "requiredIntermediateVariables",
            required_intermediate_variables,
            required_intermediate_variable_count,
        )
    }
    .and_then(|references| registered::<M>(&references));
    let (instance_type, registered) = match registered {
        Err(error) => (Err(error), Box::default()),
        Ok(_) if event_mode_used && !has_event_mode => {
            let error = "eventModeUsed is true, but this FMU has no Event Mode (hasEventMode is false)";
            (Err(Error::new(error)), Box::default())
        }
        Ok(_) if !event_mode_used && has_clocks => {
            let error = "eventModeUsed is false, but this FMU has clocks, which tick in Event Mode";
            (Err(Error::new(error)), Box::default())
        }
        Ok(registered) if event_mode_used => (Ok(InstanceType::CoSimulationWithEvents), registered),
        Ok(registered) => (Ok(InstanceType::CoSimulation), registered),
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
            instance_type,
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
            let description = M::Variables::DESCRIPTION;
            // A model with clocks computes in Event Mode only.
            let has_updates = description.capabilities.event_mode && M::Variables::CLOCKS.is_empty();
            has_updates && has_intermediate_update(variable)
        });
        if variable.is_none() {
            let name = name_of::<M>(reference);
            return Err(Error::new(format!(
                "requiredIntermediateVariables: the variable {name} with the value reference {reference} is not \
                 available in Intermediate Update Mode (intermediateUpdate is false)"
            )));
        }
        scalars.extend(instance::Instance::<M>::elements(reference)?);
    }
    Ok(scalars.into())
}

/// `fmi3InstantiateModelExchange`: null and a message if an argument is wrong.
#[must_use]
pub unsafe fn fmi3InstantiateModelExchange<M: Model>(
    instance_name: String,
    instantiation_token: String,
    resource_path: String,
    _visible: Boolean,
    logging_on: Boolean,
    environment: InstanceEnvironment,
    log_message: Option<LogMessageCallback>,
) -> Instance {
    silence_panics();
    let strings = [instance_name, instantiation_token, resource_path];
    // SAFETY: the strings are the importer's (see the module).
    unsafe {
        instantiate::<M>(
            "fmi3InstantiateModelExchange",
            Ok(InstanceType::ModelExchange),
            strings,
            logging_on,
            Options::default(),
            environment,
            log_message,
        )
    }
}
