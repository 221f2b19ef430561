//! An FMU instance: the functions of the standard, without C.
//!
//! A forbidden call, or one with a wrong argument, is an error and changes nothing, unless the version of the standard
//! ends the simulation there. A failed step or a panic leaves the instance in the state `error` until a reset or a
//! restored state. A failed initialization can be repeated.

pub(crate) mod activation;
pub(crate) mod clocks;
mod derivatives;
pub(crate) mod event_mode;
mod exchange;
pub(crate) mod memory;
mod values;

use core::ffi::{CStr, c_void};
use std::ffi::CString;

use crate::calling_sequence::{Function, Interface, Phase};
use crate::context::{Context, Experiment};
use crate::description::{Causality, ModelDescription, ValueReference};
use crate::error::{Error, Shown, check_memory};
use crate::events::Events;
use crate::floating_point::in_default_environment;
use crate::logger::{Delivery, Logger};
use crate::model::{InputsOf, Model, Step, time_rounding};
use crate::panics::contain;
use crate::resources::Resources;
use crate::serialized_state;
use crate::status::Status;
use crate::tape::Tape;
use crate::variables::Variables;

use memory::Memory;

/// The tolerance of the importer's time relative to the step. Importers compute communication points as `i * h`, as a
/// sum, or from integer nanoseconds.
const TIME_TOLERANCE: f64 = 1e-6;

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
    /// The variables that the importer gets and sets in it.
    pub(crate) registered: Box<[ValueReference]>,
}

/// `fmi3IntermediateUpdateCallback` and its first argument.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IntermediateCallback {
    pub(crate) function: unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64),
    pub(crate) environment: *mut c_void,
}

/// An instance of a model.
pub(crate) struct Instance<M: Model> {
    pub(crate) logger: Logger,
    memory: Memory<M>,
    pub(crate) resources: Resources,
    /// The strings returned last, valid until the next time.
    pub(crate) strings: Vec<CString>,
    /// The value references of array elements, of the last call with arrays: so that only the first calls allocate.
    scalars: Vec<ValueReference>,
    /// For adjoint derivatives.
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
    logged_inputs: Vec<&'static str>,
}

impl<M: Model> Instance<M> {
    /// An instance without logging and resources.
    pub(crate) fn new(interface: Interface) -> Self {
        Self {
            logger: Logger::default(),
            memory: Memory::new(interface),
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

    /// Runs a function's body if the calling sequence allows it; catches panics and logs errors.
    pub(crate) fn call<F: Function>(
        &mut self,
        function: F,
        body: impl FnOnce(&mut Self) -> Answer,
    ) -> Status {
        let phase = self.memory.phase;
        let is_of_interface = function.interface().is_none_or(|only| self.memory.interface.has(only));
        let error = if function.phases().contains(phase) && (phase.interface().is_some() || is_of_interface) {
            match contain(|| body(self)) {
                Ok(Ok(status)) => return status,
                Ok(Err(error)) => error,
                Err(panic) => {
                    self.memory.phase = Phase::Error;
                    Error::new(format!("{panic}; reset the instance"))
                }
            }
        } else {
            self.refusal(is_of_interface)
        };
        self.report(&error, F::AFTER_ERROR)
    }

    // What follows is separate, as `call` is inlined into each library function.

    /// Why a function must not be called.
    #[cold]
    #[inline(never)]
    fn refusal(&self, is_of_interface: bool) -> Error {
        let Memory { phase, interface, .. } = self.memory;
        Error::new(if is_of_interface {
            format!("must not be called in the state {phase}")
        } else {
            format!("this instance is for {interface}, which does not have this function")
        })
    }

    /// Logs an error, and enters the state that follows, if any.
    #[cold]
    #[inline(never)]
    fn report(&mut self, error: &Error, after: Option<Phase>) -> Status {
        self.logger.error(format_args!("{error}"));
        if let Some(phase) = after {
            self.memory.phase = phase;
        }
        if self.memory.phase == Phase::Error {
            self.memory.rewind();
        }
        Status::Error
    }

    /// The interface that the instance is for.
    pub(crate) fn interface(&self) -> Interface {
        self.memory.interface
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
        self.memory.experiment = Experiment { tolerance, ..experiment };
        self.memory.is_set_up = true;
        self.memory.time = start_time;
        Ok(not_positive.map_or(Status::Ok, |tolerance| {
            self.warn(format_args!("tolerance is {}, which is not above 0; it is ignored", Shown(tolerance)))
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

    pub(crate) fn exit_initialization_mode(&mut self) -> Answer {
        M::check_parameters(&self.memory.variables)?;
        let status = self.compute_values()?;
        self.memory.parameters_changed = false;
        self.memory.phase = match self.memory.interface {
            Interface::CoSimulation => Phase::StepComplete,
            Interface::CoSimulationWithEvents => Phase::StepEventMode,
            Interface::ModelExchange => Phase::EventMode,
            Interface::ScheduledExecution => Phase::ClockActivationMode,
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
        self.memory = Memory::new(self.memory.interface);
        self.may_roll_back = false;
        self.logged_inputs.clear();
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
        memory.inputs.update();
        let mut status = Status::Ok;
        match memory.phase {
            Phase::InitializationMode => {
                let (logger, recent_messages) = (&self.logger, &mut memory.recent_messages);
                // A warning is given once; otherwise the status is fmi2OK.
                let mut log = |category, message: core::fmt::Arguments<'_>| {
                    if recent_messages.is_new(&message.to_string()) {
                        status = status.max(logger.message(category, message));
                    }
                };
                let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
                memory.model.initialize(&mut memory.variables, memory.inputs.initial(), &mut context)?;
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
                    memory.model.take_parameters(&memory.variables);
                }
                memory.model.refresh(memory.time, &mut memory.variables, memory.inputs.latest());
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

    /// Advances by one communication step.
    pub(crate) fn do_step(&mut self, start: f64, size: f64) -> Answer {
        self.advance(start, size, |model, variables, step, _, context| {
            model.step(variables, step, context).map(|()| None)
        })
    }

    /// Advances by one communication step with `step`, or to an event in it, whose time (s) `step` returns.
    fn advance(
        &mut self,
        start: f64,
        size: f64,
        step: impl FnOnce(
            &mut M,
            &mut M::Variables,
            &Step<'_, InputsOf<M>>,
            &mut Events,
            &mut Context<'_>,
        ) -> Result<Option<f64>, Error>,
    ) -> Answer {
        let end = start + size;
        if !self.can_step(start, size, end) {
            return Err(self.step_error(start, size, end));
        }
        let memory = &mut self.memory;
        if memory.end.is_some() {
            return Ok(self.discard_for_end());
        }
        memory.inputs.update();
        if memory.accept_parameters()? {
            memory.model.refresh(memory.time, &mut memory.variables, memory.inputs.initial());
        }
        let mut status = Status::Ok;
        let logger = &self.logger;
        let mut log = |category, message: core::fmt::Arguments<'_>| {
            status = status.max(logger.message(category, message));
        };
        let of_inputs = Step { start, size, inputs: &memory.inputs };
        // If an error or a panic interrupts the step, the instance stays in this state.
        memory.phase = Phase::Error;
        let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
        let event =
            step(&mut memory.model, &mut memory.variables, &of_inputs, &mut memory.events, &mut context)?;
        let asked = context.end()?;
        check_finite(&memory.variables, event.unwrap_or(end))?;
        memory.stale = false;
        if let Some(asked) = asked {
            return Ok(self.end_step_early(asked, end));
        }
        memory.phase = Phase::StepComplete;
        memory.time = event.unwrap_or(end);
        memory.inputs.end_step(event.map_or(size, |event| event - start));
        Ok(status)
    }

    /// The model requests the end at a time (s) within the step.
    #[cold]
    fn end_step_early(&mut self, asked: f64, end: f64) -> Status {
        // It may be off by rounding.
        self.memory.time = asked.max(self.memory.time).min(end);
        self.memory.end = Some(asked);
        self.discard_for_end()
    }

    /// The model requests the end: the step is not completed (section 4.2.1).
    #[cold]
    fn discard_for_end(&mut self) -> Status {
        self.memory.phase = Phase::StepFailed;
        self.log_discarded(format_args!(
            "the model requests the end of the simulation at {} s",
            Shown(self.memory.time)
        ));
        Status::Discard
    }

    /// Whether the model has requested the end.
    pub(crate) fn asks_for_end(&self) -> bool {
        self.memory.end.is_some()
    }

    /// Whether the next step may have this start, size and end (s). False for NaN.
    fn can_step(&self, start: f64, size: f64, end: f64) -> bool {
        size > 0.0
            && size <= M::LONGEST_STEP
            && self.goes_on(start, size)
            && end > start
            // A step far shorter than the largest times cannot exceed them.
            && (M::LONGEST_STEP < 0.25 * f64::EPSILON * f64::MAX || end.is_finite())
            && self.ends_in_time(end, size)
    }

    /// Whether a step of a size (s) starts at the end of the last one, up to rounding.
    fn goes_on(&self, start: f64, size: f64) -> bool {
        let time = self.memory.time;
        (start - time).abs() <= TIME_TOLERANCE * size + time_rounding(time)
    }

    /// Whether a step of a size (s) stays within the experiment.
    fn ends_in_time(&self, end: f64, size: f64) -> bool {
        self.stop_time()
            .is_none_or(|stop_time| end <= stop_time + TIME_TOLERANCE * size + time_rounding(stop_time))
    }

    fn stop_time(&self) -> Option<f64> {
        self.memory.experiment.stop_time
    }

    /// Why a step is rejected.
    #[cold]
    fn step_error(&self, start: f64, size: f64, end: f64) -> Error {
        let [start_shown, size_shown] = [Shown(start), Shown(size)];
        Error::new(if !(size.is_finite() && size > 0.0) {
            format!("communicationStepSize is {size_shown}; it must be finite and greater than 0")
        } else if size > M::LONGEST_STEP {
            format!(
                "communicationStepSize is {size_shown} s; this FMU's longest step is {} s",
                Shown(M::LONGEST_STEP)
            )
        } else if !self.goes_on(start, size) {
            format!(
                "currentCommunicationPoint is {start_shown}, but the last step ended at {}",
                Shown(self.memory.time)
            )
        } else if !end.is_finite() {
            format!("the step from {start_shown} ends at {}", Shown(end))
        } else if end <= start {
            format!(
                "communicationStepSize is {size_shown}, which is lost in the rounding of the time {start_shown}"
            )
        } else {
            format!(
                "the step from {start_shown} to {} goes past the stopTime {} of the experiment",
                Shown(end),
                Shown(self.stop_time().unwrap_or(f64::INFINITY))
            )
        })
    }

    /// Logs a warning, and returns its status.
    fn warn(&self, message: core::fmt::Arguments<'_>) -> Status {
        self.logger.warning(message);
        Status::Warning
    }

    /// Logs why a call is discarded.
    pub(crate) fn log_discarded(&self, message: core::fmt::Arguments<'_>) {
        self.logger.event(Status::Discard, message);
    }

    /// The end of the last completed step (s).
    pub(crate) fn last_successful_time(&self) -> f64 {
        self.memory.time
    }

    /// A copy of everything that affects later calls.
    pub(crate) fn save(&mut self) -> Result<Memory<M>, Error> {
        self.check_partitions()?;
        if Self::DESCRIPTION.capabilities.get_and_set_state {
            check_memory(size_of::<Memory<M>>())?;
            self.may_roll_back = true;
            Ok(self.memory.clone())
        } else {
            Err(Error::new("this FMU cannot get and set its state (canGetAndSetFMUstate is false)"))
        }
    }

    /// Rejects calls that affect all model partitions while one is in Clock Update Mode (FMI 3.0.2, section 5.2.1).
    fn check_partitions(&self) -> Result<(), Error> {
        if self.clock_updates == 0 {
            Ok(())
        } else {
            Err(Error::new("must not be called while a model partition runs"))
        }
    }

    /// Continues from a saved memory.
    pub(crate) fn restore(&mut self, memory: &Memory<M>) -> Result<(), Error> {
        self.check_partitions()?;
        if memory.interface != self.memory.interface {
            return Err(Error::new(format!(
                "the state is one of {}, this instance is for {}",
                memory.interface, self.memory.interface
            )));
        }
        self.memory.clone_from(memory);
        Ok(())
    }

    /// A saved memory as bytes.
    pub(crate) fn serialize(memory: &Memory<M>) -> Result<Vec<u8>, Error> {
        Self::check_serializes()?;
        Self::to_bytes(memory)
    }

    /// A saved memory as bytes, whatever the FMU offers.
    pub(crate) fn to_bytes(memory: &Memory<M>) -> Result<Vec<u8>, Error> {
        let mut memory = memory.clone();
        memory.rewind();
        serialized_state::to_bytes(Self::DESCRIPTION, memory.interface, &mut memory)
    }

    /// The memory from bytes saved by this FMU, of any interface.
    #[cfg(target_family = "wasm")]
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Memory<M>, Error> {
        let [first, others @ ..] = [
            Interface::CoSimulation,
            Interface::CoSimulationWithEvents,
            Interface::ModelExchange,
            Interface::ScheduledExecution,
        ]
        .map(|interface| Self::read(interface, bytes));
        others.into_iter().fold(first, Result::or)
    }

    /// The memory from bytes saved by this FMU, in any process.
    pub(crate) fn deserialize(&self, bytes: &[u8]) -> Result<Memory<M>, Error> {
        Self::check_serializes()?;
        Self::read(self.memory.interface, bytes)
    }

    fn read(interface: Interface, bytes: &[u8]) -> Result<Memory<M>, Error> {
        let mut memory = Memory::<M>::new(interface);
        serialized_state::from_bytes(Self::DESCRIPTION, interface, bytes, &mut memory)?;
        memory.model.restored(&memory.variables);
        Ok(memory)
    }

    fn check_serializes() -> Result<(), Error> {
        if Self::DESCRIPTION.capabilities.serialize_state {
            Ok(())
        } else {
            Err(Error::new("this FMU cannot serialize its state (canSerializeFMUstate is false)"))
        }
    }
}

/// Rejects non-finite values.
#[inline]
fn check_finite<V: Variables>(variables: &V, time: f64) -> Result<(), Error> {
    variables.first_non_finite().map_or(Ok(()), |reference| Err(not_finite(variables, reference, time)))
}

#[cold]
fn not_finite<V: Variables>(variables: &V, reference: ValueReference, time: f64) -> Error {
    Error::new(format!(
        "the variable {} became {} at {} s",
        V::description(reference).map_or("", |variable| variable.name),
        Shown(variables.real(reference)),
        Shown(time)
    ))
}
