//! Checks that a model's equations set every calculated variable, and nothing else.

use fmu_solve::Error;

use crate::model::description::{DataType, ScalarVariable, ValueReference, Variability};
use crate::model::variables::Variables;

/// Evaluates twice from different values of the calculated variables. The results must be equal, except for discrete
/// variables that it does not set, which events or the model's preparation may set. Everything else must be unchanged.
///
/// # Errors
/// The first variable that is not set, or changed but read-only.
pub(crate) fn check_evaluation<V: Variables>(variables: &V, evaluate: &dyn Fn(&mut V)) -> Result<(), Error> {
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
            // A variable that was not set is the cause; others are computed from it.
            follows = follows.filter(|_| !is_left).or(Some(variable));
            if is_left {
                break;
            }
        }
        if !is_calculated && differ([variables, &evaluated[0]]) {
            let way = match variable.variability {
                Variability::Constant => "it is its `start`",
                _ => "set it in `event`",
            };
            return Err(Error::new(format!(
                "`evaluate` changes {} ({}, {}), which it may only read: {way}",
                variable.name(),
                variable.causality,
                variable.variability
            )));
        }
    }
    follows.map_or(Ok(()), |variable| {
        Err(Error::new(format!(
            "`evaluate` does not set {}, or computes it from its previous value",
            variable.name()
        )))
    })
}

/// Calculates the calculated parameters twice from different values. Both results must equal the present values.
///
/// # Errors
/// The first that is not set, or that another hook set.
pub(crate) fn check_calculated_parameters<V: Variables>(
    variables: &V,
    calculate: impl Fn(&mut V),
) -> Result<(), Error> {
    if !V::HAS_CALCULATED_PARAMETERS {
        return Ok(());
    }
    let [one, other] = [false, true].map(|mark| {
        let mut calculated = variables.clone();
        calculated.mark_calculated_parameters(mark);
        calculate(&mut calculated);
        calculated
    });
    for (reference, variable) in V::described() {
        let fault = if !are_equal(&one, &other, reference, variable.data_type) {
            "`calculate_parameters` does not set it, or computes it from its previous value"
        } else if !are_equal(variables, &one, reference, variable.data_type) {
            "another hook changes it after `calculate_parameters`, which alone sets it"
        } else {
            continue;
        };
        return Err(Error::new(format!(
            "{} ({}, {}): {fault}",
            variable.name(),
            variable.causality,
            variable.variability
        )));
    }
    Ok(())
}

/// The first discrete variable with different values.
pub(crate) fn first_discrete_difference<V: Variables>(one: &V, other: &V) -> Option<ScalarVariable> {
    let mut discrete = V::described().filter(|(_, variable)| variable.variability == Variability::Discrete);
    discrete
        .find(|&(reference, variable)| !are_equal(one, other, reference, variable.data_type))
        .map(|(_, variable)| variable)
}

/// Whether a variable has equal values in two sets of variables.
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
