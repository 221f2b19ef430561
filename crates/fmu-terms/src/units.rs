//! Units as defined by FMI 2.0 (section 2.2.2) and SSP 1.0 (section 4.4.4), and conversions between them.

mod notation;
mod symbols;
mod table;

use core::f64::consts::TAU;

pub use self::notation::{per_second, spelled};
pub use self::table::UnitTable;

/// The SI base units and rad, in the order of [`BaseUnit::exponents`].
pub const BASE_UNITS: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// The names of revolutions per minute.
const REVOLUTIONS_PER_MINUTE: [&str; 4] = ["rpm", "rev/min", "1/min", "min-1"];

/// A unit with its definition in SI units, if known.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// The name used by variables.
    pub name: String,
    /// The unit in SI base units.
    pub base: Option<BaseUnit>,
    /// The unit's display units.
    pub display_units: Vec<DisplayUnit>,
}

impl Unit {
    /// A unit of which only the name is known.
    #[must_use]
    pub fn undefined(name: &str) -> Self {
        Self { name: name.to_owned(), base: None, display_units: vec![] }
    }
}

/// A unit in SI base units: value in them = factor · value in the unit + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// The exponents of kg, m, s, A, K, mol, cd and rad.
    pub exponents: [i32; BASE_UNITS.len()],
    /// The factor from the unit to SI base units.
    pub factor: f64,
    /// The offset in SI base units.
    pub offset: f64,
}

/// A display unit: value in it = factor · value in the unit + offset.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct DisplayUnit {
    /// The name used by variables.
    pub name: String,
    /// The factor from the unit to the display unit.
    pub factor: f64,
    /// The offset in the display unit.
    pub offset: f64,
}

/// A linear function of a value: factor · value + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// The factor of the value.
    pub factor: f64,
    /// The constant term.
    pub offset: f64,
}

impl BaseUnit {
    /// The exponents other than 0, with the base units' names.
    pub fn powers(&self) -> impl Iterator<Item = (&'static str, i32)> + use<> {
        BASE_UNITS.into_iter().zip(self.exponents).filter(|(_, exponent)| *exponent != 0)
    }

    /// The two meanings of a name of revolutions per minute: an angular velocity, 2π/60 rad/s, and a frequency, 1/60 per
    /// s; none for other names.
    #[must_use]
    pub fn of_revolutions(name: &str) -> Option<[Self; 2]> {
        let name = spelled(name);
        let is_known = REVOLUTIONS_PER_MINUTE.contains(&name.as_str());
        let exponents = |rad| [0, 0, -1, 0, 0, 0, 0, rad];
        is_known.then(|| {
            [(1, TAU / 60.0), (0, 60_f64.recip())].map(|(rad, factor)| Self {
                exponents: exponents(rad),
                factor,
                offset: 0.0,
            })
        })
    }

    /// The conversion to another unit; none if the dimensions differ.
    #[must_use]
    pub fn to(&self, other: &Self) -> Option<Linear> {
        (self.exponents == other.exponents).then(|| {
            let factor = self.factor / other.factor;
            Linear { factor, offset: (self.offset - other.offset) / other.factor }
        })
    }
}

impl Unit {
    /// This unit and its display units, as units.
    pub fn with_display_units(&self) -> impl Iterator<Item = Self> + '_ {
        let shown = self.display_units.iter().map(|display| {
            // base = f·u + o and shown = g·u + p, hence base = (f/g)·shown + o − (f/g)·p.
            let base = self.base.map(|base| {
                let factor = rounded(base.factor / display.factor);
                BaseUnit { factor, offset: base.offset - factor * display.offset, ..base }
            });
            Self { name: display.name.clone(), base, display_units: vec![] }
        });
        core::iter::once(self.clone()).chain(shown)
    }
}

impl Linear {
    /// The identity.
    pub const IDENTITY: Self = Self { factor: 1.0, offset: 0.0 };

    /// The value of the function.
    #[must_use]
    pub fn apply(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }

    /// This function followed by another one.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        Self { factor: next.factor * self.factor, offset: next.factor * self.offset + next.offset }
    }

    /// The inverse function.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self { factor: self.factor.recip(), offset: -self.offset / self.factor }
    }
}

/// A number rounded to 15 digits: the reciprocal of 1e-5, inexact in doubles, becomes 100000.
fn rounded(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(name: &str, exponents: [i32; 8], factor: f64, offset: f64) -> Unit {
        Unit {
            name: name.to_owned(),
            base: Some(BaseUnit { exponents, factor, offset }),
            display_units: vec![],
        }
    }

    #[test]
    fn conversions_are_those_of_the_units() {
        let temperature = [0, 0, 0, 0, 1, 0, 0, 0];
        let kelvin = unit("K", temperature, 1.0, 0.0).base.unwrap();
        let celsius = unit("degC", temperature, 1.0, 273.15).base.unwrap();
        let fahrenheit = unit("degF", temperature, 5.0 / 9.0, 459.67 * 5.0 / 9.0).base.unwrap();
        // The boiling point of water; exact up to rounding.
        assert!((celsius.to(&fahrenheit).unwrap().apply(100.0) - 212.0).abs() < 1e-10);
        assert!((celsius.to(&kelvin).unwrap().apply(100.0) - 373.15).abs() < 1e-10);
        assert!((celsius.to(&kelvin).unwrap().inverse().apply(373.15) - 100.0).abs() < 1e-10);
        let pascal = unit("Pa", [1, -1, -2, 0, 0, 0, 0, 0], 1.0, 0.0).base.unwrap();
        assert_eq!(pascal.to(&kelvin), None);
    }

    #[test]
    fn a_display_unit_is_a_unit() {
        let mut kelvin = unit("K", [0, 0, 0, 0, 1, 0, 0, 0], 1.0, 0.0);
        kelvin.display_units.push(DisplayUnit { name: "degC".to_owned(), factor: 1.0, offset: -273.15 });
        let all: Vec<_> = kelvin.with_display_units().collect();
        assert_eq!(all[1].name, "degC");
        let freezing = all[1].base.unwrap().to(&kelvin.base.unwrap()).unwrap().apply(0.0);
        assert_eq!(freezing.to_bits(), 273.15_f64.to_bits());

        let mut pascal = unit("Pa", [1, -1, -2, 0, 0, 0, 0, 0], 1.0, 0.0);
        pascal.display_units.push(DisplayUnit { name: "bar".to_owned(), factor: 1e-5, offset: 0.0 });
        let bar = pascal.with_display_units().last().unwrap();
        assert_eq!(bar.base.unwrap().factor.to_bits(), 1e5_f64.to_bits());
    }
}
