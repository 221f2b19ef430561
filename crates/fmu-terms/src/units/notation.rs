//! The notation of units: factors joined by `.`, at most one `/`, a denominator of several factors in parentheses,
//! exponents after the symbol.

/// Letters and signs of other notations, and their spelling here.
const WRITTEN: [(&str, &str); 16] = [
    ("°C", "degC"),
    ("℃", "degC"),
    ("°F", "degF"),
    ("℉", "degF"),
    ("°", "deg"),
    ("Ω", "Ohm"),
    ("\u{2126}", "Ohm"),
    ("µ", "u"),
    ("μ", "u"),
    ("·", "."),
    ("*", "."),
    ("¹", "1"),
    ("²", "2"),
    ("³", "3"),
    ("⁻", "-"),
    ("^", ""),
];

/// A unit's name in the notation here: `°C` becomes `degC`, `m/s²` becomes `m/s2`.
#[must_use]
pub fn spelled(name: &str) -> String {
    WRITTEN.iter().fold(name.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// A symbol to a power.
pub(super) type Factor<'a> = (&'a str, f64);

/// A unit's factors, above and below its slash.
pub(super) fn factors(name: &str) -> Result<[Vec<Factor<'_>>; 2], String> {
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
#[must_use]
pub fn per_second(name: &str) -> String {
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
