//! Model identifiers, which name files.

/// Whether a text may be a model identifier: a C identifier (FMI 2.0.5, section 2.2.1).
#[must_use]
pub fn is_identifier(text: &str) -> bool {
    let is_letter = |byte: u8| byte.is_ascii_alphabetic() || byte == b'_';
    text.bytes().next().is_some_and(is_letter)
        && text.bytes().all(|byte| is_letter(byte) || byte.is_ascii_digit())
}

/// Whether Windows keeps a name for a device, so that no file can have it, whatever its extension.
#[must_use]
pub fn is_reserved_by_windows(name: &str) -> bool {
    let is_one_of = |text: &str, names: &[&str]| names.iter().any(|name| text.eq_ignore_ascii_case(name));
    match name.split_at_checked(3) {
        Some((device, "")) => is_one_of(device, &["con", "prn", "aux", "nul"]),
        Some((device, port)) if is_one_of(device, &["com", "lpt"]) => {
            port.len() == 1 && port.bytes().all(|digit| digit.is_ascii_digit())
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_of_windows_are_reserved_in_any_case() {
        for name in ["con", "PRN", "Aux", "nul", "com1", "COM9", "lpt0"] {
            assert!(is_reserved_by_windows(name), "{name}");
        }
        for name in ["conn", "com", "com10", "coma", "lpt", "console", "null", ""] {
            assert!(!is_reserved_by_windows(name), "{name}");
        }
    }
}
