//! Checks the dependencies in a model's JSON against its equations.

use std::collections::{BTreeMap, BTreeSet};

use crate::description::{DataType, Dependencies, Name, ValueReference};
use crate::error::Error;
use crate::model::Model;
use crate::number::Dual;
use crate::variables::Variables;

/// The number of points at which derivatives are evaluated.
const POINTS: u64 = 20;

/// Tests that a model's Real outputs and derivatives depend on no inputs and states but those in its JSON (`reads`).
/// Importers find algebraic loops by these dependencies, and miss undeclared ones.
///
/// Evaluates [`Model::differentiate`] around the values of `variables`: inputs and states shifted by up to their
/// nominal values or magnitudes. Dependencies that are zero at all points go unnoticed.
///
/// # Errors
/// The first undeclared dependency, or a model without derivatives.
pub fn check_dependencies<M: Model>(variables: &M::Variables) -> Result<(), Error> {
    let mut model = M::default();
    model.take_parameters(variables);
    let reals = M::Variables::described().filter(|(_, variable)| {
        variable.data_type == DataType::Real
            && (variable.real_input().is_some() || variable.state().is_some())
    });
    let knowns: Vec<_> = reals.map(|(reference, _)| reference).collect();
    let declared = M::Variables::DEPENDENCIES.iter().flat_map(Dependencies::each);
    let is_state =
        |unknown| M::Variables::description(unknown).is_some_and(|unknown| unknown.state().is_some());
    let declared: BTreeMap<_, BTreeSet<_>> = declared
        .filter(|(unknown, _)| !is_state(*unknown))
        .map(|(unknown, knowns)| (unknown, knowns.collect()))
        .collect();
    for point in 0..POINTS {
        let mut variables = variables.clone();
        for (number, &known) in knowns.iter().enumerate() {
            let value = variables.real(known);
            // A low-discrepancy sequence between 0 and 1: fractional parts of multiples of the golden ratio.
            let share =
                (0.618_033_988_749_895 * (point * knowns.len() as u64 + number as u64) as f64).fract();
            variables.set_real(known, value + share * if value == 0.0 { 1.0 } else { 0.1 * value });
        }
        variables.states_from_start();
        for &known in &knowns {
            let mut direction = M::Variables::zero();
            direction.set_real(known, 1.0);
            let derivatives =
                model.differentiate(Dual::default(), &variables, variables.inputs(), &direction)?;
            for (&unknown, declared) in &declared {
                if derivatives.real(unknown) != 0.0 && !declared.contains(&known) {
                    return Err(Error::new(format!(
                        "{} depends on {}, which its 'reads' omit",
                        name::<M>(unknown),
                        name::<M>(known)
                    )));
                }
            }
        }
    }
    Ok(())
}

fn name<M: Model>(reference: ValueReference) -> Name {
    M::Variables::description(reference).expect("it is declared").name()
}
