//! Which elements of a variable depend on which of others (FMI 3.0.2, section 2.2.9).

use std::collections::BTreeMap;

use fmu_solve::Error;

use super::Instance;
use crate::kinds::Model;
use crate::model::description::{Dependencies, ValueReference};
use crate::model::variables::Described as _;

/// `fmi3Dependent`: nothing more is known about a dependency.
pub(crate) const DEPENDENT: i32 = 5;

/// A dependency of an element on an element of another variable, both counted from 1; 0 is all elements.
pub(crate) struct Dependency {
    pub(crate) element: usize,
    pub(crate) independent: ValueReference,
    pub(crate) element_of_independent: usize,
}

impl<M: Model> Instance<M> {
    /// The dependencies of a variable; until initialization ends, those of its initial value.
    pub(crate) fn dependencies(&self, dependent: ValueReference) -> Result<Vec<Dependency>, Error> {
        if !Self::DESCRIPTION.capabilities.per_element_dependencies {
            return Err(Error::new("not supported by this FMU (providesPerElementDependencies is false)"));
        }
        let unknowns = Self::elements(dependent)?;
        let variable = Self::checked(dependent);
        if !self.roles(&variable).unknown {
            return Err(Error::new(format!("{} has no dependencies", variable.name())));
        }
        let declared = if self.is_before_steps() {
            M::Variables::INITIAL_DEPENDENCIES
        } else {
            M::Variables::DEPENDENCIES
        };
        let declared: BTreeMap<_, Vec<_>> = declared
            .iter()
            .flat_map(Dependencies::each)
            .filter(|(unknown, _)| Self::checked(*unknown).value_reference == dependent)
            .map(|(unknown, knowns)| (unknown, knowns.collect()))
            .collect();
        let mut dependencies = Vec::new();
        for (unknown, element) in unknowns.zip(1..) {
            if let Some(knowns) = declared.get(&unknown) {
                dependencies.extend(knowns.iter().map(|&known| {
                    let known = Self::checked(known);
                    let element_of_independent = known.element + 1;
                    Dependency { element, independent: known.value_reference, element_of_independent }
                }));
            } else {
                // It may depend on everything.
                let knowns = Self::DESCRIPTION.variables.iter().filter(|known| self.roles(known).known);
                dependencies.extend(knowns.map(|known| Dependency {
                    element,
                    independent: known.value_reference,
                    element_of_independent: 0,
                }));
            }
        }
        Ok(dependencies)
    }
}
