//! A file of units by itself.

use std::collections::BTreeSet;

use crate::error::Refusals;
use crate::texts::label;
use crate::units::Units;
use crate::units::declaration::{DisplayUnitDeclaration, UnitDeclaration};

pub(crate) fn all(units: &[UnitDeclaration], refusals: &mut Refusals) {
    let mut names = BTreeSet::new();
    let known = Units::new(units);
    for (number, unit) in units.iter().enumerate() {
        let (name, key) = (&unit.name, format!("[{number}]"));
        let mut refuse = |key: String, reason: &str| refusals.add(key, format!("'{name}': {reason}"));
        if !names.insert(name) {
            refuse(format!("{key}.name"), "is declared twice");
        }
        if let Err(reason) = label(name) {
            refuse(format!("{key}.name"), &reason);
        }
        if unit.factor == 0.0 {
            refuse(format!("{key}.factor"), "must not be 0");
        }
        if unit.base.is_none() && (unit.factor.to_bits() != 1.0_f64.to_bits() || unit.offset != 0.0) {
            refuse(key.clone(), "a factor or offset needs a 'base' to refer to");
        }
        let mut display_names = BTreeSet::new();
        for (number, display) in unit.display_units.iter().enumerate() {
            let key = format!("{key}.display_units[{number}]");
            if !display_names.insert(display.name()) {
                refuse(key.clone(), &format!("'{}' is declared twice", display.name()));
            }
            if let Err(reason) = label(display.name()) {
                refuse(key.clone(), &reason);
            }
            if let DisplayUnitDeclaration::New { factor: 0.0, .. } = display {
                refuse(format!("{key}.factor"), "must not be 0");
            }
        }
        refusals.require(format!("{key}.display_units"), known.find(name).map(drop));
    }
}
