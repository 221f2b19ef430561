//! The variables of an FMU, of which there may be hundreds of thousands, found by name or value reference.

use std::ops::Deref;

use crate::variable::FmuVariable;

/// Variables, a slice in file order.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    variables: Vec<FmuVariable>,
    /// The variables' positions in the order of their names, those of one name in file order.
    by_name: Vec<usize>,
    /// The variables' positions in the order of their value references, those of one reference in file order.
    by_reference: Vec<usize>,
}

impl Variables {
    /// The first variable of a name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<&FmuVariable> {
        let first = self.by_name.partition_point(|position| self.variables[*position].name.as_str() < name);
        let found = &self.variables[*self.by_name.get(first)?];
        (found.name == name).then_some(found)
    }

    /// The variables with a value reference, in file order.
    pub fn with_reference(&self, reference: u32) -> impl Iterator<Item = &FmuVariable> {
        let of = |position: &usize| self.variables[*position].value_reference.meaning();
        let begin = self.by_reference.partition_point(|position| of(position) < Some(reference));
        let end = self.by_reference.partition_point(|position| of(position) <= Some(reference));
        self.by_reference[begin..end].iter().map(|position| &self.variables[*position])
    }
}

impl From<Vec<FmuVariable>> for Variables {
    fn from(variables: Vec<FmuVariable>) -> Self {
        let mut by_name: Vec<_> = (0..variables.len()).collect();
        let mut by_reference = by_name.clone();
        // Both sorts are stable.
        by_name.sort_by_key(|position| variables[*position].name.as_str());
        by_reference.sort_by_key(|position| variables[*position].value_reference.meaning());
        Self { variables, by_name, by_reference }
    }
}

impl Deref for Variables {
    type Target = [FmuVariable];

    fn deref(&self) -> &[FmuVariable] {
        &self.variables
    }
}

impl<'a> IntoIterator for &'a Variables {
    type Item = &'a FmuVariable;
    type IntoIter = std::slice::Iter<'a, FmuVariable>;

    fn into_iter(self) -> Self::IntoIter {
        self.variables.iter()
    }
}
