//! An FMU instance: the functions of the standard, without C.
//!
//! A forbidden call, or a call with a wrong argument, is an error and changes nothing, unless the version of the
//! standard then ends the simulation. A failed step or a panic leaves the instance in the state `error` until a reset
//! or a restored state. A failed initialization can be repeated.

pub(crate) mod activation;
pub(crate) mod clocks;
pub(crate) mod dependencies;
mod derivatives;
pub(crate) mod event_mode;
mod exchange;
pub(crate) mod logger;
pub(crate) mod memory;
mod saving;
mod serialized_state;
mod setting;
mod steps;
mod values;

use core::ffi::{CStr, c_void};
use std::ffi::CString;

use fmu_abi::Status;
use fmu_abi::calling_sequence::{Function, Phase};
use fmu_abi::floating_point::in_default_environment;
use fmu_solve::display::{Seconds, Shown};
use fmu_solve::{Error, Tape};
use fmu_terms::InstanceType;

use crate::instance::logger::{Delivery, Logger};
use crate::kinds::Model;
use crate::model::context::{Context, Experiment, Timed};
use crate::model::description::{Causality, ModelDescription, ValueReference};
use crate::model::resources::Resources;
use crate::model::variables::{Described as _, Variables};
use crate::panics::{contain, with_cause};

use memory::Memory;

/// Outcome of a call: an error, or `fmi2OK`, `fmi2Warning` or `fmi2Discard`.
pub(crate) type Answer = Result<Status, Error>;

/// The importer's lock callbacks, between which no other function of the instance is called.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Preemption {
    pub(crate) lock: Option<unsafe extern "C" fn()>,
    pub(crate) unlock: Option<unsafe extern "C" fn()>,
}

/// `fmi3ClockUpdateCallback` and its argument.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClockUpdate {
    pub(crate) function: unsafe extern "C" fn(*mut c_void),
    pub(crate) environment: *mut c_void,
}

/// The importer's side of intermediate updates.
#[derive(Clone, Debug)]
pub(crate) struct IntermediateUpdate {
    pub(crate) callback: IntermediateCallback,
    /// The variables that the importer gets and sets in intermediate updates.
    pub(crate) registered: Box<[ValueReference]>,
}

/// `fmi3IntermediateUpdateCallback` and its first argument.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IntermediateCallback {
    pub(crate) function: unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64),
    pub(crate) environment: *mut c_void,
}

/// What an FMU may offer: code for what it does not is left out of its library.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offer {
    pub(crate) is_made: bool,
    /// Why a function is refused if the FMU does not offer it.
    pub(crate) refusal: &'static str,
}

/// An instance of a model.
pub(crate) struct Instance<M: Model> {
    pub(crate) logger: Logger,
    memory: Memory<M>,
    pub(crate) resources: Resources,
    /// The strings returned last, valid until strings are next returned.
    pub(crate) strings: Vec<CString>,
    /// The value references of array elements in the last call that got or set arrays. The memory is reused, so that
    /// only the first calls allocate.
    scalars: Vec<ValueReference>,
    /// The tape for adjoint derivatives.
    tape: Tape,
    /// Whether a step may end early.
    pub(crate) early_return_allowed: bool,
    /// The importer's locks against preemption, in Scheduled Execution.
    pub(crate) preemption: Preemption,
    /// The importer's side of intermediate updates.
    pub(crate) intermediate_update: Option<IntermediateUpdate>,
    /// Whom to notify of clocks, in Scheduled Execution.
    pub(crate) clock_update: Option<ClockUpdate>,
    /// The number of model partitions in Clock Update Mode.
    clock_updates: u32,
    /// Whether the importer has saved a state, so it may try values and roll back.
    may_roll_back: bool,
    /// The inputs whose exceeded bounds were logged; kept on rollback.
    logged_inputs: Vec<ValueReference>,
}

impl<M: Model> Instance<M> {
    /// An instance without logging and resources.
    pub(crate) fn new(instance_type: InstanceType) -> Self {
        Self {
            logger: Logger::default(),
            memory: Memory::new(instance_type),
            resources: Resources::none(),
            strings: Vec::new(),
            scalars: Vec::new(),
            tape: Tape::new(),
            early_return_allowed: false,
            preemption: Preemption::default(),
            intermediate_update: None,
            clock_update: None,
            clock_updates: 0,
            may_roll_back: false,
            logged_inputs: Vec::new(),
        }
    }

    const DESCRIPTION: &'static ModelDescription = M::Variables::DESCRIPTION;

    /// Event Mode of Co-Simulation in FMI 3.0, and so intermediate updates.
    pub(crate) const EVENT_MODE: Offer = Offer {
        is_made: Self::DESCRIPTION.capabilities.event_mode && Self::DESCRIPTION.interfaces.co_simulation(),
        refusal: "not supported by this FMU (hasEventMode is false)",
    };
    /// Events that the importer handles: in Model Exchange, and in Event Mode of Co-Simulation.
    pub(crate) const EVENTS: Offer = Offer {
        is_made: Self::DESCRIPTION.interfaces.model_exchange() || Self::EVENT_MODE.is_made,
        refusal: "this FMU does not offer Model Exchange",
    };
    /// Scheduled Execution.
    pub(crate) const SCHEDULED_EXECUTION: Offer = Offer {
        is_made: Self::DESCRIPTION.interfaces.scheduled_execution(),
        refusal: "this FMU does not offer Scheduled Execution",
    };

    /// Runs a function's body if the calling sequence allows it; catches panics and logs errors. It is inlined into each
    /// library function, and what happens rarely is not.
    #[inline]
    pub(crate) fn call(&mut self, function: &Function, body: impl FnOnce(&mut Self) -> Answer) -> Status {
        let Memory { phase, instance_type, .. } = self.memory;
        let is_of_interface = function.interface.is_none_or(|only| instance_type.interface() == only);
        if !(function.phases.contains(phase) && (phase.interface().is_some() || is_of_interface)) {
            return self.refuse(function, is_of_interface);
        }
        match contain(|| body(self)) {
            Ok(Ok(status)) => status,
            failure => self.report_failure(failure, function),
        }
    }

    /// Logs why a function must not be called.
    #[cold]
    #[inline(never)]
    fn refuse(&mut self, function: &Function, is_of_interface: bool) -> Status {
        let Memory { phase, instance_type, .. } = self.memory;
        let error = Error::new(if is_of_interface {
            format!("must not be called in the state {phase}")
        } else {
            format!("this instance is for {instance_type}, which does not have this function")
        });
        self.report(&error, function)
    }

    /// Logs why a function's body failed: an error, or a panic, after which the instance needs a reset.
    #[cold]
    #[inline(never)]
    fn report_failure(&mut self, failure: Result<Answer, Error>, function: &Function) -> Status {
        let error = match failure {
            Ok(Ok(status)) => return status,
            Ok(Err(error)) => with_cause(error, ""),
            Err(panic) => {
                let Memory { phase, model, variables, inputs, .. } = &mut self.memory;
                *phase = Phase::Error;
                // What it was computing is none of the values that can still be read.
                let _ = contain(|| model.leave_step(variables, inputs));
                Error::new(format!("{panic}; reset the instance"))
            }
        };
        self.report(&error, function)
    }

    /// Logs an error, and enters the state after an error, if the version has one.
    fn report(&mut self, error: &Error, function: &Function) -> Status {
        self.logger.error(format_args!("{error}"));
        if let Some(phase) = function.version.after_error {
            self.memory.phase = phase;
        }
        if self.memory.phase == Phase::Error {
            self.memory.rewind();
        }
        Status::Error
    }

    /// What the instance is for.
    pub(crate) fn instance_type(&self) -> InstanceType {
        self.memory.instance_type
    }

    /// The finished function's messages.
    pub(crate) fn take_messages(&self) -> Option<Delivery> {
        self.logger.take()
    }

    /// Continues as after a panic.
    #[cfg(target_family = "wasm")]
    pub(crate) fn fail(&mut self) {
        self.memory.phase = Phase::Error;
    }

    pub(crate) fn set_debug_logging(&mut self, on: bool, categories: &[&CStr]) -> Answer {
        self.logger
            .set_debug_logging(on, categories)
            .map(|()| Status::Ok)
            .map_err(|name| Error::new(format!("no log category is called {name:?}")))
    }

    pub(crate) fn setup_experiment(&mut self, experiment: Experiment) -> Answer {
        let Experiment { start_time, stop_time, tolerance } = experiment;
        if !start_time.is_finite() {
            return Err(Error::new(format!("startTime is {}", Shown(start_time))));
        }
        if let Some(stop_time) = stop_time
            && (stop_time.is_nan() || stop_time < start_time)
        {
            return Err(Error::new(format!(
                "stopTime is {}, startTime {}",
                Shown(stop_time),
                Shown(start_time)
            )));
        }
        if let Some(tolerance) = tolerance
            && !tolerance.is_finite()
        {
            return Err(Error::new(format!("tolerance is {}", Shown(tolerance))));
        }
        // Some masters pass 0 if the user gives none.
        let (tolerance, not_positive) = match tolerance {
            Some(tolerance) if tolerance <= 0.0 => (None, Some(tolerance)),
            tolerance => (tolerance, None),
        };
        self.memory.experiment = Experiment { tolerance, ..experiment }.of::<M::Variables>();
        self.memory.is_set_up = true;
        self.memory.time = start_time;
        Ok(not_positive.map_or(Status::Ok, |tolerance| {
            self.logger.warning(format_args!(
                "tolerance is {}, which is not above 0; it is ignored",
                Shown(tolerance)
            ))
        }))
    }

    pub(crate) fn enter_initialization_mode(&mut self) -> Answer {
        if !self.memory.is_set_up {
            return Err(Error::new("fmi2SetupExperiment was not called before"));
        }
        self.memory.phase = Phase::InitializationMode;
        self.memory.stale = true;
        Ok(Status::Ok)
    }

    fn leave_initialization_mode(&mut self) -> Answer {
        M::check_parameters(&self.memory.variables)?;
        let status = self.compute_values()?;
        self.memory.parameters_changed = false;
        self.memory.phase = match self.memory.instance_type {
            InstanceType::CoSimulation => Phase::StepComplete,
            InstanceType::CoSimulationWithEvents => Phase::StepEventMode,
            InstanceType::ModelExchange => Phase::EventMode,
            InstanceType::ScheduledExecution => Phase::ClockActivationMode,
        };
        Ok(status)
    }

    /// FMI 3.0.2, section 2.3.2.
    pub(crate) fn enter_configuration_mode(&mut self) -> Answer {
        let variables = Self::DESCRIPTION.variables;
        if !variables.iter().any(|variable| variable.causality == Causality::StructuralParameter) {
            return Err(Error::new("this FMU has no structural parameters"));
        }
        self.memory.phase = Phase::ConfigurationMode;
        Ok(Status::Ok)
    }

    #[expect(clippy::unnecessary_wraps, reason = "returns what every callable function does")]
    pub(crate) fn exit_configuration_mode(&mut self) -> Answer {
        self.memory.phase = Phase::Instantiated;
        Ok(Status::Ok)
    }

    pub(crate) fn terminate(&mut self) -> Answer {
        let mut status = Status::Ok;
        if !M::Variables::CLOCKS.is_empty()
            && matches!(self.memory.phase, Phase::EventMode | Phase::StepEventMode)
        {
            // Ticking clocks compute before the end.
            status = self.compute_values()?;
            self.memory.end_ticks();
        }
        self.memory.phase = Phase::Terminated;
        Ok(status)
    }

    #[expect(clippy::unnecessary_wraps, reason = "returns what every callable function does")]
    pub(crate) fn reset(&mut self) -> Answer {
        self.memory = Memory::new(self.memory.instance_type);
        self.may_roll_back = false;
        self.logged_inputs.clear();
        self.logger.begin_again();
        Ok(Status::Ok)
    }

    /// Recomputes the values if anything was set.
    fn compute_values(&mut self) -> Answer {
        if self.memory.stale {
            in_default_environment(|| self.compute_stale_values())
        } else {
            Ok(Status::Ok)
        }
    }

    fn compute_stale_values(&mut self) -> Answer {
        let memory = &mut self.memory;
        let mut status = Status::Ok;
        match memory.phase {
            Phase::InitializationMode => {
                let (logger, recent_messages) = (&self.logger, &mut memory.recent_messages);
                // A warning is given once; otherwise the status is fmi2OK.
                let mut log = Timed::new(memory.experiment.start_time, |category, message| {
                    if recent_messages.is_new(&message.to_string()) {
                        status = status.max(logger.message(category, message));
                    }
                });
                let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
                memory.model.initialize(&mut memory.variables, &mut context)?;
                memory.end = context.end()?;
                check_finite(&memory.variables, memory.time)?;
            }
            Phase::StepComplete
            | Phase::EventMode
            | Phase::ContinuousTimeMode
            | Phase::Terminated
            | Phase::StepEventMode
            | Phase::ClockActivationMode
            | Phase::IntermediateUpdateMode => {
                if memory.parameters_changed {
                    memory.take_parameters();
                }
                memory.model.refresh(memory.time, &mut memory.variables);
                if !M::Variables::CLOCKS.is_empty()
                    && matches!(memory.phase, Phase::EventMode | Phase::StepEventMode)
                {
                    status = self.compute_ticks()?;
                }
            }
            Phase::Instantiated | Phase::ConfigurationMode | Phase::StepFailed | Phase::Error => {}
        }
        self.memory.stale = false;
        Ok(status)
    }

    /// Logs why a call is discarded.
    pub(crate) fn log_discarded(&self, message: core::fmt::Arguments<'_>) {
        self.logger.event(Status::Discard, message);
    }
}

/// Rejects non-finite values.
#[inline]
fn check_finite<V: Variables>(variables: &V, time: f64) -> Result<(), Error> {
    variables.first_non_finite().map_or(Ok(()), |reference| Err(not_finite(variables, reference, time)))
}

#[cold]
fn not_finite<V: Variables>(variables: &V, reference: ValueReference, time: f64) -> Error {
    let name = V::description(reference).map(|variable| variable.name().to_string()).unwrap_or_default();
    let value = Shown(variables.real(reference));
    Error::new(format!("the variable {name} became {value} at {} s", Seconds(time)))
}
