//! The units that a model may use.

pub(crate) mod declaration;

use std::collections::BTreeMap;

use fmu_terms::{BaseUnit, DisplayUnit, Unit, UnitTable};

use crate::names;
use declaration::{DisplayUnitDeclaration, UnitDeclaration};

/// The units of the model's file, and the built-in ones.
pub(crate) struct Units<'a> {
    declared: &'a [UnitDeclaration],
    /// The positions of the declared units, by name.
    names: BTreeMap<&'a str, usize>,
    table: UnitTable<'a>,
}

impl<'a> Units<'a> {
    pub(crate) fn new(declared: &'a [UnitDeclaration]) -> Self {
        // The first of several with the same name.
        let first = || declared.iter().enumerate().rev();
        let names = first().map(|(position, unit)| (unit.name.as_str(), position)).collect();
        let table = UnitTable::with(
            first().filter_map(|(_, unit)| Some((unit.name.as_str(), unit.in_base_units()?))),
        );
        Self { declared, names, table }
    }

    /// The position of a unit in the file.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    /// A unit by name, with the display units declared in the file.
    pub(crate) fn find(&self, name: &str) -> Result<Unit, String> {
        let declared = self.position(name).map(|position| &self.declared[position]);
        let base = match (self.base(name), declared) {
            (Ok(base), _) => base,
            (Err(_), Some(_)) => None,
            (Err(reason), None) => return Err(reason),
        };
        let shown = declared.map_or(&[][..], |declared| &declared.display_units);
        let shown = shown.iter().map(|display| match display {
            DisplayUnitDeclaration::Known(display) => self.display_unit(name, display),
            DisplayUnitDeclaration::New { name, factor, offset } => {
                Ok(DisplayUnit { name: name.clone(), factor: *factor, offset: *offset })
            }
        });
        Ok(Unit { name: name.to_owned(), base, display_units: shown.collect::<Result<_, _>>()? })
    }

    /// The conversion from a unit to another of the same dimension.
    pub(crate) fn display_unit(&self, unit: &str, display: &str) -> Result<DisplayUnit, String> {
        names::length(display)?;
        self.table.display_unit(unit, display)
    }

    fn base(&self, name: &str) -> Result<Option<BaseUnit>, String> {
        if self.position(name).is_none() {
            names::length(name)?;
        }
        self.table.base(name)
    }
}
