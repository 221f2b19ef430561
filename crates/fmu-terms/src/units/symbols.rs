//! The symbols of units, and their meaning in SI base units.

use super::BaseUnit;

/// The prefixes that a symbol allows.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Prefixes {
    None,
    /// The prefixes above 1 (`kt`, but not `ft`).
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
pub(super) type Exponents = [f64; 8];

const DIMENSIONLESS: Exponents = [0.0; 8];
const ANGLE: Exponents = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const PI: f64 = core::f64::consts::PI;

/// A symbol, its prefixes, exponents of the base units, and its factor's numerator, denominator and power of ten, kept
/// apart so that a product of units is rounded only once.
pub(super) type Symbol = (&'static str, Prefixes, Exponents, f64, f64, i32);

/// The symbols of SI (brochure, 9th edition, tables 2, 4 and 8) and others that engineers use, with the factors of NIST
/// Special Publication 811 (2008), appendix B.
#[rustfmt::skip]
pub(super) const SYMBOLS: [Symbol; 57] = [
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
    ("psi",  NoPrefix, [1., -1., -2., 0., 0., 0., 0., 0.], 4.448_221_615_260_5, 6.4516, 4),
    ("atm",  NoPrefix, [1., -1., -2., 0., 0., 0., 0., 0.], 101_325., 1., 0),
    ("torr", NoPrefix, [1., -1., -2., 0., 0., 0., 0., 0.], 101_325., 760., 0),
    ("mmHg", NoPrefix, [1., -1., -2., 0., 0., 0., 0., 0.], 133.322_387_415, 1., 0),
    ("Torr", NoPrefix, [1., -1., -2., 0., 0., 0., 0., 0.], 101_325., 760., 0),
    ("L",    All,      [0., 3., 0., 0., 0., 0., 0., 0.], 1., 1., -3),
    ("l",    All,      [0., 3., 0., 0., 0., 0., 0., 0.], 1., 1., -3),
    ("t",    Large,    [1., 0., 0., 0., 0., 0., 0., 0.], 1., 1., 3),
    ("ha",   NoPrefix, [0., 2., 0., 0., 0., 0., 0., 0.], 1., 1., 4),
    ("min",  NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 60., 1., 0),
    ("h",    NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 3600., 1., 0),
    ("d",    NoPrefix, [0., 0., 1., 0., 0., 0., 0., 0.], 86400., 1., 0),
    ("degC", NoPrefix, [0., 0., 0., 0., 1., 0., 0., 0.], 1., 1., 0),
    ("degF", NoPrefix, [0., 0., 0., 0., 1., 0., 0., 0.], 5., 9., 0),
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
pub(super) const NAMES: [(&str, &str); 37] = [
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
    ("fahrenheit", "degF"),
    ("revolution", "rev"),
    ("percent", "%"),
];

/// The units with an offset: their zeros in K.
pub(super) const OFFSETS: [(&str, f64); 2] = [("degC", 273.15), ("degF", 459.67 * 5.0 / 9.0)];

/// A unit in terms of base units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    pub(super) exponents: Exponents,
    pub(super) numerator: f64,
    pub(super) denominator: f64,
    pub(super) power_of_ten: i32,
    pub(super) offset: f64,
}

impl Measure {
    pub(super) const ONE: Self =
        Self { exponents: DIMENSIONLESS, numerator: 1.0, denominator: 1.0, power_of_ten: 0, offset: 0.0 };

    pub(super) fn times(self, other: Self, exponent: f64) -> Self {
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

    pub(super) fn factor(&self) -> f64 {
        let power = 10_f64.powi(self.power_of_ten.abs());
        if self.power_of_ten < 0 {
            self.numerator / (self.denominator * power)
        } else {
            self.numerator * power / self.denominator
        }
    }

    /// The unit as in FMI, if its exponents are integers.
    #[allow(clippy::cast_possible_truncation, reason = "exponents are small")]
    pub(super) fn base(&self) -> Option<BaseUnit> {
        let whole = self.exponents.iter().all(|exponent| exponent.fract() == 0.0);
        let exponents = self.exponents.map(|exponent| exponent as i32);
        whole.then(|| BaseUnit { exponents, factor: self.factor(), offset: self.offset })
    }
}

/// A symbol of the table, with or without a prefix.
pub(super) fn built_in(name: &str) -> Option<Measure> {
    let find = |wanted: &str| SYMBOLS.iter().find(|(symbol, ..)| *symbol == wanted);
    let with = |&(_, _, exponents, numerator, denominator, power): &Symbol, prefix: i32| Measure {
        exponents,
        numerator,
        denominator,
        power_of_ten: power + prefix,
        ..Measure::ONE
    };
    if let Some(symbol) = find(name) {
        return Some(with(symbol, 0));
    }
    PREFIXES.iter().find_map(|&(prefix, power)| {
        let symbol = find(name.strip_prefix(prefix)?)?;
        (symbol.1 == All || symbol.1 == Large && power >= 3).then(|| with(symbol, power))
    })
}
