//! Whether the dependencies that a model's JSON declares are those of its equations.

use crate::description::{DataType, ValueReference};
use crate::error::Error;
use crate::model::{Model, Variables};
use crate::number::Dual;

/// At how many points the derivatives are looked at.
const POINTS: u64 = 20;

/// Checks, for a test of a model, that its Real outputs and derivatives depend on no other inputs and states than its
/// JSON says (`reads`). Importers find algebraic loops by these dependencies, and miss those that are not declared.
///
/// The derivatives of [`Model::differentiate`] are looked at in points around the values of `variables`: the inputs and
/// states are shifted by up to their nominal values or magnitudes. What is zero in all of them is not seen.
///
/// # Errors
/// The first dependency that is not declared, or that the model has no derivatives.
pub fn check_dependencies<M: Model>(variables: &M::Variables) -> Result<(), Error> {
    let model = M::default();
    let reals = M::Variables::described().filter(|(_, variable)| {
        variable.data_type == DataType::Real && (variable.real_input.is_some() || variable.state.is_some())
    });
    let knowns: Vec<_> = reals.map(|(reference, _)| reference).collect();
    for point in 0..POINTS {
        let mut variables = variables.clone();
        for (number, &known) in knowns.iter().enumerate() {
            let value = variables.real(known);
            // Numbers between 0 and 1 that repeat late: the fractions of multiples of the golden ratio.
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
            for &(unknown, declared) in M::Variables::DEPENDENCIES {
                let is_state =
                    M::Variables::description(unknown).is_some_and(|unknown| unknown.state.is_some());
                if !is_state && derivatives.real(unknown) != 0.0 && !declared.contains(&known) {
                    return Err(Error::new(format!(
                        "{} depends on {}, which its 'reads' leave out",
                        name::<M>(unknown),
                        name::<M>(known)
                    )));
                }
            }
        }
    }
    Ok(())
}

fn name<M: Model>(reference: ValueReference) -> &'static str {
    M::Variables::description(reference).map_or("", |variable| variable.name)
}
