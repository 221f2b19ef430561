//! What calibration tools see of a model: its parameters as a page that they write, and its other variables as
//! measurements that they read, one after the other in cells of eight bytes.
//!
//! A cell holds the little-endian bits of one scalar, at the beginning of the cell if it is shorter: a Real has 8 bytes, an
//! Integer or the value of an Enumeration 4, a Boolean one byte, 0 or 1. Scalars follow each other as in the
//! modelDescription.xml, arrays row by row. Strings, Binaries, clocks and time have no cells. An A2L file, which
//! `cargo fmu a2l` writes, names the cells.

#![allow(clippy::cast_possible_truncation, reason = "a cell begins with the bits of its scalar")]

use core::sync::atomic::{AtomicU32, Ordering};

use fmu_solve::Error;
pub use fmu_terms::CELL;
use fmu_terms::has_cell;

use crate::model::description::{
    Causality, DataType, Refused, ScalarVariable, ValueReference, Variability, VariableDescription,
};
use crate::model::variables::{Described, Variables};

/// The number of cells of a model's parameters: the length of a page.
#[must_use]
pub const fn parameter_cells<V: Described>() -> usize {
    count::<V>(true)
}

/// The number of cells of a model's other variables.
#[must_use]
pub const fn measurement_cells<V: Described>() -> usize {
    count::<V>(false)
}

const fn count<V: Described>(parameters: bool) -> usize {
    let variables = V::DESCRIPTION.variables;
    let (mut cells, mut position) = (0, 0);
    while position < variables.len() {
        if is_among(&variables[position], parameters) {
            cells += variables[position].elements as usize;
        }
        position += 1;
    }
    cells
}

/// Whether a variable has cells among the parameters, or among the others.
const fn is_among(variable: &VariableDescription, parameters: bool) -> bool {
    has_cell(variable.causality, variable.data_type)
        && matches!(variable.causality, Causality::Parameter) == parameters
}

/// The scalars with cells, in their order: parameters, or the others.
fn scalars<V: Described>(parameters: bool) -> impl Iterator<Item = (ValueReference, ScalarVariable)> + Clone {
    V::described().filter(move |(_, variable)| is_among(variable, parameters))
}

/// Cells in memory that a calibration tool reads or writes at any time, by the debugger or a driver. For a `static` with
/// `#[used]` and a name of its own, by which the A2L finds it.
#[derive(Debug)]
#[repr(C, align(8))]
pub struct Cells<const COUNT: usize>([[AtomicU32; 2]; COUNT]);

impl<const COUNT: usize> Cells<COUNT> {
    /// Cells of zeros.
    #[must_use]
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self([const { [AtomicU32::new(0), AtomicU32::new(0)] }; COUNT])
    }

    /// The cells.
    pub fn all(&self) -> impl ExactSizeIterator<Item = u64> + Clone + '_ {
        self.0.iter().map(|[low, high]| {
            let [low, high] = [low, high].map(|half| u64::from(half.load(Ordering::Relaxed)));
            high << 32 | low
        })
    }

    /// Sets cells from a number on; those after the last one are left out.
    pub fn set(&self, first: usize, cells: impl Iterator<Item = u64>) {
        for ([low, high], cell) in self.0.iter().skip(first).zip(cells) {
            low.store(cell as u32, Ordering::Relaxed);
            high.store((cell >> 32) as u32, Ordering::Relaxed);
        }
    }
}

/// Follows the page that a calibration tool writes.
#[derive(Clone, Debug)]
pub struct Follower<const COUNT: usize> {
    /// The page as it was seen last.
    seen: [u64; COUNT],
}

impl<const COUNT: usize> Follower<COUNT> {
    /// One that has seen nothing.
    #[must_use]
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self { seen: [0; COUNT] }
    }

    /// The page, if it has changed since it was asked for last.
    pub fn changed(&mut self, page: &Cells<COUNT>) -> Option<&[u64; COUNT]> {
        let mut is_changed = false;
        for (seen, cell) in self.seen.iter_mut().zip(page.all()) {
            is_changed |= *seen != cell;
            *seen = cell;
        }
        is_changed.then_some(&self.seen)
    }
}

/// The page of the parameters.
pub fn page<V: Variables>(variables: &V) -> impl Iterator<Item = u64> + Clone + '_ {
    scalars::<V>(true).map(|(reference, variable)| cell_of(variables, reference, variable.data_type))
}

/// The cells of the other variables.
pub fn measurements<V: Variables>(variables: &V) -> impl Iterator<Item = u64> + Clone + '_ {
    scalars::<V>(false).map(|(reference, variable)| cell_of(variables, reference, variable.data_type))
}

/// Takes the parameters of a page; `tunable` leaves the fixed ones as they are.
///
/// # Errors
/// When the page has another length, or the first parameter that has not a value of its type and range, or is fixed and has
/// another value in the page. The parameters are then partly those of the page.
pub(crate) fn take_page<V: Variables>(variables: &mut V, page: &[u64], tunable: bool) -> Result<(), Error> {
    let (length, cells) = (page.len(), parameter_cells::<V>());
    if length != cells {
        return Err(Error::new(format_args!("a page of {length} cells for {cells} cells of parameters")));
    }
    for (&cell, (reference, variable)) in page.iter().zip(scalars::<V>(true)) {
        if cell_of(variables, reference, variable.data_type) == stored::<V>(cell, variable.data_type) {
            continue;
        }
        if tunable && variable.variability == Variability::Fixed {
            return Err(Error::new(format_args!(
                "{} is fixed: a change takes effect at the next start",
                variable.name()
            )));
        }
        set(variables, reference, variable, cell)?;
    }
    Ok(())
}

/// The bits of a scalar.
fn cell_of<V: Variables>(variables: &V, reference: ValueReference, data_type: DataType) -> u64 {
    match data_type {
        DataType::Real => variables.real(reference).to_bits(),
        DataType::Float32 => variables.float32(reference).to_bits().into(),
        DataType::Integer | DataType::Enumeration => u64::from(variables.integer(reference).cast_unsigned()),
        DataType::Boolean => variables.boolean(reference).into(),
        _ => significant(variables.whole(reference).cast_unsigned() as u64, data_type),
    }
}

/// The bits of a scalar that is set to the value of a cell.
fn stored<V: Variables>(cell: u64, data_type: DataType) -> u64 {
    match data_type {
        DataType::Real => V::rounded(f64::from_bits(cell)).to_bits(),
        _ => significant(cell, data_type),
    }
}

/// The bits of a cell that its scalar has.
fn significant(cell: u64, data_type: DataType) -> u64 {
    match data_type {
        DataType::Boolean | DataType::Int8 | DataType::UInt8 => cell & 0xFF,
        DataType::Int16 | DataType::UInt16 => cell & 0xFFFF,
        DataType::Float32 | DataType::Integer | DataType::Enumeration | DataType::UInt32 => {
            cell & 0xFFFF_FFFF
        }
        _ => cell,
    }
}

/// The inputs among the scalars with cells.
fn input_scalars<V: Described>() -> impl Iterator<Item = (ValueReference, ScalarVariable)> + Clone {
    scalars::<V>(false).filter(|(_, variable)| variable.causality == Causality::Input)
}

/// The cells of the inputs, in the order of the others.
pub fn inputs<V: Variables>(variables: &V) -> impl Iterator<Item = u64> + Clone + '_ {
    input_scalars::<V>().map(|(reference, variable)| cell_of(variables, reference, variable.data_type))
}

/// Sets the inputs to the values of cells. Reals may be out of their bounds, but not infinite or NaN.
///
/// # Errors
/// The first input that has no value, or not one of its type.
pub fn set_inputs<V: Variables>(
    variables: &mut V,
    mut cells: impl Iterator<Item = u64>,
) -> Result<(), Error> {
    for (reference, variable) in input_scalars::<V>() {
        let name = variable.name();
        let cell = cells.next().ok_or_else(|| Error::new(format_args!("there is no value for {name}")))?;
        match variable.data_type {
            DataType::Real if f64::from_bits(cell).is_finite() => {
                variables.set_real(reference, f64::from_bits(cell));
            }
            _ => set(variables, reference, variable, cell)?,
        }
    }
    Ok(())
}

/// Sets a scalar to the value of a cell.
fn set<V: Variables>(
    variables: &mut V,
    reference: ValueReference,
    variable: ScalarVariable,
    cell: u64,
) -> Result<(), Error> {
    let bits = significant(cell, variable.data_type);
    let value = match variable.data_type {
        DataType::Real => f64::from_bits(bits),
        DataType::Float32 => f32::from_bits(bits as u32).into(),
        data_type => whole(bits, data_type) as f64,
    };
    if variable.data_type == DataType::Boolean && bits > 1 {
        let name = variable.name();
        return Err(Error::new(format_args!("{bits} for the variable {name} is neither 0 nor 1")));
    }
    if !value.is_finite() || !variable.accepts(value) {
        return Err(Error::new(Refused { variable, value }));
    }
    put(variables, reference, variable.data_type, bits);
    Ok(())
}

/// Sets a scalar to the value of its bits.
fn put<V: Variables>(variables: &mut V, reference: ValueReference, data_type: DataType, bits: u64) {
    match data_type {
        DataType::Real => variables.set_real(reference, f64::from_bits(bits)),
        DataType::Float32 => variables.set_float32(reference, f32::from_bits(bits as u32)),
        DataType::Integer | DataType::Enumeration => {
            variables.set_integer(reference, (bits as u32).cast_signed());
        }
        DataType::Boolean => variables.set_boolean(reference, bits != 0),
        _ => variables.set_whole(reference, whole(bits, data_type)),
    }
}

/// The integer that the bits of a type are.
fn whole(bits: u64, data_type: DataType) -> i128 {
    match data_type {
        DataType::Int8 => (bits as u8).cast_signed().into(),
        DataType::Int16 => (bits as u16).cast_signed().into(),
        DataType::Integer | DataType::Enumeration => (bits as u32).cast_signed().into(),
        DataType::Int64 => bits.cast_signed().into(),
        _ => bits.into(),
    }
}
