//! A file of units, as written.

use fmu_terms::BaseUnit;
use serde::Deserialize;

/// A unit of the units file (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct UnitDeclaration {
    pub(crate) name: String,
    /// Exponents of the SI base units; omitted for a built-in unit, or one without base.
    pub(crate) base: Option<Base>,
    /// From this unit to the base unit.
    #[serde(default = "one")]
    pub(crate) factor: f64,
    #[serde(default)]
    pub(crate) offset: f64,
    #[serde(default)]
    pub(crate) display_units: Vec<DisplayUnitDeclaration>,
}

impl UnitDeclaration {
    /// The unit in SI base units, if the file defines it.
    pub(crate) fn in_base_units(&self) -> Option<BaseUnit> {
        let base = self.base.as_ref()?;
        Some(BaseUnit { exponents: base.exponents(), factor: self.factor, offset: self.offset })
    }
}

/// A display unit: the name of a known unit, or a new one.
#[derive(Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields, expecting = "expected the name of a unit, or an object with a name")]
pub(crate) enum DisplayUnitDeclaration {
    Known(String),
    New {
        name: String,
        /// From the unit to the display unit.
        #[serde(default = "one")]
        factor: f64,
        #[serde(default)]
        offset: f64,
    },
}

impl DisplayUnitDeclaration {
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Known(name) | Self::New { name, .. } => name,
        }
    }
}

/// Exponents of the SI base units.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(non_snake_case, reason = "they are the symbols of SI")]
pub(crate) struct Base {
    kg: i32,
    m: i32,
    s: i32,
    A: i32,
    K: i32,
    mol: i32,
    cd: i32,
    rad: i32,
}

impl Base {
    /// In the order of [`fmu_terms::BASE_UNITS`].
    fn exponents(&self) -> [i32; 8] {
        [self.kg, self.m, self.s, self.A, self.K, self.mol, self.cd, self.rad]
    }
}

fn one() -> f64 {
    1.0
}
