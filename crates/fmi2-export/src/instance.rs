//! One instance of an FMU: what each function of the standard does, without C.
//!
//! A call is refused, and changes nothing, when the calling sequence forbids it or an argument is wrong.
//! Only a step that fails midway, or a panic, leaves the instance in the state `error`, from which
//! `fmi2Reset` and `fmi2SetFMUstate` lead back. An initialization that fails can be tried again.

use std::ffi::{CStr, CString};

use crate::c_types::Status;
use crate::calling_sequence::{Function, Phase};
use crate::description::{
    Causality, DataType, Initial, ModelDescription, ValueReference, Variability, VariableDescription,
};
use crate::inputs::{InputSignal, MAX_ORDER};
use crate::logger::{Delivery, Logger, Said, Shown, WARNING};
use crate::model::{Context, Error, Experiment, InputsOf, Model, Step, Variables};
use crate::panics::contain;
use crate::persistence::{Archive, Persistent};
use crate::serialized_state;

/// How far, relative to the step, the importer's time may be off this instance's. Importers compute
/// communication points as `i * h`, by adding up, or from integer nanoseconds.
const TIME_TOLERANCE: f64 = 1e-6;

/// Rounding that times of this magnitude carry, whatever the step.
fn time_rounding(time: f64) -> f64 {
    64.0 * f64::EPSILON * time.abs()
}

/// What a call answers: a message when it failed, otherwise `fmi2OK`, `fmi2Warning` or `fmi2Discard`.
pub(crate) type Answer = Result<Status, Error>;

/// Everything that a saved state holds.
#[derive(Clone)]
pub(crate) struct Memory<M: Model> {
    phase: Phase,
    model: M,
    variables: M::Variables,
    inputs: InputSignal<InputsOf<M>>,
    /// For each variable that is an input: whether its being out of bounds was told.
    out_of_bounds: Box<[bool]>,
    experiment: Option<Experiment>,
    time: f64,
    /// Whether something was set since the values were computed.
    stale: bool,
    /// Whether a tunable parameter was set since the parameters were checked.
    parameters_changed: bool,
    said: Said,
}

impl<M: Model> Memory<M> {
    fn new() -> Self {
        let variables = M::Variables::default();
        Self {
            phase: Phase::Instantiated,
            model: M::default(),
            inputs: InputSignal::constant(variables.inputs().clone()),
            variables,
            out_of_bounds: vec![false; M::Variables::DESCRIPTION.variables.len()].into_boxed_slice(),
            experiment: None,
            time: 0.0,
            stale: true,
            parameters_changed: true,
            said: Said::default(),
        }
    }
}

impl<M: Model> Persistent for Memory<M> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self {
            phase,
            model,
            variables,
            inputs,
            out_of_bounds,
            experiment,
            time,
            stale,
            parameters_changed,
            said,
        } = self;
        phase.persist(archive)?;
        model.persist(archive)?;
        variables.persist(archive)?;
        inputs.persist(archive)?;
        out_of_bounds.persist(archive)?;
        experiment.persist(archive)?;
        time.persist(archive)?;
        stale.persist(archive)?;
        parameters_changed.persist(archive)?;
        said.persist(archive)
    }
}

/// An instance of a model.
pub(crate) struct Instance<M: Model> {
    logger: Logger,
    memory: Memory<M>,
    /// The strings that the last `fmi2GetString` returned; they stay valid until the next.
    pub(crate) strings: Vec<CString>,
}

impl<M: Model> Instance<M> {
    /// An instance that begins with a memory.
    pub(crate) fn new(logger: Logger, memory: Memory<M>) -> Self {
        Self { logger, memory, strings: Vec::new() }
    }

    /// The memory of an instance that nothing was done to yet.
    pub(crate) fn memory_of_a_fresh_one() -> Result<Memory<M>, Error> {
        contain(Memory::new)
    }

    const DESCRIPTION: &'static ModelDescription = M::Variables::DESCRIPTION;

    /// Runs the body of a function: only where the calling sequence allows it, with panics caught, and a
    /// failure told to the importer.
    pub(crate) fn call(&mut self, function: Function, body: impl FnOnce(&mut Self) -> Answer) -> Status {
        let phase = self.memory.phase;
        let answer = if function.phases().contains(&phase) {
            contain(|| body(self)).unwrap_or_else(|panic| {
                self.memory.phase = Phase::Error;
                Err(Error::new(format!("{panic}; reset the instance")))
            })
        } else {
            Err(Error::new(format!("must not be called in the state {phase}")))
        };
        answer.unwrap_or_else(|error| {
            self.logger.error(format_args!("{}: {error}", function.name()));
            Status::Error
        })
    }

    /// What the function that has run has to tell.
    pub(crate) fn take_messages(&self) -> Option<Delivery> {
        self.logger.take()
    }

    pub(crate) fn set_debug_logging(&mut self, on: bool, categories: &[&CStr]) -> Answer {
        self.logger
            .set_debug_logging(on, categories)
            .map(|()| Status::Ok)
            .map_err(|name| Error::new(format!("there is no log category {name:?}")))
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
            && !(tolerance.is_finite() && tolerance > 0.0)
        {
            return Err(Error::new(format!("tolerance is {}", Shown(tolerance))));
        }
        self.memory.experiment = Some(experiment);
        self.memory.time = start_time;
        Ok(Status::Ok)
    }

    pub(crate) fn enter_initialization_mode(&mut self) -> Answer {
        if self.memory.experiment.is_none() {
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
        self.memory.phase = Phase::StepComplete;
        Ok(status)
    }

    #[expect(clippy::unnecessary_wraps, reason = "answers as every function that may be called does")]
    pub(crate) fn terminate(&mut self) -> Answer {
        self.memory.phase = Phase::Terminated;
        Ok(Status::Ok)
    }

    #[expect(clippy::unnecessary_wraps, reason = "answers as every function that may be called does")]
    pub(crate) fn reset(&mut self) -> Answer {
        self.memory = Memory::new();
        Ok(Status::Ok)
    }

    /// Brings the values up to date with what was set since they were computed.
    fn compute_values(&mut self) -> Answer {
        let memory = &mut self.memory;
        if !memory.stale {
            return Ok(Status::Ok);
        }
        let mut status = Status::Ok;
        match memory.phase {
            Phase::InitializationMode => {
                let (logger, said) = (&self.logger, &mut memory.said);
                // A warning is given once, and where none is given, the status tells of none.
                let mut log = |category, message: std::fmt::Arguments<'_>| {
                    if said.is_new(&message.to_string()) {
                        logger.message(category, message);
                        if category == WARNING {
                            status = Status::Warning;
                        }
                    }
                };
                let mut context = Context::new(memory.experiment.unwrap_or_default(), &mut log);
                memory.model.initialize(&mut memory.variables, memory.inputs.initial(), &mut context)?;
                check_finite(&memory.variables, memory.time)?;
            }
            Phase::StepComplete => memory.model.refresh(&mut memory.variables, memory.inputs.initial()),
            Phase::Instantiated | Phase::Terminated | Phase::Error => {}
        }
        memory.stale = false;
        Ok(status)
    }

    /// Advances by one communication step.
    pub(crate) fn do_step(&mut self, start: f64, size: f64) -> Answer {
        let memory = &mut self.memory;
        if !(size.is_finite() && size > 0.0) {
            return Err(Error::new(format!(
                "communicationStepSize is {}; it must be finite and greater than 0",
                Shown(size)
            )));
        }
        if size > M::LONGEST_STEP {
            return Err(Error::new(format!(
                "communicationStepSize is {} s; the longest step that this FMU takes is {} s",
                Shown(size),
                Shown(M::LONGEST_STEP)
            )));
        }
        let off = (start - memory.time).abs();
        if off.is_nan() || off > TIME_TOLERANCE * size + time_rounding(memory.time) {
            return Err(Error::new(format!(
                "currentCommunicationPoint is {}, but the last step ended at {}",
                Shown(start),
                Shown(memory.time)
            )));
        }
        let experiment = memory.experiment.unwrap_or_default();
        let end = start + size;
        if end <= start {
            return Err(Error::new(format!(
                "communicationStepSize is {}, which is lost in the rounding of the time {}",
                Shown(size),
                Shown(start)
            )));
        }
        if let Some(stop_time) = experiment.stop_time
            && end > stop_time + TIME_TOLERANCE * size + time_rounding(stop_time)
        {
            return Err(Error::new(format!(
                "the step from {} to {} goes past the stopTime {} of fmi2SetupExperiment",
                Shown(start),
                Shown(end),
                Shown(stop_time)
            )));
        }
        if memory.parameters_changed {
            M::check_parameters(&memory.variables)?;
            memory.model.refresh(&mut memory.variables, memory.inputs.initial());
            memory.parameters_changed = false;
        }
        let mut status = Status::Ok;
        let logger = &self.logger;
        let mut log = |category, message: std::fmt::Arguments<'_>| {
            if category == WARNING {
                status = Status::Warning;
            }
            logger.message(category, message);
        };
        let step = Step { start, size, inputs: &memory.inputs };
        // Until the step is complete, whatever cuts it short leaves an instance that refuses to go on.
        memory.phase = Phase::Error;
        memory.model.step(&mut memory.variables, &step, &mut Context::new(experiment, &mut log))?;
        check_finite(&memory.variables, end)?;
        memory.phase = Phase::StepComplete;
        memory.time = end;
        memory.stale = false;
        memory.inputs.end_step(size);
        Ok(status)
    }

    /// Tells why a call is discarded.
    pub(crate) fn tell_discarded(&self, message: std::fmt::Arguments<'_>) {
        self.logger.discarded(message);
    }

    /// The end of the last completed step (s).
    pub(crate) fn last_successful_time(&self) -> f64 {
        self.memory.time
    }

    /// Everything that a later call depends on.
    pub(crate) fn memory(&self) -> Result<&Memory<M>, Error> {
        if Self::DESCRIPTION.capabilities.get_and_set_state {
            Ok(&self.memory)
        } else {
            Err(Error::new("this FMU cannot get and set its state (canGetAndSetFMUstate is false)"))
        }
    }

    /// Takes up where a saved memory left off.
    pub(crate) fn restore(&mut self, memory: &Memory<M>) {
        self.memory.clone_from(memory);
    }

    /// A saved memory as bytes.
    pub(crate) fn serialize(memory: &Memory<M>) -> Result<Vec<u8>, Error> {
        Self::check_serializes()?;
        serialized_state::to_bytes(Self::DESCRIPTION, &mut memory.clone())
    }

    /// The memory that was saved as bytes, by this FMU wherever it ran.
    pub(crate) fn deserialize(bytes: &[u8]) -> Result<Memory<M>, Error> {
        Self::check_serializes()?;
        let mut memory = Memory::<M>::new();
        serialized_state::from_bytes(Self::DESCRIPTION, bytes, &mut memory)?;
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

    /// A variable, if a value reference is one's and of that type.
    fn variable(
        reference: ValueReference,
        requested: DataType,
    ) -> Result<&'static VariableDescription, Error> {
        let variable = Self::DESCRIPTION.variables.get(reference as usize).ok_or_else(|| {
            Error::new(format!("there is no variable with the value reference {reference}"))
        })?;
        let data_type = match variable.data_type {
            DataType::Enumeration => DataType::Integer,
            other => other,
        };
        if data_type == requested {
            Ok(variable)
        } else {
            Err(Error::new(format!("the variable {} is of the type {:?}", variable.name, variable.data_type)))
        }
    }

    /// Gets values; `read` writes the one at an index. First every value reference is checked.
    fn get(
        &mut self,
        references: &[ValueReference],
        requested: DataType,
        mut read: impl FnMut(&M::Variables, usize, ValueReference) -> Result<(), Error>,
    ) -> Answer {
        for &reference in references {
            Self::variable(reference, requested)?;
        }
        let status = self.compute_values()?;
        for (index, &reference) in references.iter().enumerate() {
            read(&self.memory.variables, index, reference)?;
        }
        Ok(status)
    }

    pub(crate) fn get_real(&mut self, references: &[ValueReference], values: &mut [f64]) -> Answer {
        let time = self.memory.time;
        let mut no_number = Ok(());
        let status = self.get(references, DataType::Real, |variables, index, reference| {
            let variable = &Self::DESCRIPTION.variables[reference as usize];
            let value =
                if variable.causality == Causality::Independent { time } else { variables.real(reference) };
            // The others are handed out all the same: what a failed step has left is of use for debugging.
            if value.is_finite() {
                values[index] = value;
            } else if no_number.is_ok() {
                let message = format!("the variable {} is {}", variable.name, Shown(value));
                no_number = Err(Error::new(message));
            }
            Ok(())
        })?;
        no_number.map(|()| status)
    }

    pub(crate) fn get_integer(&mut self, references: &[ValueReference], values: &mut [i32]) -> Answer {
        self.get(references, DataType::Integer, |variables, index, reference| {
            values[index] = variables.integer(reference);
            Ok(())
        })
    }

    pub(crate) fn get_boolean(&mut self, references: &[ValueReference], values: &mut [i32]) -> Answer {
        self.get(references, DataType::Boolean, |variables, index, reference| {
            values[index] = i32::from(variables.boolean(reference));
            Ok(())
        })
    }

    /// Leaves the values in [`Instance::strings`].
    pub(crate) fn get_string(&mut self, references: &[ValueReference]) -> Answer {
        let mut strings = Vec::with_capacity(references.len());
        let status = self.get(references, DataType::String, |variables, _, reference| {
            let text = variables.string(reference);
            strings.push(CString::new(text).map_err(|_| Error::new("a string with a NUL in it"))?);
            Ok(())
        })?;
        self.strings = strings;
        Ok(status)
    }

    /// Whether, in the present state, a variable may be set, and to this value (as a number).
    fn check_settable(&self, variable: &VariableDescription, value: f64) -> Result<(), Error> {
        let phase = self.memory.phase;
        let is_input = variable.causality == Causality::Input;
        let settable = match phase {
            Phase::Instantiated => is_input || matches!(variable.initial, Initial::Exact | Initial::Approx),
            Phase::InitializationMode => is_input || variable.initial == Initial::Exact,
            Phase::StepComplete => is_input || variable.variability == Variability::Tunable,
            Phase::Terminated | Phase::Error => false,
        };
        let settable = settable && variable.variability != Variability::Constant;
        if settable && value.is_finite() && (is_input || (variable.min..=variable.max).contains(&value)) {
            Ok(())
        } else {
            Err(self.why_not_set(variable, value, settable))
        }
    }

    /// Why a variable is not set to a value.
    #[cold]
    fn why_not_set(&self, variable: &VariableDescription, value: f64, settable: bool) -> Error {
        Error::new(if !settable {
            format!(
                "{} (a {}, {}) cannot be set in the state {}",
                variable.name, variable.causality, variable.variability, self.memory.phase
            )
        } else if !value.is_finite() {
            format!("{} for the variable {}", Shown(value), variable.name)
        } else {
            format!(
                "{} for the variable {} is outside its range {} to {}",
                Shown(value),
                variable.name,
                Shown(variable.min),
                Shown(variable.max)
            )
        })
    }

    /// Notes that a variable was set; warns once of an input that is out of its bounds.
    fn was_set(&mut self, reference: ValueReference, value: f64) -> Status {
        let memory = &mut self.memory;
        let variable = &Self::DESCRIPTION.variables[reference as usize];
        memory.stale = true;
        if variable.causality != Causality::Input {
            memory.parameters_changed = true;
            return Status::Ok;
        }
        let outside = if let Some(position) = variable.real_input {
            memory.inputs.set_value(position, value)
        } else {
            memory.inputs.set_others(memory.variables.inputs());
            !(variable.min..=variable.max).contains(&value)
        };
        let told = std::mem::replace(&mut memory.out_of_bounds[reference as usize], outside);
        if outside && !told { self.warn_of_bounds(variable, value) } else { Status::Ok }
    }

    #[cold]
    fn warn_of_bounds(&self, variable: &VariableDescription, value: f64) -> Status {
        self.logger.message(
            WARNING,
            format_args!(
                "{} for the input {} is outside its range {} to {}; the nearest bound is used",
                Shown(value),
                variable.name,
                Shown(variable.min),
                Shown(variable.max)
            ),
        );
        Status::Warning
    }

    /// Sets values: checks all before it changes any. `as_number` is a value as ranges see it.
    fn set<T: Copy>(
        &mut self,
        references: &[ValueReference],
        values: &[T],
        requested: DataType,
        as_number: impl Fn(T) -> f64,
        write: impl Fn(&mut M::Variables, ValueReference, T),
    ) -> Answer {
        for (&reference, &value) in references.iter().zip(values) {
            self.check_settable(Self::variable(reference, requested)?, as_number(value))?;
        }
        let mut status = Status::Ok;
        for (&reference, &value) in references.iter().zip(values) {
            write(&mut self.memory.variables, reference, value);
            status = status.max(self.was_set(reference, as_number(value)));
        }
        Ok(status)
    }

    pub(crate) fn set_real(&mut self, references: &[ValueReference], values: &[f64]) -> Answer {
        self.set(references, values, DataType::Real, |value| value, M::Variables::set_real)
    }

    pub(crate) fn set_integer(&mut self, references: &[ValueReference], values: &[i32]) -> Answer {
        self.set(references, values, DataType::Integer, f64::from, M::Variables::set_integer)
    }

    pub(crate) fn set_boolean(&mut self, references: &[ValueReference], values: &[i32]) -> Answer {
        let write =
            |variables: &mut M::Variables, reference, value| variables.set_boolean(reference, value != 0);
        self.set(references, values, DataType::Boolean, |_| 0.0, write)
    }

    pub(crate) fn set_string(&mut self, references: &[ValueReference], values: &[&str]) -> Answer {
        self.set(references, values, DataType::String, |_| 0.0, M::Variables::set_string)
    }

    pub(crate) fn set_real_input_derivatives(
        &mut self,
        references: &[ValueReference],
        orders: &[i32],
        values: &[f64],
    ) -> Answer {
        if !Self::DESCRIPTION.capabilities.interpolate_inputs {
            return Err(Error::new("this FMU cannot interpolate inputs (canInterpolateInputs is false)"));
        }
        let derivatives = || references.iter().zip(orders).zip(values);
        for ((&reference, &order), &value) in derivatives() {
            Self::input_derivative(reference, order, value)?;
        }
        for ((&reference, &order), &value) in derivatives() {
            let (position, order) = Self::input_derivative(reference, order, value)?;
            self.memory.inputs.set_derivative(position, order, value);
        }
        Ok(Status::Ok)
    }

    /// Which Real input, and which order, a derivative is for, if it may be set.
    fn input_derivative(reference: ValueReference, order: i32, value: f64) -> Result<(usize, usize), Error> {
        let variable = Self::variable(reference, DataType::Real)?;
        let name = variable.name;
        let Some(position) = variable.real_input else {
            return Err(Error::new(format!("the variable {name} is no input")));
        };
        let Some(order) = usize::try_from(order).ok().filter(|order| (1..=MAX_ORDER).contains(order)) else {
            return Err(Error::new(format!(
                "order {order} of the derivative of {name}; the orders 1 to {MAX_ORDER} are taken"
            )));
        };
        if !value.is_finite() {
            return Err(Error::new(format!("{} for a derivative of the input {name}", Shown(value))));
        }
        if variable.variability != Variability::Continuous && value != 0.0 {
            return Err(Error::new(format!(
                "{} for a derivative of the discrete input {name}, which holds its value",
                Shown(value)
            )));
        }
        Ok((position, order))
    }

    /// The directional derivatives of unknowns along a direction of knowns (section 2.1.9).
    pub(crate) fn get_directional_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seeds: &[f64],
        sensitivities: &mut [f64],
    ) -> Answer {
        Self::check_differentiates("providesDirectionalDerivative is false")?;
        for &unknown in unknowns {
            self.check_unknown(Self::variable(unknown, DataType::Real)?)?;
        }
        let mut direction = M::Variables::zero();
        for (position, (&known, &seed)) in knowns.iter().zip(seeds).enumerate() {
            let variable = Self::variable(known, DataType::Real)?;
            self.check_known(variable)?;
            if !seed.is_finite() {
                return Err(Error::new(format!("{} for the seed of {}", Shown(seed), variable.name)));
            }
            if knowns[..position].contains(&known) {
                return Err(Error::new(format!("{} is twice among the knowns", variable.name)));
            }
            if variable.real_input.is_none_or(|input| self.memory.inputs.is_free(input)) {
                direction.set_real(known, seed);
            }
        }
        let (status, derivatives) = self.differentiate(&direction)?;
        copy_derivatives(&derivatives, unknowns, sensitivities)?;
        Ok(status)
    }

    /// The derivatives of outputs with respect to time (section 4.2.1).
    pub(crate) fn get_real_output_derivatives(
        &mut self,
        references: &[ValueReference],
        orders: &[i32],
        values: &mut [f64],
    ) -> Answer {
        Self::check_differentiates("maxOutputDerivativeOrder is 0")?;
        for (&reference, &order) in references.iter().zip(orders) {
            let variable = Self::variable(reference, DataType::Real)?;
            if variable.causality != Causality::Output {
                return Err(Error::new(format!("the variable {} is no output", variable.name)));
            }
            if order != 1 {
                return Err(Error::new(format!(
                    "order {order} of the derivative of {}; maxOutputDerivativeOrder is 1",
                    variable.name
                )));
            }
        }
        let status = self.compute_values()?;
        // Along the way that states and inputs take.
        let mut direction = self.memory.variables.along_derivatives();
        for (reference, variable) in (0..).zip(Self::DESCRIPTION.variables) {
            if let Some(input) = variable.real_input {
                direction.set_real(reference, self.memory.inputs.slope(input));
            }
        }
        let (_, derivatives) = self.differentiate(&direction)?;
        copy_derivatives(&derivatives, references, values)?;
        Ok(status)
    }

    fn check_differentiates(missing: &str) -> Result<(), Error> {
        if Self::DESCRIPTION.capabilities.directional_derivatives {
            Ok(())
        } else {
            Err(Error::new(format!("this FMU has no such derivatives ({missing})")))
        }
    }

    /// What can be differentiated: what the model calculates.
    fn check_unknown(&self, variable: &VariableDescription) -> Result<(), Error> {
        let calculated = match variable.causality {
            Causality::Output => true,
            // A state is an unknown of the initialization and a known of the steps.
            Causality::Local => {
                self.memory.phase == Phase::InitializationMode && variable.initial != Initial::Exact
                    || variable.initial == Initial::Calculated
            }
            Causality::Parameter
            | Causality::CalculatedParameter
            | Causality::Input
            | Causality::Independent => false,
        };
        if calculated {
            Ok(())
        } else {
            Err(Error::new(format!("{} is no unknown in the state {}", variable.name, self.memory.phase)))
        }
    }

    /// What can be differentiated with respect to: inputs; in initialization mode the parameters and exact
    /// start values, later the states.
    fn check_known(&self, variable: &VariableDescription) -> Result<(), Error> {
        let is_state = variable.causality == Causality::Local
            && matches!(variable.initial, Initial::Exact | Initial::Approx);
        let initializing = self.memory.phase == Phase::InitializationMode;
        let known = match variable.causality {
            Causality::Input => true,
            Causality::Parameter => initializing,
            _ if initializing => is_state && variable.initial == Initial::Exact,
            _ => is_state,
        };
        if known {
            Ok(())
        } else {
            Err(Error::new(format!("{} is no known in the state {}", variable.name, self.memory.phase)))
        }
    }

    /// The derivatives along a direction, once the values are up to date.
    fn differentiate(&mut self, direction: &M::Variables) -> Result<(Status, M::Variables), Error> {
        let status = self.compute_values()?;
        let memory = &self.memory;
        let (variables, inputs) = (&memory.variables, memory.inputs.latest());
        let derivatives = if memory.phase == Phase::InitializationMode {
            memory.model.differentiate_initialization(variables, inputs, direction)
        } else {
            memory.model.differentiate(variables, inputs, direction)
        };
        Ok((status, derivatives?))
    }
}

/// Hands out the derivatives of variables, if they are numbers.
fn copy_derivatives<V: Variables>(
    derivatives: &V,
    references: &[ValueReference],
    values: &mut [f64],
) -> Result<(), Error> {
    for (&reference, value) in references.iter().zip(values) {
        *value = derivatives.real(reference);
        if !value.is_finite() {
            let name = V::DESCRIPTION.variables[reference as usize].name;
            return Err(Error::new(format!("the derivative of {name} is {}", Shown(*value))));
        }
    }
    Ok(())
}

/// Refuses values that are no numbers.
fn check_finite<V: Variables>(variables: &V, time: f64) -> Result<(), Error> {
    match variables.first_non_finite() {
        None => Ok(()),
        Some(reference) => Err(Error::new(format!(
            "the variable {} became {} at the time {} s",
            V::DESCRIPTION.variables[reference as usize].name,
            Shown(variables.real(reference)),
            Shown(time)
        ))),
    }
}
