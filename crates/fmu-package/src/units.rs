//! Units in descriptions of FMUs and systems.

use std::io;

use fmu_terms::{BASE_UNITS, BaseUnit, DisplayUnit, Linear, Unit, UnitTable, spelled};
use fmu_xml::{XmlWriter, base_unit, element, empty};

use crate::xml::{Element, children, number, text};

/// Reads the units of a list.
pub(crate) fn read<'d>(units: impl Iterator<Item = Element<'d>>) -> io::Result<Vec<Unit>> {
    units.map(read_unit).collect()
}

fn read_unit(element: Element<'_>) -> io::Result<Unit> {
    let mut unit = Unit::undefined(&text(element, "name"));
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

/// A unit among declared ones and their display units.
pub(crate) fn find(name: &str, declared: &[Unit]) -> Option<Unit> {
    let shown = || declared.iter().flat_map(Unit::with_display_units).find(|unit| unit.name == name);
    declared.iter().find(|unit| unit.name == name).cloned().or_else(shown)
}

/// Whether a unit is among declared ones, or in the [table](UnitTable).
#[must_use]
pub fn is_known_unit(name: &str, declared: &[Unit]) -> bool {
    find(name, declared).is_some() || UnitTable::default().base(&spelled(name)).is_ok()
}

/// The conversion between two units, each with those declared beside it. A unit that is not defined there is one
/// of the other's, or of the [table](UnitTable). Where the dimensions differ, `1/min`, `min-1`, `rev/min` and `rpm` are an
/// angular velocity beside a unit with rad, and a frequency beside one without.
///
/// # Errors
/// When a unit is not known, or does not convert.
pub fn unit_conversion(from: (&str, &[Unit]), to: (&str, &[Unit])) -> Result<Linear, String> {
    let base = |name: &str, declared: [&[Unit]; 2]| {
        let defined = declared.into_iter().find_map(|units| find(name, units)?.base);
        defined.map_or_else(|| UnitTable::default().base(&spelled(name)), |base| Ok(Some(base)))
    };
    let refusal = || format!("the unit {} does not convert to {}", from.0, to.0);
    match (base(from.0, [from.1, to.1]), base(to.0, [to.1, from.1])) {
        (Ok(Some(own)), Ok(Some(other))) => {
            let meanings = |name: &str, declared| {
                let of_revolutions = BaseUnit::of_revolutions(name).into_iter().flatten();
                std::iter::once(declared).chain(of_revolutions).collect::<Vec<_>>()
            };
            let [own, other] = [(from.0, own), (to.0, other)].map(|(name, base)| meanings(name, base));
            let mut pairs = own.iter().flat_map(|own| other.iter().map(move |other| own.to(other)));
            pairs.find_map(|conversion| conversion).ok_or_else(refusal)
        }
        // Equal names count as equal units.
        _ if from.0 == to.0 => Ok(Linear::IDENTITY),
        (Err(reason), _) | (_, Err(reason)) => Err(reason),
        _ => Err(refusal()),
    }
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
                empty(writer, "ssc:BaseUnit", base_unit(base.powers(), base.factor, base.offset))
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// This holds whatever other units an FMU declares.
    #[test]
    fn revolutions_per_minute_are_what_the_other_unit_measures() {
        let declared = |name: &str, exponents, factor| Unit {
            name: name.to_owned(),
            base: Some(BaseUnit { exponents, factor, offset: 0.0 }),
            display_units: vec![],
        };
        // As Dymola and others declare them.
        let frequency = declared("1/min", [0, 0, -1, 0, 0, 0, 0, 0], 1.0 / 60.0);
        let angular = declared("rpm", [0, 0, -1, 0, 0, 0, 0, 1], TAU / 60.0);
        for units in [&[][..], std::slice::from_ref(&frequency), &[frequency.clone(), angular]] {
            for name in ["1/min", "min-1", "min⁻¹", "rev/min", "rpm"] {
                for (other, factor) in [
                    ("rad/s", TAU / 60.0),
                    ("deg/s", 6.0),
                    ("rpm", 1.0),
                    ("1/s", 1.0 / 60.0),
                    ("Hz", 1.0 / 60.0),
                ] {
                    for (from, to, factor) in [(name, other, factor), (other, name, factor.recip())] {
                        let found = unit_conversion((from, units), (to, &[])).unwrap();
                        assert!(
                            (found.factor / factor - 1.0).abs() < 4.0 * f64::EPSILON,
                            "{from} {to}: {found:?}"
                        );
                        assert_eq!(found.offset.to_bits(), 0.0_f64.to_bits());
                    }
                }
            }
        }
        for (from, to) in [("1/s", "rad/s"), ("1/min", "K"), ("Hz", "deg/s")] {
            let refusal = unit_conversion((from, &[]), (to, &[])).unwrap_err();
            assert_eq!(refusal, format!("the unit {from} does not convert to {to}"));
        }
    }
}
