//! The course of an input: a signal, or measured data, which the input's type and unit explain.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use fmu_package::{FmuDescription, FmuVariable, Linear, ValueType};
use fmu_record::{Cell, Data, as_number, as_truth};
use fmu_terms::DataType;

use super::Signal;

/// What an input does over time.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// A signal in the unit that the FMU declares.
    Signal(Signal),
    /// Measured data.
    Measured(Measured),
}

/// A column of measured data.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    file: PathBuf,
    /// The data, with one column.
    data: Data,
    /// Whether each value holds until the next row, even of a continuous input.
    hold: bool,
}

impl From<Signal> for Course {
    fn from(signal: Signal) -> Self {
        Self::Signal(signal)
    }
}

impl Course {
    /// The signal for an input, converted to its unit. A discrete one keeps each value until the next row. The
    /// conversion is that of the connection, from the signal's value to the input's.
    ///
    /// # Errors
    /// When measured data have another unit, or a cell that is no value of the input; the message names file and line.
    pub fn fit(&self, input: &FmuVariable, fmu: &FmuDescription, conversion: Linear) -> Result<Signal> {
        match self {
            Self::Signal(signal) => Ok(signal.clone()),
            Self::Measured(measured) => measured.fit(input, fmu, conversion),
        }
    }

    /// The signal without an input, as its numbers are.
    ///
    /// # Errors
    /// When a cell of measured data is not a number.
    pub fn plain(&self) -> Result<Signal> {
        let real = FmuVariable { data_type: DataType::Real.into(), ..FmuVariable::default() };
        self.fit(&real, &FmuDescription::default(), Linear::IDENTITY)
    }
}

impl Measured {
    /// A column of data from a file.
    ///
    /// # Errors
    /// When there is no column of this name.
    pub fn new(file: &Path, data: &Data, column: &str, hold: bool) -> Result<Self> {
        let data = data.only(column).with_context(|| cannot_read(file))?;
        Ok(Self { file: file.to_owned(), data, hold })
    }

    fn fit(&self, input: &FmuVariable, fmu: &FmuDescription, conversion: Linear) -> Result<Signal> {
        let values = self.values(input, fmu, conversion).with_context(|| cannot_read(&self.file))?;
        let points = self.data.time().iter().copied().zip(values).collect();
        Ok(if self.hold || input.is_discrete() { Signal::Steps(points) } else { Signal::Lines(points) })
    }

    fn values(&self, input: &FmuVariable, fmu: &FmuDescription, conversion: Linear) -> Result<Vec<f64>> {
        let column = &self.data.columns()[0];
        let mut values = self.data.values(column, |cell| value(cell, input, fmu), &expected(input, fmu))?;
        if !column.unit().is_empty() {
            let to_input = input.conversion_from(column.unit(), fmu);
            let to_input = to_input.map_err(|reason| anyhow!("{}: {reason}", column.name()))?;
            // The connection's conversion follows.
            for function in [to_input, conversion.inverse()].into_iter().filter(|it| *it != Linear::IDENTITY)
            {
                for value in &mut values {
                    *value = function.apply(*value);
                }
            }
        }
        Ok(values)
    }
}

fn cannot_read(file: &Path) -> String {
    format!("cannot read {}", file.display())
}

/// The value of an input that a cell means.
#[allow(clippy::float_cmp)] // whole numbers
fn value(cell: Cell<'_>, input: &FmuVariable, fmu: &FmuDescription) -> Option<f64> {
    match input.value_type() {
        ValueType::Real => as_number(cell),
        ValueType::Integer => as_number(cell).filter(|number| number.fract() == 0.0),
        ValueType::Boolean => as_truth(cell),
        ValueType::Enumeration => {
            let is_meant = |(name, number): &&(String, i32)| match cell {
                Cell::Number(wanted) => f64::from(*number) == wanted,
                Cell::Word(wanted) => name == wanted,
            };
            items(input, fmu).iter().find(is_meant).map(|(_, number)| f64::from(*number))
        }
        ValueType::String | ValueType::Other => None,
    }
}

/// What the cells for an input are.
fn expected(input: &FmuVariable, fmu: &FmuDescription) -> String {
    match input.value_type() {
        ValueType::Real => "a number".to_owned(),
        ValueType::Integer => "a whole number".to_owned(),
        ValueType::Boolean => "0, 1, true or false".to_owned(),
        ValueType::Enumeration => {
            let items = items(input, fmu).iter().map(|(name, number)| format!("{name} ({number})"));
            format!("one of {}", items.collect::<Vec<_>>().join(", "))
        }
        ValueType::String | ValueType::Other => format!("no column, as it is a {}", input.data_type),
    }
}

/// The items of an enumeration.
fn items<'a>(input: &FmuVariable, fmu: &'a FmuDescription) -> &'a [(String, i32)] {
    fmu.enumeration(&input.declared_type).map_or(&[], |known| &known.items)
}
