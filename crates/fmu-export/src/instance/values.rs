//! Variables by value reference, and getting them (FMI 2.0.5, section 2.1.7).

use core::mem;
use std::ffi::CString;

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_solve::Error;
use fmu_solve::display::Shown;

use super::{Answer, Instance};
use crate::allocation::check_memory;
use crate::kinds::Model;
use crate::model::description::{DataType, ScalarVariable, ValueReference, VariableDescription, Version};
use crate::model::variables::{Accessed as _, Described as _};

pub(super) const REALS: &[DataType] = &[DataType::Real];
pub(super) const BOOLEANS: &[DataType] = &[DataType::Boolean];
pub(super) const STRINGS: &[DataType] = &[DataType::String];
pub(super) const BINARIES: &[DataType] = &[DataType::Binary];
pub(super) const FLOATS: &[DataType] = &[DataType::Float32];

/// The numbers of an FMI 3.0 integer type other than Int32.
pub(crate) trait Whole: Copy + Into<i128> + TryFrom<i128> {
    /// The types that the functions of this integer type access.
    const TYPES: &[DataType];
}

macro_rules! wholes {
    ($($number:ty: [$($data_type:ident),*];)*) => {$(
        impl Whole for $number {
            const TYPES: &[DataType] = &[$(DataType::$data_type),*];
        }
    )*};
}

wholes! {
    i8: [Int8];
    u8: [UInt8];
    i16: [Int16];
    u16: [UInt16];
    u32: [UInt32];
    i64: [Int64, Enumeration];
    u64: [UInt64];
}

impl<M: Model> Instance<M> {
    /// The types accessed by the functions of Integer (FMI 2.0) or Int32.
    pub(super) const INTEGERS: &[DataType] = match Self::DESCRIPTION.version {
        Version::Two => &[DataType::Integer, DataType::Enumeration],
        Version::Three => &[DataType::Integer],
    };

    /// A scalar variable, if its type is one of `types`.
    pub(super) fn variable(reference: ValueReference, types: &[DataType]) -> Result<ScalarVariable, Error> {
        Self::attributes(reference, types).map(|_| Self::checked(reference))
    }

    /// The attributes of a variable, if its type is one of `types`.
    pub(super) fn attributes(
        reference: ValueReference,
        types: &[DataType],
    ) -> Result<&'static VariableDescription, Error> {
        let variable = M::Variables::attributes(reference).ok_or_else(|| Self::no_variable(reference))?;
        if types.contains(&variable.data_type) { Ok(variable) } else { Err(Self::type_error(reference)) }
    }

    /// Checks that variables exist and have one of `types`.
    fn check_types(references: &[ValueReference], types: &[DataType]) -> Result<(), Error> {
        let is_element = |reference| reference as usize >= M::Variables::FRONT;
        let (mut last, mut checked) = (0, 0..0);
        for &reference in references {
            if is_element(reference) && checked.contains(&reference) {
                continue;
            }
            match M::Variables::description_near(reference, &mut last) {
                Some(variable) if types.contains(&variable.data_type) => {
                    if is_element(reference) {
                        // The array found may be the next.
                        let of_one_type = M::Variables::of_one_type(last);
                        checked = if of_one_type.contains(&reference) { of_one_type } else { 0..0 };
                    }
                }
                Some(_) => return Err(Self::type_error(reference)),
                None => return Err(Self::no_variable(reference)),
            }
        }
        Ok(())
    }

    #[cold]
    fn no_variable(reference: ValueReference) -> Error {
        Error::new(format!("there is no variable with the value reference {reference}"))
    }

    /// The error that a variable has another type.
    #[cold]
    fn type_error(reference: ValueReference) -> Error {
        let variable = Self::checked(reference);
        let data_type = variable.data_type.name(Self::DESCRIPTION.version);
        Error::new(format!("the variable {} is of the type {data_type}", variable.name()))
    }

    /// A variable whose value reference was checked.
    pub(super) fn checked(reference: ValueReference) -> ScalarVariable {
        M::Variables::description(reference).expect("the value reference was checked")
    }

    /// The value references of a variable's elements, or that of a scalar.
    pub(crate) fn elements(reference: ValueReference) -> Result<impl Iterator<Item = ValueReference>, Error> {
        M::Variables::elements(reference).ok_or_else(|| Self::no_variable(reference))
    }

    /// Runs a body on the value references of scalars; arrays are expanded to their elements, whose number must be that
    /// of the values.
    pub(crate) fn with_scalars(
        &mut self,
        references: &[ValueReference],
        values: usize,
        body: impl FnOnce(&mut Self, &[ValueReference]) -> Answer,
    ) -> Answer {
        // A constant, so that the compiler inlines the body.
        if const { !M::Variables::HAS_ARRAYS } {
            // In FMI 2.0 both are one argument.
            if const { matches!(Self::DESCRIPTION.version, Version::Three) } {
                Self::check_values(references.len(), values)?;
            }
            return body(self, references);
        }
        let mut scalars = mem::take(&mut self.scalars);
        scalars.clear();
        // Not the importer's count, which may be any number.
        for &reference in references {
            scalars.extend(Self::elements(reference)?);
        }
        Self::check_values(scalars.len(), values)?;
        let answer = body(self, &scalars);
        self.scalars = scalars;
        answer
    }

    /// Checks the number of values passed for variables.
    fn check_values(expected: usize, values: usize) -> Result<(), Error> {
        if expected == values { Ok(()) } else { Err(Self::count_error(expected, values)) }
    }

    #[cold]
    fn count_error(expected: usize, values: usize) -> Error {
        Error::new(format!("nValues is {values}; the variables have {expected}"))
    }

    /// Gets values; `read` writes each. All value references are checked first.
    fn get<T>(
        &mut self,
        references: &[ValueReference],
        values: impl IntoIterator<Item = T>,
        types: &[DataType],
        mut read: impl FnMut(&M::Variables, ValueReference, T) -> Result<(), Error>,
    ) -> Answer {
        Self::check_types(references, types)?;
        let status = self.compute_values()?;
        for (&reference, value) in references.iter().zip(values) {
            read(&self.memory.variables, reference, value)?;
        }
        Ok(status)
    }

    pub(crate) fn get_real(&mut self, references: &[ValueReference], values: &mut [f64]) -> Answer {
        let mut status = Status::Ok;
        if self.memory.stale {
            Self::check_types(references, REALS)?;
            status = self.compute_values()?;
        }
        let are_finite = self.memory.variables.copy_reals(self.memory.time, references, values);
        if self.memory.inputs.differs() {
            self.copy_set_inputs(references, values);
        }
        if are_finite {
            return Ok(status);
        }
        // One is of no Real, or no finite number.
        Self::check_types(references, REALS)?;
        self.no_number(references)
    }

    /// Copies the values of Real inputs as the importer has set them, which the model does not see.
    #[cold]
    fn copy_set_inputs(&self, references: &[ValueReference], values: &mut [f64]) {
        for (&reference, value) in references.iter().zip(values) {
            if let Some(position) = M::Variables::description(reference).and_then(ScalarVariable::real_input)
            {
                *value = self.memory.inputs.set(position);
            }
        }
    }

    /// The answer if the value of a Real variable is no finite number. The other values are still returned: after a failed
    /// step they help debugging.
    #[cold]
    fn no_number(&self, references: &[ValueReference]) -> Answer {
        let mut values =
            references.iter().map(|&reference| (reference, self.memory.variables.real(reference)));
        let not_finite = values.find(|(_, value)| !value.is_finite());
        let message = not_finite.map_or_else(String::new, |(reference, value)| {
            format!("the variable {} is {}", Self::checked(reference).name(), Shown(value))
        });
        // A solver has tried states at which there is no such value; it can try others.
        if self.memory.phase == Phase::ContinuousTimeMode {
            self.log_discarded(format_args!("{message}"));
            Ok(Status::Discard)
        } else {
            Err(Error::new(message))
        }
    }

    /// Gets variables of the types accessed by the functions of Integer (FMI 2.0) or Int32.
    pub(crate) fn get_integers(&mut self, references: &[ValueReference], values: &mut [i32]) -> Answer {
        self.get(references, values, Self::INTEGERS, |variables, reference, value| {
            *value = variables.integer(reference);
            Ok(())
        })
    }

    pub(crate) fn get_boolean<T: From<bool>>(
        &mut self,
        references: &[ValueReference],
        values: &mut [T],
    ) -> Answer {
        self.get(references, values, BOOLEANS, |variables, reference, value| {
            *value = variables.boolean(reference).into();
            Ok(())
        })
    }

    pub(crate) fn get_float32(&mut self, references: &[ValueReference], values: &mut [f32]) -> Answer {
        self.get(references, values, FLOATS, |variables, reference, value| {
            let number = variables.float32(reference);
            if !number.is_finite() {
                let name = Self::checked(reference).name();
                return Err(Error::new(format!("the variable {name} is {}", Shown(number.into()))));
            }
            *value = number;
            Ok(())
        })
    }

    /// Gets variables of an FMI 3.0 integer type other than Int32.
    pub(crate) fn get_wholes<T: Whole>(&mut self, references: &[ValueReference], values: &mut [T]) -> Answer {
        self.get(references, values, T::TYPES, |variables, reference, value| {
            let whole = Self::whole(variables, reference);
            *value = whole.try_into().map_err(|_| Error::new(format!("{whole} is too large")))?;
            Ok(())
        })
    }

    pub(super) fn whole(variables: &M::Variables, reference: ValueReference) -> i128 {
        match Self::checked(reference).data_type {
            DataType::Enumeration => variables.integer(reference).into(),
            _ => variables.whole(reference),
        }
    }

    /// The values stay valid until a variable is set or computed.
    pub(crate) fn get_binary(
        &mut self,
        references: &[ValueReference],
        sizes: &mut [usize],
        values: &mut [*const u8],
    ) -> Answer {
        self.get(references, sizes.iter_mut().zip(values), BINARIES, |variables, reference, (size, value)| {
            let binary = variables.binary(reference);
            (*size, *value) = (binary.len(), binary.as_ptr());
            Ok(())
        })
    }

    pub(crate) fn get_string(&mut self, references: &[ValueReference]) -> Answer {
        let mut strings = vec![CString::default(); references.len()];
        let status = self.get(references, &mut strings, STRINGS, |variables, reference, string| {
            let text = variables.string(reference);
            check_memory(text.len())?;
            *string = CString::new(text).map_err(|_| Error::new("a string with a NUL in it"))?;
            Ok(())
        })?;
        self.strings = strings;
        Ok(status)
    }
}
