//! Names: which are allowed, and their form in Rust.

use std::collections::BTreeSet;

use unicode_ident::{is_xid_continue, is_xid_start};
use unicode_normalization::UnicodeNormalization as _;

use crate::error::Refusals;

/// Rust keywords, which cannot name fields.
const RESERVED: [&str; 51] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop",
    "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static",
    "struct", "super", "trait", "true", "try", "type", "typeof", "unsafe", "unsized", "use", "virtual",
    "where", "while", "yield",
];

/// The longest name, in bytes: longer ones are unreadable and slow to look up.
const LONGEST_NAME: usize = 200;

/// Rejects a name that occurs twice in a list.
pub(crate) fn unique(list: &str, names: impl IntoIterator<Item = String>, refusals: &mut Refusals) {
    let mut seen = BTreeSet::new();
    for (number, name) in names.into_iter().enumerate() {
        if seen.contains(&name) {
            refusals.add(format!("{list}[{number}].name"), format!("'{name}' is declared twice"));
        }
        seen.insert(name);
    }
}

pub(crate) fn length(name: &str) -> Result<(), String> {
    if name.len() <= LONGEST_NAME {
        return Ok(());
    }
    let start: String = name.chars().take(20).collect();
    Err(format!("'{start}…' is longer than {LONGEST_NAME} bytes"))
}

/// A type's name, `TypeName`.
pub(crate) fn type_name(name: &str) -> Result<(), String> {
    length(name)?;
    let upper = name.starts_with(|first: char| first.is_ascii_uppercase());
    if upper && name != "Self" && name.chars().all(|character| character.is_ascii_alphanumeric()) {
        return Ok(());
    }
    Err(format!("'{name}' is not of the form TypeName"))
}

/// A field's name, the same in Rust.
pub(crate) fn field_name(name: &str) -> Result<(), String> {
    length(name)?;
    let lower =
        |character: char| character.is_ascii_lowercase() || character.is_ascii_digit() || character == '_';
    if !name.starts_with(|first: char| first.is_ascii_lowercase()) || !name.chars().all(lower) {
        return Err(format!("'{name}' is not made of lower-case letters, digits and underscores"));
    }
    not_reserved(name, name)
}

/// A name in FMI, which another tool may dictate.
pub(crate) fn variable_name(name: &str) -> Result<(), String> {
    length(name)?;
    if name.is_empty() {
        return Err("it is empty".to_owned());
    }
    if name.contains(char::is_control) {
        return Err(format!("{name:?} has a tab, line break or another control character"));
    }
    Ok(())
}

/// The name of a type in Rust, unless the declaration has another: the name itself if it is of the form `TypeName`, else
/// that of a variable in Pascal case.
pub(crate) fn rust_type_name(name: &str) -> String {
    if type_name(name).is_ok() {
        return name.to_owned();
    }
    let rust = pascal_case(&rust_name(name));
    let is_usable = rust != "Self" && rust.starts_with(is_xid_start);
    if is_usable { rust } else { format!("Type{rust}") }
}

/// A variable's or component's name in Rust, unless the declaration has another: what Rust does not allow becomes `_`, then
/// snake case.
pub(crate) fn rust_name(name: &str) -> String {
    let allowed = |character| if is_xid_continue(character) { character } else { '_' };
    let mut rust = snake_case(&name.nfc().map(allowed).collect::<String>());
    if !rust.starts_with(|first| is_xid_start(first) || first == '_') {
        rust.insert(0, '_');
    }
    if RESERVED.contains(&rust.as_str()) || rust.chars().all(|character| character == '_') {
        rust.push('_');
    }
    rust
}

/// The name of a `Sampled` model's clock, which is in snake case in Rust.
pub(crate) fn clock_name(name: &str) -> Result<(), String> {
    made_of(name, |character| character == '_', "letters, digits and underscores")?;
    not_reserved(name, &snake_case(name))
}

/// The name of an enumeration's item, whose name in Rust is [`variant_name`].
pub(crate) fn item_name(name: &str) -> Result<(), String> {
    made_of(name, |character| "_ ".contains(character), "letters, digits, underscores and spaces")
}

/// A name that begins with a letter, and has letters, digits and some other characters.
fn made_of(name: &str, others: impl Fn(char) -> bool, description: &str) -> Result<(), String> {
    length(name)?;
    let allowed = |character: char| character.is_ascii_alphanumeric() || others(character);
    if name.starts_with(|first: char| first.is_ascii_alphabetic()) && name.chars().all(allowed) {
        return Ok(());
    }
    Err(format!("'{name}' is not made of {description}"))
}

fn not_reserved(name: &str, in_rust: &str) -> Result<(), String> {
    if RESERVED.contains(&in_rust) { Err(format!("'{name}' is a reserved word in Rust")) } else { Ok(()) }
}

/// `hpCompressor` and `HP compressor` as `hp_compressor`.
pub(crate) fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut after_lower = false;
    for character in name.chars() {
        if character.is_uppercase() && after_lower {
            snake.push('_');
        }
        after_lower = character.is_lowercase() || character.is_ascii_digit();
        snake.extend((if character == ' ' { '_' } else { character }).to_lowercase());
    }
    snake
}

/// The name of an enumeration's item in Rust. `Self` is the only reserved word in Pascal case.
pub(crate) fn variant_name(item: &str) -> String {
    let name = pascal_case(item);
    if name == "Self" { name + "_" } else { name }
}

/// `hp_compressor` and `hp compressor` as `HpCompressor`.
pub(crate) fn pascal_case(name: &str) -> String {
    name.split(['_', ' '])
        .flat_map(|word| {
            let mut characters = word.chars();
            let first = characters.next().map(|first| first.to_ascii_uppercase());
            first.into_iter().chain(characters)
        })
        .collect()
}
