//! What calibration tools see of a model that runs without an operating system: each parameter, and each other variable, in
//! a cell of eight bytes, as the module `calibration` of fmu-export fills them.

pub(crate) mod a2l;

use fmu_terms::{CELL, Causality, DataType, has_cell};

use crate::model::{Model, Scalar, Variable};
use crate::start::Start;

/// A variable with the number of its first cell.
pub(crate) struct Cells<'m> {
    pub(crate) variable: Variable<'m>,
    pub(crate) first: usize,
}

impl Cells<'_> {
    /// The distance of the first cell from the beginning, in bytes.
    fn offset(&self) -> usize {
        CELL * self.first
    }
}

/// The variables with cells: the parameters, and the others.
pub(crate) fn cells<'m>(model: &'m Model<'_>) -> [Vec<Cells<'m>>; 2] {
    let mut variables = model.variables();
    variables.sort_by_key(|variable| model.scalars[variable.positions[0]].value_reference);
    let (mut parameters, mut measurements) = (vec![], vec![]);
    let mut counts = [0; 2];
    for variable in variables {
        let scalar = &model.scalars[variable.positions[0]];
        if !has_cell(scalar.causality, scalar.data_type.data_type()) {
            continue;
        }
        let is_parameter = scalar.causality == Causality::Parameter;
        let count = &mut counts[usize::from(!is_parameter)];
        let list = if is_parameter { &mut parameters } else { &mut measurements };
        let first = *count;
        *count += variable.positions.len();
        list.push(Cells { variable, first });
    }
    [parameters, measurements]
}

/// The page of the parameters' start values.
pub(crate) fn start_page(model: &Model<'_>, parameters: &[Cells<'_>]) -> Vec<u8> {
    let scalars = parameters.iter().flat_map(|cells| &cells.variable.positions);
    scalars.flat_map(|&position| bits(&model.scalars[position]).to_le_bytes()).collect()
}

/// The bits of a scalar's start value.
#[allow(clippy::cast_possible_truncation, reason = "a value is one of its type")]
fn bits(scalar: &Scalar) -> u64 {
    match (&scalar.start, scalar.data_type.data_type()) {
        (Some(Start::Real(value)), DataType::Float32) => (*value as f32).to_bits().into(),
        (Some(Start::Real(value)), _) => value.to_bits(),
        (Some(Start::Integer(value)), _) => value.cast_unsigned() as u64,
        (Some(Start::Boolean(value)), _) => (*value).into(),
        (Some(Start::Item { value, .. }), _) => value.cast_unsigned().into(),
        (Some(Start::String(_) | Start::Binary(_)) | None, _) => 0,
    }
}
