//! Model identifiers.

use std::io;

use fmu_io::reading::broken;
use fmu_io::terminal::in_line;
use fmu_terms::is_identifier;

/// The attribute with the name of the FMU's library.
pub(crate) const IDENTIFIER: &str = "modelIdentifier";

/// Rejects a model identifier that is not a C identifier (FMI 2.0.5, section 2.2.1).
///
/// # Errors
/// When it is not.
pub fn refuse_no_identifier(text: &str) -> io::Result<()> {
    if is_identifier(text) {
        return Ok(());
    }
    Err(broken(format!("the modelIdentifier '{}' is not a C identifier", in_line(text))))
}

/// Rejects a model identifier that cannot be in the name of a file of its FMU. Some FMUs have one with a hyphen, whose
/// library can be found.
pub(crate) fn refuse_no_file_name(text: &str) -> io::Result<()> {
    let is_part = |letter: char| !letter.is_control() && !"/\\:".contains(letter);
    if text.chars().all(is_part) && !text.trim_matches(['.', ' ']).is_empty() {
        return Ok(());
    }
    refuse_no_identifier(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_identifier_is_a_c_identifier() {
        for identifier in ["Lag", "_1", "a"] {
            assert!(refuse_no_identifier(identifier).is_ok(), "{identifier}");
        }
        for (identifier, shown) in [
            ("", ""),
            ("1a", "1a"),
            ("a b", "a b"),
            ("../a", "../a"),
            ("\u{e9}", "\u{e9}"),
            ("a\n\u{1b}[2J", r"a\n\u{1b}[2J"),
        ] {
            let refusal = refuse_no_identifier(identifier).unwrap_err().to_string();
            assert_eq!(refusal, format!("the modelIdentifier '{shown}' is not a C identifier"));
        }
    }

    #[test]
    fn a_file_name_stays_in_its_folder() {
        for name in ["Lag", "two-tanks", "a b", "1.5", "\u{e9}"] {
            assert!(refuse_no_file_name(name).is_ok(), "{name}");
        }
        for name in ["", " ", ".", "..", "../a", "a/b", "a\\b", "c:a", "a\nb", "a\0"] {
            assert!(refuse_no_file_name(name).is_err(), "{name:?}");
        }
    }
}
