//! Whether a model's equations set what is calculated, all of it, and nothing else.

use crate::description::{DataType, ValueReference, Variability, VariableDescription};
use crate::error::Error;
use crate::model::Variables;

/// Evaluates twice, with different values in the place of what is calculated. After that these are equal, but for discrete
/// ones that are left as they were, which events may set, or the model's preparation; and everything else is as it was.
///
/// # Errors
/// The first variable that is not set, or that is changed and must not be.
pub(crate) fn check_evaluation<V: Variables>(variables: &V, evaluate: impl Fn(&mut V)) -> Result<(), Error> {
    let marked = [false, true].map(|mark| {
        let mut marked = variables.clone();
        marked.mark_calculated(mark);
        marked
    });
    let evaluated = marked.clone().map(|mut variables| {
        evaluate(&mut variables);
        variables
    });
    let mut follows = None;
    for (reference, variable) in V::described() {
        let differ = |[one, other]: [&V; 2]| !are_equal(one, other, reference, variable.data_type);
        let is_calculated = differ(marked.each_ref());
        let is_left = marked.iter().zip(&evaluated).all(|(marked, evaluated)| !differ([marked, evaluated]));
        let may_be_left = variable.variability == Variability::Discrete;
        if is_calculated && differ(evaluated.each_ref()) && !(is_left && may_be_left) {
            // What is left is the cause of others, which are made of it.
            follows = follows.filter(|_| !is_left).or(Some(variable));
            if is_left {
                break;
            }
        }
        if !is_calculated && differ([variables, &evaluated[0]]) {
            return Err(Error::new(format!(
                "`evaluate` changes {} ({}, {}), which it may only read",
                variable.name, variable.causality, variable.variability
            )));
        }
    }
    follows.map_or(Ok(()), |variable| {
        Err(Error::new(format!(
            "`evaluate` does not set {}, or makes it of what it was before",
            variable.name
        )))
    })
}

/// The first discrete variable that differs.
pub(crate) fn first_discrete_difference<V: Variables>(
    one: &V,
    other: &V,
) -> Option<&'static VariableDescription> {
    let mut discrete = V::described().filter(|(_, variable)| variable.variability == Variability::Discrete);
    discrete
        .find(|&(reference, variable)| !are_equal(one, other, reference, variable.data_type))
        .map(|(_, variable)| variable)
}

/// Whether a variable has the same value in both.
fn are_equal<V: Variables>(one: &V, other: &V, reference: ValueReference, data_type: DataType) -> bool {
    match data_type {
        DataType::Real => one.real(reference).to_bits() == other.real(reference).to_bits(),
        DataType::Float32 => one.float32(reference).to_bits() == other.float32(reference).to_bits(),
        DataType::Integer | DataType::Enumeration => one.integer(reference) == other.integer(reference),
        DataType::Boolean => one.boolean(reference) == other.boolean(reference),
        DataType::String => one.string(reference) == other.string(reference),
        DataType::Binary => one.binary(reference) == other.binary(reference),
        DataType::Clock => true,
        _ => one.whole(reference) == other.whole(reference),
    }
}
