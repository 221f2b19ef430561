//! The table of units: the meaning of a unit's name in SI base units (FMI 2.0.5, section 2.2.2).
//!
//! A name is an expression in the notation of Modelica, to which FMI refers, and of UCUM: factors joined by `.`, at
//! most one `/`, a denominator of several factors in parentheses, exponents after the symbol (`kg/s`, `N.m`,
//! `W/(m2.K)`, `s-1`, `1/min`). A symbol is looked up whole before being split into prefix and symbol, as in SI and
//! UCUM: `min` is a minute, `cd` a candela, `Pa` a pascal, `ft` nothing.

use std::collections::BTreeMap;

use super::notation::{factors, spelled};
use super::symbols::{Measure, NAMES, OFFSETS, Prefixes, SYMBOLS, built_in};
use super::{BaseUnit, DisplayUnit};
use crate::nearest;

/// The built-in units, and units of one's own, which come first.
#[derive(Default)]
pub struct UnitTable<'a> {
    own: BTreeMap<&'a str, BaseUnit>,
}

impl<'a> UnitTable<'a> {
    /// The built-in units and others by name; of several with one name, the last.
    pub fn with(own: impl IntoIterator<Item = (&'a str, BaseUnit)>) -> Self {
        Self { own: own.into_iter().collect() }
    }

    /// The definition of a unit in SI base units; none if it has fractional powers, which FMI cannot express.
    ///
    /// # Errors
    /// When the unit is not known; the message suggests its spelling or the nearest.
    pub fn base(&self, name: &str) -> Result<Option<BaseUnit>, String> {
        let measure = self.measure(name).map_err(|reason| {
            let written = spelled(name);
            let is_known = written != name && self.measure(&written).is_ok();
            if is_known { format!("the unit '{name}' is written '{written}'") } else { reason }
        })?;
        Ok(measure.base())
    }

    /// The conversion from a unit to another of the same dimension.
    ///
    /// # Errors
    /// When one of them is not known, or the dimensions differ.
    pub fn display_unit(&self, unit: &str, display: &str) -> Result<DisplayUnit, String> {
        let (from, to) = (self.measure(unit)?, self.measure(display)?);
        let equal = |(one, other): (&f64, &f64)| (one - other).abs() < 1e-9;
        if !from.exponents.iter().zip(&to.exponents).all(equal) {
            return Err(format!("'{display}' and '{unit}' have different dimensions"));
        }
        let ratio = Measure { offset: 0.0, ..from }.times(Measure { offset: 0.0, ..to }, -1.0);
        let offset = (from.offset - to.offset) / to.factor();
        Ok(DisplayUnit { name: display.to_owned(), factor: ratio.factor(), offset })
    }

    /// The meaning of a whole unit.
    fn measure(&self, name: &str) -> Result<Measure, String> {
        if let Some(measure) = self.own(name) {
            return Ok(measure);
        }
        if let Some((offset, measure)) = offset_of(name).zip(built_in(name)) {
            return Ok(Measure { offset, ..measure });
        }
        let [above, below] = factors(name)?;
        let below = below.into_iter().map(|(symbol, exponent)| (symbol, -exponent));
        let mut product = Measure::ONE;
        for (symbol, exponent) in above.into_iter().chain(below) {
            let measure = self.own(symbol).or_else(|| built_in(symbol));
            let measure = measure.ok_or_else(|| {
                let within = if symbol == name { String::new() } else { format!(": '{symbol}'") };
                format!("the unit '{name}'{within} is not known{}", self.nearest(symbol))
            })?;
            if measure.offset != 0.0 || offset_of(symbol).is_some() {
                return Err(format!(
                    "the unit '{name}': '{symbol}' has an offset and cannot be combined; use K"
                ));
            }
            product = product.times(measure, exponent);
        }
        Ok(product)
    }

    fn own(&self, name: &str) -> Option<Measure> {
        let BaseUnit { exponents, factor, offset } = *self.own.get(name)?;
        Some(Measure { exponents: exponents.map(f64::from), numerator: factor, offset, ..Measure::ONE })
    }

    /// A suggestion for an unknown symbol, as the end of a message: a product without its point, the unit of a name,
    /// or the nearest symbol.
    fn nearest(&self, symbol: &str) -> String {
        let known = |name: &str| self.own(name).or_else(|| built_in(name)).is_some();
        let mut splits = symbol.char_indices().skip(1).map(|(at, _)| symbol.split_at(at));
        if let Some((one, other)) = splits.find(|(one, other)| one != other && known(one) && known(other)) {
            return format!("; a product is written '{one}.{other}'");
        }
        let symbols = SYMBOLS.iter().flat_map(|(known, prefixes, ..)| {
            let common = ["", "k", "M", "m", "c"]
                .into_iter()
                .filter(|prefix| prefix.is_empty() || *prefixes == Prefixes::All);
            common.map(move |prefix| format!("{prefix}{known}"))
        });
        let own = self.own.keys().map(|name| (*name).to_owned());
        let names = NAMES.iter().map(|(name, _)| (*name).to_owned());
        let nearest = nearest(symbol, own.chain(symbols).chain(names));
        nearest.map_or_else(String::new, |nearest| match NAMES.iter().find(|(name, _)| *name == nearest) {
            Some((_, symbol)) => format!("; its symbol is '{symbol}'"),
            None => format!("; did you mean '{nearest}'?"),
        })
    }
}

/// The zero of a unit with an offset.
fn offset_of(name: &str) -> Option<f64> {
    OFFSETS.iter().find(|(known, _)| *known == name).map(|(_, offset)| *offset)
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    /// Exponents in FMI's notation, factor and offset.
    fn meaning(name: &str) -> Result<(String, f64, f64), String> {
        let Some(base) = UnitTable::default().base(name)? else { return Ok(("none".to_owned(), 1.0, 0.0)) };
        let exponents = base.powers().map(|(unit, exponent)| format!("{unit}{exponent}"));
        Ok((exponents.collect::<Vec<_>>().join(" "), base.factor, base.offset))
    }

    /// Values from the SI brochure (9th edition), exact where the definition is.
    #[test]
    fn units_have_the_values_of_si() {
        for (name, base, factor) in [
            ("1", "", 1.0),
            ("kg", "kg1", 1.0),
            ("g", "kg1", 1e-3),
            ("mg", "kg1", 1e-6),
            ("Mg", "kg1", 1e3),
            ("t", "kg1", 1e3),
            ("kt", "kg1", 1e6),
            ("kg/s", "kg1 s-1", 1.0),
            ("kg/h", "kg1 s-1", 1.0 / 3600.0),
            ("g/kg", "", 1e-3),
            ("N", "kg1 m1 s-2", 1.0),
            ("N.m", "kg1 m2 s-2", 1.0),
            ("kN.m", "kg1 m2 s-2", 1e3),
            ("Pa", "kg1 m-1 s-2", 1.0),
            ("hPa", "kg1 m-1 s-2", 100.0),
            ("mPa", "kg1 m-1 s-2", 1e-3),
            ("MPa", "kg1 m-1 s-2", 1e6),
            ("bar", "kg1 m-1 s-2", 1e5),
            ("mbar", "kg1 m-1 s-2", 100.0),
            // A pound-force, 4.4482216152605 N, on a square inch, 6.4516 cm²; NIST SP 811, appendix B.
            ("psi", "kg1 m-1 s-2", 4.448_221_615_260_5 / 6.4516e-4),
            ("atm", "kg1 m-1 s-2", 101_325.0),
            ("torr", "kg1 m-1 s-2", 101_325.0 / 760.0),
            ("mmHg", "kg1 m-1 s-2", 133.322_387_415),
            ("Torr", "kg1 m-1 s-2", 101_325.0 / 760.0),
            ("J", "kg1 m2 s-2", 1.0),
            ("kW", "kg1 m2 s-3", 1e3),
            ("kWh", "kg1 m2 s-2", 3.6e6),
            ("kW.h", "kg1 m2 s-2", 3.6e6),
            ("V", "kg1 m2 s-3 A-1", 1.0),
            ("Ohm", "kg1 m2 s-3 A-2", 1.0),
            ("MOhm", "kg1 m2 s-3 A-2", 1e6),
            ("uF", "kg-1 m-2 s4 A2", 1e-6),
            ("mH", "kg1 m2 s-2 A-2", 1e-3),
            ("T", "kg1 s-2 A-1", 1.0),
            ("mT", "kg1 s-2 A-1", 1e-3),
            ("Wb", "kg1 m2 s-2 A-1", 1.0),
            ("S/m", "kg-1 m-3 s3 A2", 1.0),
            ("C", "s1 A1", 1.0),
            ("lm", "cd1", 1.0),
            ("lx", "m-2 cd1", 1.0),
            ("cd", "cd1", 1.0),
            ("mmol", "mol1", 1e-3),
            ("Hz", "s-1", 1.0),
            ("s-1", "s-1", 1.0),
            ("1/s", "s-1", 1.0),
            ("1/min", "s-1", 1.0 / 60.0),
            ("min", "s1", 60.0),
            ("h", "s1", 3600.0),
            ("d", "s1", 86400.0),
            ("km/h", "m1 s-1", 1000.0 / 3600.0),
            ("dm3", "m3", 1e-3),
            ("cm2", "m2", 1e-4),
            ("mm2", "m2", 1e-6),
            ("L/min", "m3 s-1", 1e-3 / 60.0),
            ("ml", "m3", 1e-6),
            ("m/s2", "m1 s-2", 1.0),
            ("rad/s", "s-1 rad1", 1.0),
            ("deg", "rad1", PI / 180.0),
            ("rpm", "s-1 rad1", 2.0 * PI / 60.0),
            ("rev/min", "s-1 rad1", 2.0 * PI / 60.0),
            ("%", "", 0.01),
            ("ppm", "", 1e-6),
            ("1/(%.%)", "", 1e4),
            ("Pa/%", "kg1 m-1 s-2", 100.0),
            ("W/(m2.K)", "kg1 s-3 K-1", 1.0),
            ("J/(kg.K)", "m2 s-2 K-1", 1.0),
            ("kJ/(kg.K)", "m2 s-2 K-1", 1e3),
            ("kg.m2", "kg1 m2", 1.0),
            ("V/m", "kg1 m1 s-3 A-1", 1.0),
            ("K0.5.K0.5", "K1", 1.0),
            ("kg.K0.5/(s.Pa)", "none", 1.0),
        ] {
            assert_eq!(meaning(name), Ok((base.to_owned(), factor, 0.0)), "{name}");
        }
        assert_eq!(meaning("degC"), Ok(("K1".to_owned(), 1.0, 273.15)));
        // Water freezes at 32 °F.
        let (base, factor, offset) = meaning("degF").unwrap();
        assert_eq!((base.as_str(), factor.to_bits()), ("K1", (5.0_f64 / 9.0).to_bits()));
        assert!((factor * 32.0 + offset - 273.15).abs() < 273.15 * 2.0 * f64::EPSILON);
    }

    #[test]
    fn unknown_units_are_refused_with_the_nearest() {
        for (name, reason) in [
            ("Nm", "the unit 'Nm' is not known; a product is written 'N.m'"),
            ("ft", "the unit 'ft' is not known"),
            ("furlong", "the unit 'furlong' is not known"),
            ("stone", "the unit 'stone' is not known"),
            ("gram", "the unit 'gram' is not known; its symbol is 'g'"),
            ("Volt", "the unit 'Volt' is not known; its symbol is 'V'"),
            ("sec", "the unit 'sec' is not known; its symbol is 's'"),
            ("degree", "the unit 'degree' is not known; its symbol is 'deg'"),
            ("metres/s", "the unit 'metres/s': 'metres' is not known; its symbol is 'm'"),
            ("kg/hh", "the unit 'kg/hh': 'hh' is not known"),
            ("kg/hour", "the unit 'kg/hour': 'hour' is not known; its symbol is 'h'"),
            ("W/(m2.k)", "the unit 'W/(m2.k)': 'k' is not known; did you mean 'K'?"),
            ("pa", "the unit 'pa' is not known; did you mean 'Pa'?"),
            ("kkg", "the unit 'kkg' is not known; did you mean 'kg'?"),
            ("Ω", "the unit 'Ω' is written 'Ohm'"),
            ("kΩ", "the unit 'kΩ' is written 'kOhm'"),
            ("°C", "the unit '°C' is written 'degC'"),
            ("°F", "the unit '°F' is written 'degF'"),
            ("µm", "the unit 'µm' is written 'um'"),
            ("N·m", "the unit 'N·m' is written 'N.m'"),
            ("N*m", "the unit 'N*m' is written 'N.m'"),
            ("m/s²", "the unit 'm/s²' is written 'm/s2'"),
            ("m^2", "the unit 'm^2' is written 'm2'"),
            ("Ωx", "the unit 'Ωx' is not known"),
            ("J/degC", "the unit 'J/degC': 'degC' has an offset and cannot be combined; use K"),
            ("degF/s", "the unit 'degF/s': 'degF' has an offset and cannot be combined; use K"),
        ] {
            assert_eq!(meaning(name), Err(reason.to_owned()));
        }
        for name in ["", "m/s/s", "W/m2.K", "/s", "m/", "m..s", "m2 s", "N*x m", "m-", "12", "(m)", "1-1"] {
            let reason =
                format!("'{name}' is not written like a unit, such as kg/s, N.m, m/s2, 1/min or W/(m2.K)");
            assert_eq!(meaning(name), Err(reason));
        }
    }

    #[test]
    fn values_are_shown_in_any_unit_of_their_dimension() {
        let display = |unit: &str, display: &str| {
            UnitTable::default().display_unit(unit, display).map(|unit| (unit.factor, unit.offset))
        };
        for (unit, shown, factor, offset) in [
            ("Pa", "bar", 1e-5, 0.0),
            ("Pa", "kPa", 1e-3, 0.0),
            ("K", "degC", 1.0, -273.15),
            ("degC", "K", 1.0, 273.15),
            ("rad/s", "rpm", 60.0 / (2.0 * PI), 0.0),
            ("rad", "deg", 180.0 / PI, 0.0),
            ("1", "%", 100.0, 0.0),
            ("m3", "l", 1e3, 0.0),
            ("J/kg", "MJ/kg", 1e-6, 0.0),
            ("kg/s", "kg/h", 3600.0, 0.0),
        ] {
            assert_eq!(display(unit, shown), Ok((factor, offset)), "{unit} {shown}");
        }
        assert_eq!(display("Pa", "K"), Err("'K' and 'Pa' have different dimensions".to_owned()));
    }
}
