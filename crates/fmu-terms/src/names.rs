//! Structured names (FMI 2.0.5, section 2.2.9; FMI 3.0.2, section 2.4.7.5.1).

/// What a quoted part has besides letters, digits and `_`, and after a backslash.
const QUOTED: &str = "!#$%&()*+,-./:;<>=?@[]^{}|~ ";
const ESCAPED: &str = "'\"?\\abfnrtv";

/// Whether a variable's name follows the naming convention `structured`: parts between dots, each with subscripts if it
/// is an element of an array, or such a name in `der(…)`.
#[must_use]
pub fn is_structured(name: &str) -> bool {
    let is_derivative = || {
        let rest = identifier(name.strip_prefix("der(")?)?;
        Some(rest.strip_prefix(',').map_or(Some(rest), number)? == ")")
    };
    identifier(name).is_some_and(str::is_empty) || is_derivative() == Some(true)
}

/// What follows an identifier; none if a text does not begin with one.
fn identifier(text: &str) -> Option<&str> {
    let mut rest = part(text)?;
    loop {
        if let Some(subscripts) = rest.strip_prefix('[') {
            rest = number(subscripts)?;
            while let Some(further) = rest.strip_prefix(',') {
                rest = number(further)?;
            }
            rest = rest.strip_prefix(']')?;
        }
        let Some(next) = rest.strip_prefix('.') else { return Some(rest) };
        rest = part(next)?;
    }
}

/// What follows a part of an identifier, which is quoted or has letters, digits and `_` alone.
fn part(text: &str) -> Option<&str> {
    let is_letter = |character: char| character.is_ascii_alphabetic() || character == '_';
    let is_plain = |character: char| is_letter(character) || character.is_ascii_digit();
    if text.starts_with(is_letter) {
        return Some(text.trim_start_matches(is_plain));
    }
    let mut characters = text.strip_prefix('\'')?.chars();
    let mut is_empty = true;
    loop {
        match characters.next()? {
            '\'' if is_empty => return None,
            '\'' => return Some(characters.as_str()),
            '\\' if !ESCAPED.contains(characters.next()?) => return None,
            '\\' => {}
            character if !is_plain(character) && !QUOTED.contains(character) => return None,
            _ => {}
        }
        is_empty = false;
    }
}

/// What follows an unsigned integer.
fn number(text: &str) -> Option<&str> {
    let rest = text.trim_start_matches(|character: char| character.is_ascii_digit());
    (rest.len() < text.len()).then_some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names_follow_the_grammar() {
        // The standard's examples, further ones, and what it excludes.
        for name in [
            "vehicle.engine.speed",
            "resistor12.u",
            "v_min",
            "robot.axis.'motor #234'",
            "der(pipe[3,4].T[14],2)",
            "in",
            "X",
            "_1",
            "'1st'.x[1]",
            r"a.'it\'s [2] \\ ok'",
            "der",
        ] {
            assert!(is_structured(name), "{name}");
        }
        for name in [
            "",
            "1a",
            "a b",
            "a..b",
            ".a",
            "a.",
            "é",
            "'ä'",
            "''",
            "'a",
            "a'",
            r"'\x'",
            "a[]",
            "a[i]",
            "a[1",
            "a[1,]",
            "a[1, 2]",
            "a[1][2]",
            "der(a",
            "der(a,)",
            "der(a, 2)",
            "der(a)y",
            "a.der(b)",
            "der(der(a))",
            "a-b",
            "x\n",
        ] {
            assert!(!is_structured(name), "{name}");
        }
    }
}
