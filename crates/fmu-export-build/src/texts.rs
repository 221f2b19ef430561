//! Free texts, which become XML attributes and comments in Rust.

/// The marks rejected by rustc's lint `text_direction_codepoint_in_comment`: with them, an editor displays a text
/// other than the actual one.
const DIRECTION_OF_WRITING: [char; 9] = [
    '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}', '\u{2067}', '\u{2068}',
    '\u{2069}',
];

/// Rejects an empty text, and one that XML or Rust would change.
pub(crate) fn one_line(text: &str) -> Result<(), String> {
    let reason = if text.trim().is_empty() {
        "the text is empty"
    } else if !survives_xml(text) {
        "the text contains a character that XML does not preserve, such as a line break"
    } else if text.contains(DIRECTION_OF_WRITING) {
        "the text contains a bidirectional control character, which Rust rejects"
    } else {
        return Ok(());
    };
    Err(reason.to_owned())
}

/// Whether an XML attribute preserves a text: tabs and line breaks become spaces, and most other control characters
/// and two Unicode code points are not allowed in XML at all.
pub(crate) fn survives_xml(text: &str) -> bool {
    !text.chars().any(|character| character.is_control() || matches!(character, '\u{fffe}' | '\u{ffff}'))
}
