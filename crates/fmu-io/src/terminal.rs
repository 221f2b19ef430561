//! Output of commands. Texts from descriptions, messages and file names are not trusted: control characters are
//! escaped.

use std::env;
use std::fmt::Write as _;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// The command with which users call the commands of `cargo fmu`: `fmu`, as Python's package installs it, or
/// `cargo fmu`.
#[must_use]
pub fn program() -> &'static str {
    let called = env::args_os().next();
    if called.is_some_and(|path| Path::new(&path).file_stem() == Some("fmu".as_ref())) {
        "fmu"
    } else {
        CARGO_FMU
    }
}

/// The command by which cargo calls it.
pub const CARGO_FMU: &str = "cargo fmu";

/// Prints a text. The reader may close the pipe early, as `head` does.
///
/// # Errors
/// When it cannot be printed.
pub fn print(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(printable(text).as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(io::Error::new(error.kind(), format!("cannot print: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// Prints an error or a warning on its own line.
pub fn complain(text: &str) {
    // There is nowhere else to report it.
    let _ = writeln!(io::stderr().lock(), "{}", printable(text));
}

/// A text with control characters escaped, including bidirectional ones. Line breaks and tabs stay.
#[must_use]
pub fn printable(text: &str) -> String {
    escaped(&text.replace("\r\n", "\n"), |character| matches!(character, '\n' | '\t'))
}

/// A text for one line: all control characters are escaped, including line breaks and tabs.
#[must_use]
pub fn in_line(text: &str) -> String {
    escaped(text, |_| false)
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> String {
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        // Unicode's embeddings, overrides and isolates (UAX #9, section 2).
        let turns = matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        if (character.is_control() || turns) && !stays(character) {
            // Writing to a `String` cannot fail.
            let _ = write!(printable, "{}", character.escape_default());
        } else {
            printable.push(character);
        }
    }
    printable
}

/// The shortest form of a number that reads back the same, with an exponent instead of many zeros.
#[must_use]
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        let text = "\u{1b}]0;title\u{7} \u{9b}31m \u{202e}txet é \u{fc} C:\\a 'b'\n\tc\r\nd\re";
        let shown = "\\u{1b}]0;title\\u{7} \\u{9b}31m \\u{202e}txet é \u{fc} C:\\a 'b'\n\tc\nd\\re";
        assert_eq!(printable(text), shown);
        assert_eq!(in_line("a\nb\t\u{1b}[2J"), "a\\nb\\t\\u{1b}[2J");
    }

    #[test]
    fn numbers_are_short_and_read_back() {
        let cases = [
            (0.0, "0"),
            (1e-5, "0.00001"),
            (-1.5, "-1.5"),
            (101_325.0, "101325"),
            (1e15, "1000000000000000"),
            (1e308, "1e308"),
            (f64::MIN_POSITIVE, "2.2250738585072014e-308"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
