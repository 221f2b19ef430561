//! Units in descriptions of FMUs and systems.

use std::io;

use fmu_terms::{BASE_UNITS, BaseUnit, DisplayUnit, Unit};
use fmu_xml::{XmlWriter, conversion, element, empty};

use crate::xml::{Element, children, number, text};

/// Reads the units of a list.
pub(crate) fn read<'d>(units: impl Iterator<Item = Element<'d>>) -> io::Result<Vec<Unit>> {
    units.map(read_unit).collect()
}

fn read_unit(element: Element<'_>) -> io::Result<Unit> {
    let mut unit = Unit { name: text(element, "name"), base: None, display_units: vec![] };
    for child in children(element) {
        let value = |name, default| Ok::<_, io::Error>(number(child, name)?.unwrap_or(default));
        let offset = value("offset", 0.0)?;
        match child.tag_name().name() {
            "BaseUnit" => {
                let mut exponents = [0; BASE_UNITS.len()];
                for (name, exponent) in BASE_UNITS.into_iter().zip(&mut exponents) {
                    *exponent = number(child, name)?.unwrap_or(0);
                }
                unit.base = Some(BaseUnit { exponents, factor: value("factor", 1.0)?, offset });
            }
            "DisplayUnit" => {
                let (name, factor) = (text(child, "name"), value("factor", 1.0)?);
                unit.display_units.push(DisplayUnit { name, factor, offset });
            }
            _ => {}
        }
    }
    Ok(unit)
}

/// Writes the list of units in SSP files: only those defined in SI base units, as SSP has no others.
pub(crate) fn write(writer: &mut XmlWriter, list: &'static str, units: &[Unit]) -> io::Result<()> {
    let known: Vec<_> = units.iter().filter_map(|unit| unit.base.map(|base| (unit, base))).collect();
    if known.is_empty() {
        return Ok(());
    }
    element(writer, list, vec![], |writer| {
        known.iter().try_for_each(|(unit, base)| {
            element(writer, "ssc:Unit", vec![("name", unit.name.clone())], |writer| {
                let powers = base.powers().map(|(name, exponent)| (name, exponent.to_string()));
                empty(writer, "ssc:BaseUnit", powers.chain(conversion(base.factor, base.offset)).collect())
            })
        })
    })
}
