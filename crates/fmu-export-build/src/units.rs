//! Units: the meaning of a unit's name in SI base units (FMI 2.0.5, section 2.2.2).
//!
//! A name is an expression in the notation of Modelica, to which FMI refers, and of UCUM: factors joined by `.`, at
//! most one `/`, a denominator of several factors in parentheses, exponents after the symbol (`kg/s`, `N.m`,
//! `W/(m2.K)`, `s-1`, `1/min`). A symbol is looked up whole before being split into prefix and symbol, as in SI and
//! UCUM: `min` is a minute, `cd` a candela, `Pa` a pascal, `ft` nothing.

use std::collections::BTreeMap;

use crate::check;
use crate::declaration::{BaseUnit, DisplayUnitDeclaration, UnitDeclaration};
use crate::error;

/// A unit as defined in modelDescription.xml.
#[derive(Clone, Debug)]
pub(crate) struct Unit {
    pub(crate) name: String,
    /// Exponents of the base units; none if not integers or unknown.
    pub(crate) base: Option<BTreeMap<BaseUnit, i32>>,
    /// From this unit to the base unit.
    pub(crate) factor: f64,
    pub(crate) offset: f64,
    pub(crate) display_units: Vec<DisplayUnit>,
}

/// A display unit, with the conversion to it.
#[derive(Clone, Debug)]
pub(crate) struct DisplayUnit {
    pub(crate) name: String,
    pub(crate) factor: f64,
    pub(crate) offset: f64,
}

/// The prefixes that a symbol allows.
#[derive(Clone, Copy, PartialEq)]
enum Prefixes {
    None,
    /// Those above 1 (`kt`, but not `ft`).
    Large,
    All,
}
use Prefixes::{All, Large, None as NoPrefix};

const PREFIXES: [(&str, i32); 20] = [
    ("Y", 24),
    ("Z", 21),
    ("E", 18),
    ("P", 15),
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("da", 1),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    ("n", -9),
    ("p", -12),
    ("f", -15),
    ("a", -18),
    ("z", -21),
    ("y", -24),
];

/// Exponents of kg, m, s, A, K, mol, cd and rad.
type Exponents = [f64; 8];

const DIMENSIONLESS: Exponents = [0.0; 8];
const ANGLE: Exponents = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const PI: f64 = std::f64::consts::PI;

/// A symbol, its prefixes, exponents of the base units, and its factor's numerator, denominator and power of ten, kept
/// apart so that a product of units is rounded only once.
type Symbol = (&'static str, Prefixes, Exponents, f64, f64, i32);

/// The symbols of SI (brochure, 9th edition, tables 2, 4 and 8) and others that engineers use.
#[rustfmt::skip]
const SYMBOLS: [Symbol; 51] = [
    ("g",    All,      [1., 0., 0., 0., 0., 0., 0., 0.], 1., 1., -3),
    ("m",    All,      [0., 1., 0., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("s",    All,      [0., 0., 1., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("A",    All,      [0., 0., 0., 1., 0., 0., 0., 0.], 1., 1., 0),
    ("K",    All,      [0., 0., 0., 0., 1., 0., 0., 0.], 1., 1., 0),
    ("mol",  All,      [0., 0., 0., 0., 0., 1., 0., 0.], 1., 1., 0),
    ("cd",   All,      [0., 0., 0., 0., 0., 0., 1., 0.], 1., 1., 0),
    ("rad",  All,      ANGLE,                            1., 1., 0),
    ("sr",   All,      DIMENSIONLESS,                    1., 1., 0),
    ("Hz",   All,      [0., 0., -1., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("Bq",   All,      [0., 0., -1., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("N",    All,      [1., 1., -2., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("Pa",   All,      [1., -1., -2., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("J",    All,      [1., 2., -2., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("W",    All,      [1., 2., -3., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("C",    All,      [0., 0., 1., 1., 0., 0., 0., 0.], 1., 1., 0),
    ("V",    All,      [1., 2., -3., -1., 0., 0., 0., 0.], 1., 1., 0),
    ("F",    All,      [-1., -2., 4., 2., 0., 0., 0., 0.], 1., 1., 0),
    ("Ohm",  All,      [1., 2., -3., -2., 0., 0., 0., 0.], 1., 1., 0),
    ("S",    All,      [-1., -2., 3., 2., 0., 0., 0., 0.], 1., 1., 0),
    ("Wb",   All,      [1., 2., -2., -1., 0., 0., 0., 0.], 1., 1., 0),
    ("T",    All,      [1., 0., -2., -1., 0., 0., 0., 0.], 1., 1., 0),
    ("H",    All,      [1., 2., -2., -2., 0., 0., 0., 0.], 1., 1., 0),
    ("lm",   All,      [0., 0., 0., 0., 0., 0., 1., 0.], 1., 1., 0),
    ("lx",   All,      [0., -2., 0., 0., 0., 0., 1., 0.], 1., 1., 0),
    ("Gy",   All,      [0., 2., -2., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("Sv",   All,      [0., 2., -2., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("kat",  All,      [0., 0., -1., 0., 0., 1., 0., 0.], 1., 1., 0),
    ("VA",   All,      [1., 2., -3., 0., 0., 0., 0., 0.], 1., 1., 0),
    ("Wh",   All,      [1., 2., -2., 0., 0., 0., 0., 0.], 3600., 1., 0),
    ("Ah",   All,      [0., 0., 1., 1., 0., 0., 0., 0.], 3600., 1., 0),
    ("eV",   All,      [1., 2., -2., 0., 0., 0., 0., 0.], 1.602_176_634, 1., -19),
    ("bar",  All,      [1., -1., -2., 0., 0., 0., 0., 0.], 1., 1., 5),
    ("L",    All,      [0., 3., 0., 0., 0., 0., 0., 0.], 1., 1., -3),
    ("l",    All,      [0., 3., 0., 0., 0., 0., 0., 0.], 1., 1., -3),
    ("t",    Large,    [1., 0., 0., 0., 0., 0., 0., 0.], 1., 1., 3),
    ("ha",   NoPrefix, [0., 2., 0., 0., 0., 0., 0., 0.], 1., 1., 4),
    ("min",  NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 60., 1., 0),
    ("h",    NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 3600., 1., 0),
    ("d",    NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 86400., 1., 0),
    ("degC", NoPrefix, [0., 0., 0., 0., 1., 0., 0., 0.], 1., 1., 0),
    ("deg",  NoPrefix, ANGLE,                            PI, 180., 0),
    ("rev",  NoPrefix, ANGLE,                            2. * PI, 1., 0),
    ("rpm",  NoPrefix, [0., 0., -1., 0., 0., 0., 0., 1.], 2. * PI, 60., 0),
    ("%",    NoPrefix, DIMENSIONLESS,                    1., 1., -2),
    ("ppm",  NoPrefix, DIMENSIONLESS,                    1., 1., -6),
    ("ppb",  NoPrefix, DIMENSIONLESS,                    1., 1., -9),
    ("au",   NoPrefix, [0., 1., 0., 0., 0., 0., 0., 0.], 149_597_870_700., 1., 0),
    ("Da",   NoPrefix, [1., 0., 0., 0., 0., 0., 0., 0.], 1.660_539_068_92, 1., -27),
    ("Np",   NoPrefix, DIMENSIONLESS,                    1., 1., 0),
    ("1",    NoPrefix, DIMENSIONLESS,                    1., 1., 0),
];

/// Names of units and abbreviations that are not symbols, and the symbols.
const NAMES: [(&str, &str); 36] = [
    ("gram", "g"),
    ("kilogram", "kg"),
    ("meter", "m"),
    ("metre", "m"),
    ("second", "s"),
    ("sec", "s"),
    ("ampere", "A"),
    ("amp", "A"),
    ("kelvin", "K"),
    ("mole", "mol"),
    ("candela", "cd"),
    ("radian", "rad"),
    ("hertz", "Hz"),
    ("newton", "N"),
    ("pascal", "Pa"),
    ("joule", "J"),
    ("watt", "W"),
    ("coulomb", "C"),
    ("volt", "V"),
    ("farad", "F"),
    ("siemens", "S"),
    ("weber", "Wb"),
    ("tesla", "T"),
    ("henry", "H"),
    ("lumen", "lm"),
    ("lux", "lx"),
    ("liter", "l"),
    ("litre", "l"),
    ("tonne", "t"),
    ("minute", "min"),
    ("hour", "h"),
    ("day", "d"),
    ("degree", "deg"),
    ("celsius", "degC"),
    ("revolution", "rev"),
    ("percent", "%"),
];

/// Letters and signs of other notations, and their spelling here.
const WRITTEN: [(&str, &str); 12] = [
    ("°C", "degC"),
    ("℃", "degC"),
    ("°", "deg"),
    ("Ω", "Ohm"),
    ("\u{2126}", "Ohm"),
    ("µ", "u"),
    ("μ", "u"),
    ("·", "."),
    ("*", "."),
    ("²", "2"),
    ("³", "3"),
    ("^", ""),
];

/// Zero Celsius in K: the only unit here with an offset.
const CELSIUS: (&str, f64) = ("degC", 273.15);

/// A unit in terms of base units.
#[derive(Clone, Copy, Debug)]
struct Measure {
    exponents: Exponents,
    numerator: f64,
    denominator: f64,
    power_of_ten: i32,
    offset: f64,
}

impl Measure {
    const ONE: Self =
        Self { exponents: DIMENSIONLESS, numerator: 1.0, denominator: 1.0, power_of_ten: 0, offset: 0.0 };

    fn times(self, other: Self, exponent: f64) -> Self {
        let mut exponents = self.exponents;
        for (sum, added) in exponents.iter_mut().zip(other.exponents) {
            *sum += exponent * added;
        }
        // An integer exponent keeps the power of ten an integer; the factor of any other is only used among its like.
        let power = f64::from(other.power_of_ten) * exponent;
        let rest = 10_f64.powf(power.fract());
        let (above, below) = if exponent < 0.0 {
            (other.denominator, other.numerator)
        } else {
            (other.numerator, other.denominator)
        };
        #[allow(clippy::cast_possible_truncation, reason = "far from the limits of an i32")]
        Self {
            exponents,
            numerator: self.numerator * above.powf(exponent.abs()) * rest,
            denominator: self.denominator * below.powf(exponent.abs()),
            power_of_ten: self.power_of_ten + power.trunc() as i32,
            offset: 0.0,
        }
    }

    fn factor(&self) -> f64 {
        let power = 10_f64.powi(self.power_of_ten.abs());
        if self.power_of_ten < 0 {
            self.numerator / (self.denominator * power)
        } else {
            self.numerator * power / self.denominator
        }
    }

    /// The exponents as in FMI, if they are integers.
    #[allow(clippy::cast_possible_truncation, reason = "exponents are small")]
    fn base(&self) -> Option<BTreeMap<BaseUnit, i32>> {
        let whole = self.exponents.iter().all(|exponent| exponent.fract() == 0.0);
        let exponents = BaseUnit::ALL.into_iter().zip(self.exponents.map(|exponent| exponent as i32));
        whole.then(|| exponents.filter(|(_, exponent)| *exponent != 0).collect())
    }
}

/// The units that a model may use: those of its file, and SI's.
pub(crate) struct Units<'a> {
    declared: &'a [UnitDeclaration],
    /// Their positions.
    names: BTreeMap<&'a str, usize>,
}

impl<'a> Units<'a> {
    pub(crate) fn new(declared: &'a [UnitDeclaration]) -> Self {
        // The first of several with the same name.
        let names = declared
            .iter()
            .map(|unit| unit.name.as_str())
            .enumerate()
            .rev()
            .map(|(position, name)| (name, position))
            .collect();
        Self { declared, names }
    }

    /// The position of a unit in the file.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    /// A unit by name, with the display units declared in the file.
    pub(crate) fn find(&self, name: &str) -> Result<Unit, String> {
        let declared = self.position(name).map(|position| &self.declared[position]);
        let mut unit = match (self.measure(name), declared) {
            (Ok(measure), _) => Unit {
                name: name.to_owned(),
                base: measure.base(),
                factor: measure.factor(),
                offset: measure.offset,
                display_units: Vec::new(),
            },
            (Err(_), Some(_)) => Unit {
                name: name.to_owned(),
                base: None,
                factor: 1.0,
                offset: 0.0,
                display_units: Vec::new(),
            },
            (Err(reason), None) => {
                let written = WRITTEN.iter().fold(name.to_owned(), |text, (from, to)| text.replace(from, to));
                let is_known = written != name && self.measure(&written).is_ok();
                return Err(if is_known {
                    format!("the unit '{name}' is written '{written}'")
                } else {
                    reason
                });
            }
        };
        for display in declared.map_or(&[][..], |declared| &declared.display_units) {
            let display = match display {
                DisplayUnitDeclaration::Known(display) => self.display_unit(name, display)?,
                DisplayUnitDeclaration::New { name, factor, offset } => {
                    DisplayUnit { name: name.clone(), factor: *factor, offset: *offset }
                }
            };
            unit.display_units.push(display);
        }
        Ok(unit)
    }

    /// The conversion from a unit to another of the same dimension.
    pub(crate) fn display_unit(&self, unit: &str, display: &str) -> Result<DisplayUnit, String> {
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
        if let Some(measure) = self.declared(name) {
            return Ok(measure);
        }
        if name == CELSIUS.0 {
            return Ok(Measure { offset: CELSIUS.1, ..built_in(name).expect("it is in the table") });
        }
        check::length(name)?;
        let [above, below] = factors(name)?;
        let below = below.into_iter().map(|(symbol, exponent)| (symbol, -exponent));
        let mut product = Measure::ONE;
        for (symbol, exponent) in above.into_iter().chain(below) {
            let measure = self.declared(symbol).or_else(|| built_in(symbol));
            let measure = measure.ok_or_else(|| {
                let within = if symbol == name { String::new() } else { format!(": '{symbol}'") };
                format!("the unit '{name}'{within} is not known{}", self.nearest(symbol))
            })?;
            if measure.offset != 0.0 || symbol == CELSIUS.0 {
                return Err(format!(
                    "the unit '{name}': '{symbol}' has an offset and cannot be combined; use K"
                ));
            }
            product = product.times(measure, exponent);
        }
        Ok(product)
    }

    /// A unit of the file that is defined in base units.
    fn declared(&self, name: &str) -> Option<Measure> {
        let unit = &self.declared[self.position(name)?];
        let base = unit.base.as_ref()?;
        let exponents = BaseUnit::ALL.map(|unit| base.get(&unit).copied().map_or(0.0, f64::from));
        Some(Measure { exponents, numerator: unit.factor, offset: unit.offset, ..Measure::ONE })
    }

    /// A suggestion for an unknown symbol, as the end of a message: a product without its point, the unit of a name,
    /// or the nearest symbol.
    fn nearest(&self, symbol: &str) -> String {
        let known = |name: &str| self.declared(name).or_else(|| built_in(name)).is_some();
        let mut splits = symbol.char_indices().skip(1).map(|(at, _)| symbol.split_at(at));
        if let Some((one, other)) = splits.find(|(one, other)| one != other && known(one) && known(other)) {
            return format!("; a product is written '{one}.{other}'");
        }
        let symbols = SYMBOLS.iter().flat_map(|(known, prefixes, ..)| {
            let common =
                ["", "k", "M", "m", "c"].into_iter().filter(|prefix| prefix.is_empty() || *prefixes == All);
            common.map(move |prefix| format!("{prefix}{known}"))
        });
        let declared = self.declared.iter().map(|unit| unit.name.clone());
        let names = NAMES.iter().map(|(name, _)| (*name).to_owned());
        let nearest = error::nearest_of(symbol, declared.chain(symbols).chain(names));
        nearest.map_or_else(String::new, |nearest| match NAMES.iter().find(|(name, _)| *name == nearest) {
            Some((_, symbol)) => format!("; its symbol is '{symbol}'"),
            None => format!("; the nearest is '{nearest}'"),
        })
    }
}

fn takes(prefixes: Prefixes, power: i32) -> bool {
    prefixes == All || prefixes == Large && power >= 3
}

/// A symbol of the table, with or without a prefix.
fn built_in(name: &str) -> Option<Measure> {
    let find = |wanted: &str| SYMBOLS.iter().find(|(symbol, ..)| *symbol == wanted);
    let with = |&(_, _, exponents, numerator, denominator, power_of_ten): &Symbol, prefix: i32| Measure {
        exponents,
        numerator,
        denominator,
        power_of_ten: power_of_ten + prefix,
        offset: 0.0,
    };
    if let Some(symbol) = find(name) {
        return Some(with(symbol, 0));
    }
    PREFIXES.iter().find_map(|&(prefix, power)| {
        let symbol = find(name.strip_prefix(prefix)?)?;
        takes(symbol.1, power).then(|| with(symbol, power))
    })
}

/// A symbol to a power.
type Factor<'a> = (&'a str, f64);

/// A unit's factors, above and below its slash.
fn factors(name: &str) -> Result<[Vec<Factor<'_>>; 2], String> {
    let (above, below) = match name.split_once('/') {
        None => (product(name), Some(Vec::new())),
        Some((above, below)) => {
            let inner = below.strip_prefix('(').and_then(|below| below.strip_suffix(')'));
            let single = product(below).filter(|factors| factors.len() == 1);
            (product(above), inner.map_or(single, product))
        }
    };
    above.zip(below).map(|(above, below)| [above, below]).ok_or_else(|| {
        format!("'{name}' is not written like a unit, such as kg/s, N.m, m/s2, 1/min or W/(m2.K)")
    })
}

/// Symbols with exponents, joined by points.
fn product(text: &str) -> Option<Vec<Factor<'_>>> {
    let mut factors = Vec::new();
    let mut rest = text;
    loop {
        let is_symbol = |character: char| character.is_alphabetic() || matches!(character, '%' | '_');
        let end = rest.find(|character| !is_symbol(character)).unwrap_or(rest.len());
        let (symbol, after) = rest.split_at(if rest.starts_with('1') { 1 } else { end });
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let sign = usize::from(after.starts_with(['+', '-']));
        let mut length = sign + digits(&after[sign..]);
        // The point of a fraction, as in K0.5, has digits on both sides.
        if length > sign && after[length..].starts_with('.') {
            let fraction = digits(&after[length + 1..]);
            length += if fraction > 0 { 1 + fraction } else { 0 };
        }
        let (exponent, after) = after.split_at(length);
        if symbol.is_empty() || length == sign && sign > 0 || symbol == "1" && length > 0 {
            return None;
        }
        factors.push((symbol, if exponent.is_empty() { 1.0 } else { exponent.parse().ok()? }));
        match after.strip_prefix('.') {
            Some(next) => rest = next,
            None => return after.is_empty().then_some(factors),
        }
    }
}

/// The unit of a time derivative, in the shortest notation: `m/s` becomes `m/s2`, `1` becomes `1/s`.
pub(crate) fn per_second(name: &str) -> String {
    let Ok([mut above, mut below]) = factors(name) else { return format!("{name}/s") };
    if let Some((_, exponent)) = above.iter_mut().find(|(symbol, _)| *symbol == "s") {
        *exponent -= 1.0;
    } else if let Some((_, exponent)) = below.iter_mut().find(|(symbol, _)| *symbol == "s") {
        *exponent += 1.0;
    } else {
        below.push(("s", 1.0));
    }
    let join = |factors: &[Factor<'_>]| {
        let factors = factors.iter().filter(|(symbol, exponent)| *exponent != 0.0 && *symbol != "1");
        let factors: Vec<_> = factors
            .map(|(symbol, exponent)| match exponent.to_string().as_str() {
                "1" => (*symbol).to_owned(),
                exponent => format!("{symbol}{exponent}"),
            })
            .collect();
        (factors.len(), factors.join("."))
    };
    let numerator = match join(&above) {
        (0, _) => "1".to_owned(),
        (_, factors) => factors,
    };
    match join(&below) {
        (0, _) => numerator,
        (1, factor) => format!("{numerator}/{factor}"),
        (_, factors) => format!("{numerator}/({factors})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exponents in FMI's notation, factor and offset.
    fn meaning(name: &str) -> Result<(String, f64, f64), String> {
        let unit = Units::new(&[]).find(name)?;
        let base = unit.base.map_or("none".to_owned(), |base| {
            let exponents = base.iter().map(|(unit, exponent)| format!("{}{exponent}", unit.symbol()));
            exponents.collect::<Vec<_>>().join(" ")
        });
        Ok((base, unit.factor, unit.offset))
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
            ("1/%2", "", 1e4),
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
            ("W/(m2.k)", "the unit 'W/(m2.k)': 'k' is not known; the nearest is 'K'"),
            ("pa", "the unit 'pa' is not known; the nearest is 'Pa'"),
            ("kkg", "the unit 'kkg' is not known; the nearest is 'kg'"),
            ("Ω", "the unit 'Ω' is written 'Ohm'"),
            ("kΩ", "the unit 'kΩ' is written 'kOhm'"),
            ("°C", "the unit '°C' is written 'degC'"),
            ("µm", "the unit 'µm' is written 'um'"),
            ("N·m", "the unit 'N·m' is written 'N.m'"),
            ("N*m", "the unit 'N*m' is written 'N.m'"),
            ("m/s²", "the unit 'm/s²' is written 'm/s2'"),
            ("m^2", "the unit 'm^2' is written 'm2'"),
            ("Ωx", "the unit 'Ωx' is not known"),
            ("J/degC", "the unit 'J/degC': 'degC' has an offset and cannot be combined; use K"),
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
            Units::new(&[]).display_unit(unit, display).map(|unit| (unit.factor, unit.offset))
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

    #[test]
    fn the_unit_of_a_derivative_is_simplified() {
        for (unit, derivative) in [
            ("m", "m/s"),
            ("m/s", "m/s2"),
            ("m/s2", "m/s3"),
            ("1", "1/s"),
            ("1/s", "1/s2"),
            ("s-1", "s-2"),
            ("s", "1"),
            ("J", "J/s"),
            ("kg.s", "kg"),
            ("N.s/m", "N/m"),
            ("J/(kg.K)", "J/(kg.K.s)"),
            ("W/m2", "W/(m2.s)"),
            ("rpm", "rpm/s"),
            ("%", "%/s"),
        ] {
            assert_eq!(per_second(unit), derivative, "{unit}");
        }
    }
}
