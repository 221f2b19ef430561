//! Numbers as readers expect them, with significant digits only; files have all digits.
//!
//! ```
//! use fmu_record::numbers::{estimate, number, quantity};
//!
//! assert_eq!(number(71.875), "71.9");
//! assert_eq!(quantity(125_300.0, "Pa"), "125\u{202f}kPa");
//! assert_eq!(estimate(19.002_34, 0.004_13), "19.0023 ± 0.0041");
//! ```

/// The significant digits of a number, unless it has more before the point.
const DIGITS: i32 = 3;
/// The maximum digits of a value with a far smaller error.
const MOST_DIGITS: i32 = 7;
/// The units with SI prefixes, and the largest usual exponent.
const PREFIXED: [(&str, i32); 9] =
    [("Pa", 9), ("V", 3), ("A", 3), ("N", 6), ("W", 9), ("J", 9), ("Hz", 9), ("m", 0), ("s", 0)];
const PREFIXES: [(&str, i32); 9] =
    [("f", -15), ("p", -12), ("n", -9), ("\u{b5}", -6), ("m", -3), ("", 0), ("k", 3), ("M", 6), ("G", 9)];
/// Numbers in this range need no prefix.
const HANDY: std::ops::Range<f64> = 0.01..1e4;

/// A number with its unit, with an SI prefix if that saves zeros: `125 kPa`. A narrow no-break space separates them;
/// the unit `1` is omitted.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let (unit, factor) = shown(unit, value);
    let space = if unit.is_empty() { "" } else { "\u{202f}" };
    format!("{}{space}{unit}", number(factor * value))
}

/// The unit in which a value is shown, and the factor to it: `("kPa", 1e-3)` for 125300 Pa. Units that take no prefix
/// stay.
#[must_use]
pub fn shown(unit: &str, value: f64) -> (String, f64) {
    let (base, scale) = match unit {
        "1" => return (String::new(), 1.0),
        // The SI unit that has a prefix already.
        "kg" => ("g", 3),
        "kg/s" => ("g/s", 3),
        other => (other, 0),
    };
    let most = PREFIXED.iter().find(|(known, _)| *known == unit).map(|(_, most)| *most);
    let Some(most) = most.or((scale != 0).then_some(scale)) else { return (unit.to_owned(), 1.0) };
    if value == 0.0 || !value.is_finite() || HANDY.contains(&value.abs()) {
        return (unit.to_owned(), 1.0);
    }
    let exponent = 3 * ((magnitude(value) + scale).div_euclid(3));
    let exponent = exponent.clamp(-15, most);
    let prefix = PREFIXES.iter().find(|(_, known)| *known == exponent).map_or("", |(prefix, _)| prefix);
    (format!("{prefix}{base}"), 10_f64.powi(scale - exponent))
}

/// The unit for an axis of values up to a size, and the factor to it: that of [`shown`], but kPa from 1 kPa on.
#[must_use]
pub fn axis(unit: &str, size: f64) -> (String, f64) {
    match unit {
        "Pa" if (1e3..1e4).contains(&size) => ("kPa".to_owned(), 1e-3),
        other => shown(other, size),
    }
}

/// A number with three significant digits, or all those before the point; from a million on and below 0.001, with a
/// power of ten.
#[must_use]
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = magnitude(value);
    if !(-3..6).contains(&magnitude) {
        return format!("{}{}", minus(&format!("{:.1}", value / 10_f64.powi(magnitude))), power(magnitude));
    }
    let text = decimals(value, DIGITS - 1 - magnitude);
    minus(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
}

/// A value and its standard error, in the same unit. The error has two digits and limits those of the value.
#[must_use]
pub fn estimate(value: f64, error: f64) -> String {
    if !(value.is_finite() && error.is_finite() && error > 0.0) {
        return format!("{} ± {}", number(value), number(error));
    }
    let magnitude_of_both = magnitude(value.abs().max(error));
    // A power of ten instead of many zeros.
    let exponent = if (-3..5).contains(&magnitude_of_both) { 0 } else { magnitude_of_both };
    let factor = 10_f64.powi(-exponent);
    let places = 1 - magnitude(error * factor);
    // A value of 0 takes the digits of its error.
    let most = if value == 0.0 { places } else { MOST_DIGITS - 1 - magnitude(value * factor) };
    if places > most {
        let mantissa = minus(&decimals(value * factor, most));
        return format!(
            "{mantissa}{} ± {}",
            if exponent == 0 { String::new() } else { power(exponent) },
            number(error)
        );
    }
    let [value, error] = [value, error].map(|number| decimals(number * factor, places));
    minus(&match exponent {
        0 => format!("{value} ± {error}"),
        _ => format!("({value} ± {error}){}", power(exponent)),
    })
}

/// The exponent of the first digit.
#[allow(clippy::cast_possible_truncation)] // from -324 to 308
fn magnitude(value: f64) -> i32 {
    value.abs().log10().floor() as i32
}

fn decimals(value: f64, places: i32) -> String {
    let places = usize::try_from(places).unwrap_or(0);
    format!("{value:.places$}")
}

/// A power of ten as a factor.
fn power(exponent: i32) -> String {
    const SUPERSCRIPTS: [char; 10] = [
        '\u{2070}', '\u{b9}', '\u{b2}', '\u{b3}', '\u{2074}', '\u{2075}', '\u{2076}', '\u{2077}', '\u{2078}',
        '\u{2079}',
    ];
    let superscript = |character: char| match character.to_digit(10) {
        Some(digit) => SUPERSCRIPTS[digit as usize],
        None => '\u{207b}',
    };
    format!("\u{b7}10{}", exponent.to_string().chars().map(superscript).collect::<String>())
}

fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_few_digits() {
        let cases = [
            (2466.41, "2466"),
            (9.174_3, "9.17"),
            (71.875, "71.9"),
            (0.55, "0.55"),
            (0.012_34, "0.0123"),
            (-1.5, "\u{2212}1.5"),
            (0.0, "0"),
            (100.0, "100"),
            (106_120.0, "106120"),
            (2e15, "2.0\u{b7}10\u{b9}\u{2075}"),
            (1e-9, "1.0\u{b7}10\u{207b}\u{2079}"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn units_have_prefixes_where_they_save_zeros() {
        let cases = [
            (2466.41, "Pa", "2466\u{202f}Pa"),
            (125_300.0, "Pa", "125\u{202f}kPa"),
            (-2.1e6, "Pa", "\u{2212}2.1\u{202f}MPa"),
            (5.3e-4, "m", "530\u{202f}\u{b5}m"),
            (1.25e-5, "m", "12.5\u{202f}\u{b5}m"),
            (12_345.0, "m", "12345\u{202f}m"),
            (0.002_5, "s", "2.5\u{202f}ms"),
            (72_500.0, "s", "72500\u{202f}s"),
            (8.01e-7, "kg/s", "801\u{202f}\u{b5}g/s"),
            (0.02, "kg/s", "0.02\u{202f}kg/s"),
            (2e-5, "%", "2.0\u{b7}10\u{207b}\u{2075}\u{202f}%"),
            (3.0, "1", "3"),
            (-3e-13, "A", "\u{2212}300\u{202f}fA"),
            (2e-20, "A", "2.0\u{b7}10\u{207b}\u{2075}\u{202f}fA"),
            (0.0, "Pa", "0\u{202f}Pa"),
            (f64::NAN, "Pa", "NaN\u{202f}Pa"),
        ];
        for (value, unit, text) in cases {
            assert_eq!(quantity(value, unit), text);
        }
    }

    #[test]
    fn estimates_end_with_their_errors() {
        let cases = [
            (19.002_34, 0.004_13, "19.0023 ± 0.0041"),
            (-440.4, 3.21, "\u{2212}440.4 ± 3.2"),
            (106_120.0, 13.0, "(1.06120 ± 0.00013)\u{b7}10\u{2075}"),
            (8.01e-7, 2.5e-9, "(8.010 ± 0.025)\u{b7}10\u{207b}\u{2077}"),
            (-4.7e-5, 9.0e-5, "(\u{2212}4.7 ± 9.0)\u{b7}10\u{207b}\u{2075}"),
            (3530.0, 120.0, "3530 ± 120"),
            (0.0, 0.1, "0.00 ± 0.10"),
            // More digits than any measurement has.
            (0.028_938_999_999_983, 1.8e-14, "0.02893900 ± 1.8\u{b7}10\u{207b}\u{b9}\u{2074}"),
            (-106_120.0, 1e-9, "\u{2212}1.061200\u{b7}10\u{2075} ± 1.0\u{b7}10\u{207b}\u{2079}"),
        ];
        for (value, error, text) in cases {
            assert_eq!(estimate(value, error), text);
        }
    }
}
