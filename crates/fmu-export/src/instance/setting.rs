//! Setting variables (FMI 2.0.5, section 2.1.7), and the derivatives of inputs (section 4.2.1).

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_abi::floating_point::in_default_environment;
use fmu_solve::Error;
use fmu_solve::display::Shown;

use super::values::{BINARIES, BOOLEANS, FLOATS, REALS, STRINGS, Whole};
use super::{Answer, Instance};
use crate::allocation::check_memory;
use crate::kinds::Model;
use crate::kinds::input_signal::MAX_ORDER;
use crate::model::description::{
    Causality, DataType, Initial, Refused, ScalarVariable, ValueReference, Variability, VariableDescription,
};
use crate::model::variables::{Accessed as _, Described as _};

/// How to set values of a type.
struct Setter<V, T> {
    /// The number to compare with the range.
    as_number: fn(T) -> f64,
    /// Whether a value equals the present one.
    is_set: fn(&V, ValueReference, T) -> bool,
    write: fn(&mut V, ValueReference, T),
}

/// How to set values that variables store unchanged, by their accessors.
macro_rules! setter {
    ($get:ident, $set:ident, $as_number:expr) => {
        const {
            &Setter {
                as_number: $as_number,
                is_set: |variables: &M::Variables, reference, value| {
                    PartialEq::eq(&variables.$get(reference), &value)
                },
                write: M::Variables::$set,
            }
        }
    };
}

impl<M: Model> Instance<M> {
    /// Whether the variable exists and may be set. Separate from setting Real inputs, which is faster without.
    #[inline(never)]
    fn check(&self, reference: ValueReference, types: &[DataType], value: f64) -> Result<(), Error> {
        self.check_settable(Self::attributes(reference, types)?, reference, value)
    }

    /// Whether a variable may be set now, and to this value (as a number).
    fn check_settable(
        &self,
        variable: &VariableDescription,
        reference: ValueReference,
        value: f64,
    ) -> Result<(), Error> {
        let settable = match variable.causality {
            Causality::Input if self.memory.phase != Phase::ConfigurationMode => self.takes_input(variable),
            _ => self.is_settable_now(variable),
        };
        // A solver tries states beyond their bounds; the model copes, as with fmi2SetContinuousStates.
        let is_accepted = self.memory.phase == Phase::ContinuousTimeMode || variable.accepts(value);
        if settable && value.is_finite() && is_accepted {
            Ok(())
        } else {
            Err(self.set_error(reference, value, settable))
        }
    }

    /// Whether an input may be set now: between events of Model Exchange, continuous ones only.
    fn takes_input(&self, variable: &VariableDescription) -> bool {
        self.memory.phase != Phase::ContinuousTimeMode || variable.variability == Variability::Continuous
    }

    /// Whether a variable that is not an input may be set now (sections 3.2.3 and 4.2.4).
    pub(super) fn is_settable_now(&self, variable: &VariableDescription) -> bool {
        let phase = self.memory.phase;
        if variable.causality == Causality::StructuralParameter || phase == Phase::ConfigurationMode {
            return variable.causality == Causality::StructuralParameter && phase == Phase::ConfigurationMode;
        }
        variable.variability != Variability::Constant
            && match phase {
                Phase::Instantiated => matches!(variable.initial, Some(Initial::Exact | Initial::Approx)),
                Phase::InitializationMode => variable.initial == Some(Initial::Exact),
                Phase::StepComplete
                | Phase::EventMode
                | Phase::StepEventMode
                | Phase::ClockActivationMode => variable.variability == Variability::Tunable,
                Phase::ContinuousTimeMode => variable.first_state.is_some(),
                Phase::StepFailed
                | Phase::Terminated
                | Phase::Error
                | Phase::IntermediateUpdateMode
                | Phase::ConfigurationMode => false,
            }
    }

    /// Why a variable cannot be set to a value.
    #[cold]
    fn set_error(&self, reference: ValueReference, value: f64, settable: bool) -> Error {
        let variable = Self::checked(reference);
        if !settable {
            return Error::new(format_args!(
                "{} ({}, {}) cannot be set in the state {}",
                variable.name(),
                variable.causality,
                variable.variability,
                self.memory.phase
            ));
        }
        if value.is_finite() && variable.causality == Causality::StructuralParameter {
            return Error::new(format_args!(
                "{} for the size {}, fixed at {} when this FMU was built, since the elements of larger arrays would have \
                 the references of other variables: export the model with another start value",
                Shown(value),
                variable.name(),
                Shown(variable.min)
            ));
        }
        Error::new(Refused { variable, value })
    }

    /// Reports that an input is clamped to a bound. If the importer may be trying values, in Continuous-Time Mode and
    /// in steps that it may roll back, the status is OK, because solvers treat one as a failure. Each input
    /// is then logged once, because finite differences leave the range repeatedly.
    #[cold]
    fn warn_of_bounds(&mut self, reference: ValueReference, value: f64) -> Status {
        let variable = Self::checked(reference);
        let tries = self.memory.phase == Phase::ContinuousTimeMode || self.may_roll_back;
        if !self.logged_inputs.contains(&reference) {
            self.logged_inputs.push(reference);
        } else if tries {
            return Status::Ok;
        }
        let warned = self.logger.warning(format_args!(
            "{} for the input {} is outside its range {} to {}; the nearest bound is used",
            Shown(value),
            variable.name(),
            Shown(variable.min),
            Shown(variable.max)
        ));
        if tries { Status::Ok } else { warned }
    }

    /// Sets values, after checking all of them.
    fn set<T: Copy>(
        &mut self,
        references: &[ValueReference],
        values: &[T],
        types: &[DataType],
        setter: &Setter<M::Variables, T>,
    ) -> Answer {
        if !M::Variables::CLOCKS.is_empty() {
            self.check_ticking(references)?;
            self.memory.rewind();
        }
        if self.memory.phase == Phase::ContinuousTimeMode {
            return in_default_environment(|| self.set_between_events(references, values, types, setter));
        }
        let &Setter { as_number, is_set, write } = setter;
        let mut last = 0;
        for (&reference, &value) in references.iter().zip(values) {
            // Real inputs accept any finite value: bounds are applied later.
            let variable = M::Variables::description_near(reference, &mut last);
            let is_real_input = variable.is_some_and(|variable| variable.first_real_input.is_some());
            if !(types == REALS && is_real_input && as_number(value).is_finite()) {
                in_default_environment(|| self.check(reference, types, as_number(value)))?;
            }
        }
        self.memory.stale = true;
        let mut status = Status::Ok;
        for (&reference, &value) in references.iter().zip(values) {
            let Some(variable) = M::Variables::description_near(reference, &mut last) else { continue };
            let memory = &mut self.memory;
            if let Some(position) = variable.real_input() {
                if memory.set_real_input(reference, position, as_number(value)) {
                    status = self.warn_of_bounds(reference, as_number(value));
                }
                continue;
            }
            // Of a state, the start value is set, which its present value says nothing about.
            let is_kept = variable.first_state.is_none() && is_set(&memory.variables, reference, value);
            write(&mut memory.variables, reference, value);
            if is_kept {
                continue;
            }
            if variable.causality == Causality::Input {
                memory.note_changed_input();
            } else {
                memory.parameters_changed = true;
            }
        }
        Ok(status)
    }

    /// Sets states and continuous inputs in Continuous-Time Mode. Discrete inputs and tunable parameters may be set to
    /// their present values, which FMPy and CasADi do.
    #[cold]
    fn set_between_events<T: Copy>(
        &mut self,
        references: &[ValueReference],
        values: &[T],
        types: &[DataType],
        &Setter { as_number, is_set, write }: &Setter<M::Variables, T>,
    ) -> Answer {
        let is_kept = |this: &Self, variable: &ScalarVariable, reference, value| {
            (variable.causality == Causality::Input || variable.variability == Variability::Tunable)
                && match variable.real_input() {
                    Some(position) => PartialEq::eq(&this.memory.inputs.set(position), &as_number(value)),
                    None => is_set(&this.memory.variables, reference, value),
                }
        };
        for (&reference, &value) in references.iter().zip(values) {
            let variable = Self::variable(reference, types)?;
            if !is_kept(self, &variable, reference, value) {
                self.check_settable(&variable, reference, as_number(value))?;
            }
        }
        let mut status = Status::Ok;
        for (&reference, &value) in references.iter().zip(values) {
            let variable = Self::checked(reference);
            if is_kept(self, &variable, reference, value) {
                continue;
            }
            let memory = &mut self.memory;
            memory.stale = true;
            if variable.state().is_some() {
                memory.variables.set_state(reference, as_number(value));
                continue;
            }
            let Some(position) = variable.real_input() else {
                // A Float32.
                write(&mut memory.variables, reference, value);
                memory.note_changed_input();
                continue;
            };
            if memory.set_real_input(reference, position, as_number(value)) {
                status = self.warn_of_bounds(reference, as_number(value));
            }
        }
        Ok(status)
    }

    pub(crate) fn set_real(&mut self, references: &[ValueReference], values: &[f64]) -> Answer {
        let are_inputs = references.iter().all(|reference| M::Variables::REAL_INPUTS.contains(reference));
        if const { M::Variables::CLOCKS.is_empty() }
            && self.memory.phase != Phase::ContinuousTimeMode
            && are_inputs
            && values.iter().all(|value| value.is_finite())
        {
            return Ok(self.set_real_inputs(references, values));
        }
        let setter = const {
            &Setter {
                as_number: |value| value,
                is_set: |variables: &M::Variables, reference, value| {
                    PartialEq::eq(&variables.real(reference), &M::Variables::rounded(value))
                },
                write: M::Variables::set_real,
            }
        };
        self.set(references, values, REALS, setter)
    }

    /// Sets Real inputs to finite values, which all are allowed at all times but in Continuous-Time Mode: faster than
    /// looking at the description of each, as importers set inputs at each point.
    fn set_real_inputs(&mut self, references: &[ValueReference], values: &[f64]) -> Status {
        self.memory.stale = true;
        let mut status = Status::Ok;
        for (&reference, &value) in references.iter().zip(values) {
            let position = (reference - M::Variables::REAL_INPUTS.start) as usize;
            if self.memory.set_real_input(reference, position, value) {
                status = self.warn_of_bounds(reference, value);
            }
        }
        status
    }

    /// Sets variables of the types accessed by the functions of Integer (FMI 2.0) or Int32.
    pub(crate) fn set_integers(&mut self, references: &[ValueReference], values: &[i32]) -> Answer {
        self.set(references, values, Self::INTEGERS, setter!(integer, set_integer, f64::from))
    }

    pub(crate) fn set_float32(&mut self, references: &[ValueReference], values: &[f32]) -> Answer {
        self.set(references, values, FLOATS, setter!(float32, set_float32, f64::from))
    }

    /// Sets variables of an FMI 3.0 integer type other than Int32.
    pub(crate) fn set_wholes<T: Whole>(&mut self, references: &[ValueReference], values: &[T]) -> Answer {
        let setter = Setter {
            #[expect(
                clippy::cast_precision_loss,
                reason = "bounds are exact numbers, to which none is rounded across"
            )]
            as_number: |value: T| value.into() as f64,
            is_set: |variables: &M::Variables, reference, value| {
                Self::whole(variables, reference) == value.into()
            },
            write: |variables, reference, value| match (Self::checked(reference).data_type, value.into()) {
                (DataType::Enumeration, value) => {
                    // It was checked to be an item.
                    variables.set_integer(reference, value.try_into().unwrap_or_default());
                }
                (_, value) => variables.set_whole(reference, value),
            },
        };
        self.set(references, values, T::TYPES, &setter)
    }

    pub(crate) fn set_binary(&mut self, references: &[ValueReference], values: &[&[u8]]) -> Answer {
        check_memory(values.iter().map(|value| value.len()).sum())?;
        self.set(references, values, BINARIES, setter!(binary, set_binary, |_| 0.0))
    }

    /// Any value but 0 is true.
    pub(crate) fn set_boolean<T: Copy + Default + PartialEq>(
        &mut self,
        references: &[ValueReference],
        values: &[T],
    ) -> Answer {
        let setter = const {
            &Setter {
                as_number: |_| 0.0,
                is_set: |variables: &M::Variables, reference, value| {
                    variables.boolean(reference) == (value != T::default())
                },
                write: |variables, reference, value| {
                    variables.set_boolean(reference, value != T::default());
                },
            }
        };
        self.set(references, values, BOOLEANS, setter)
    }

    pub(crate) fn set_string(&mut self, references: &[ValueReference], values: &[&str]) -> Answer {
        check_memory(values.iter().map(|value| value.len()).sum())?;
        self.set(references, values, STRINGS, setter!(string, set_string, |_| 0.0))
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
        let mut status = Status::Ok;
        for ((&reference, &order), &value) in derivatives() {
            let (position, order) = Self::input_derivative(reference, order, value)?;
            let variable = Self::checked(reference);
            if variable.variability == Variability::Continuous {
                self.memory.inputs.set_derivative(position, order, value);
            } else if value != 0.0 && self.memory.inputs.ignore_derivative(position) {
                status = self.logger.warning(format_args!(
                    "the input {} is discrete and constant; its derivatives are ignored",
                    variable.name()
                ));
            }
        }
        Ok(status)
    }

    /// The Real input and order of a derivative, if settable.
    fn input_derivative(reference: ValueReference, order: i32, value: f64) -> Result<(usize, usize), Error> {
        let variable = Self::variable(reference, REALS)?;
        let name = variable.name();
        let Some(position) = variable.real_input() else {
            return Err(Error::new(format!("the variable {name} is not an input")));
        };
        let Some(order) = usize::try_from(order).ok().filter(|order| (1..=MAX_ORDER).contains(order)) else {
            return Err(Error::new(format!(
                "order {order} of the derivative of {name}; the orders 1 to {MAX_ORDER} are supported"
            )));
        };
        if !value.is_finite() {
            return Err(Error::new(format!("{} for a derivative of the input {name}", Shown(value))));
        }
        Ok((position, order))
    }
}
