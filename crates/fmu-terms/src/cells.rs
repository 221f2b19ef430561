//! The cells in which calibration tools see the variables of a model that runs without an operating system.

use crate::{Causality, DataType};

/// The bytes of a cell, which has one scalar.
pub const CELL: usize = 8;

/// Whether scalars of a causality and a type have cells.
#[must_use]
pub const fn has_cell(causality: Causality, data_type: DataType) -> bool {
    !matches!(causality, Causality::Independent | Causality::StructuralParameter)
        && !matches!(data_type, DataType::String | DataType::Binary | DataType::Clock)
}
