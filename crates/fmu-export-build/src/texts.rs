//! Free texts, which become XML attributes and comments in Rust.

/// The marks rejected by rustc's lint `text_direction_codepoint_in_comment`: with them, an editor displays code other
/// than the actual one.
const DIRECTION_OF_WRITING: [char; 9] = [
    '\u{202a}', '\u{202b}', '\u{202c}', '\u{202d}', '\u{202e}', '\u{2066}', '\u{2067}', '\u{2068}',
    '\u{2069}',
];

/// Tabs and line breaks, which XML preserves by their numbers.
const WHITE_SPACE: [char; 3] = ['\t', '\n', '\r'];

/// Rejects an empty text, and one that XML would change.
pub(crate) fn text(text: &str) -> Result<(), String> {
    if text.trim().is_empty() {
        return Err("the text is empty".to_owned());
    }
    if let Some(lost) = lost_in_xml(text) {
        return Err(format!("the text contains {lost}, which XML does not preserve"));
    }
    Ok(())
}

/// A text for a comment in Rust: marks of the direction of writing are escaped, such as `\u{202a}`.
pub(crate) fn comment(text: &str) -> String {
    text.chars().fold(String::new(), |mut comment, character| {
        if DIRECTION_OF_WRITING.contains(&character) {
            comment.extend(character.escape_unicode());
        } else {
            comment.push(character);
        }
        comment
    })
}

/// Rejects a name that is not a text on one line.
pub(crate) fn label(name: &str) -> Result<(), String> {
    text(name)?;
    if name.contains(WHITE_SPACE) {
        return Err("the name contains a tab or a line break".to_owned());
    }
    Ok(())
}

/// The code point that an XML attribute does not preserve, if the text has one: most control characters and two
/// others are not allowed in XML, or are discouraged.
pub(crate) fn lost_in_xml(text: &str) -> Option<String> {
    let is_lost = |character: &char| {
        character.is_control() && !WHITE_SPACE.contains(character)
            || matches!(character, '\u{fffe}' | '\u{ffff}')
    };
    text.chars().find(is_lost).map(|lost| format!("U+{:04X}", u32::from(lost)))
}
