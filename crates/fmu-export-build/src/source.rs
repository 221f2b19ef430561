//! JSON files: the findings of the parser, and the line of each key.

use std::fs;
use std::path::{Path, PathBuf};

use jsonc_parser::ast;
use jsonc_parser::common::Ranged as _;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::error::{Error, Finding, Refusal, nearest};

/// How often a file is read to find everything that the parser rejects.
const MOST_READINGS: usize = 50;

/// A text's lines, by the positions of its line breaks.
pub(crate) struct Lines(Vec<usize>);

impl Lines {
    pub(crate) fn new(text: &str) -> Self {
        Self(text.match_indices('\n').map(|(position, _)| position).collect())
    }

    /// The line of a position.
    pub(crate) fn of(&self, position: usize) -> usize {
        1 + self.0.partition_point(|&line_break| line_break < position)
    }
}

/// A JSON file that was read.
pub(crate) struct Source {
    file: PathBuf,
    text: String,
}

impl Source {
    /// Reads a file with the schema `T`.
    pub(crate) fn read<T: DeserializeOwned>(file: &Path) -> Result<(T, Self), Error> {
        let text = fs::read_to_string(file).map_err(|error| Error::of_file(file, error))?;
        // Some editors put a byte order mark first.
        let text = text.strip_prefix('\u{feff}').map_or(text.clone(), str::to_owned);
        let deserializer = &mut serde_json::Deserializer::from_str(&text);
        let value = serde_path_to_error::deserialize(&mut *deserializer).map_err(|error| {
            let key = error.path().to_string();
            (key, error.into_inner())
        });
        let value = value.and_then(|value| match deserializer.end() {
            Ok(()) => Ok(value),
            Err(error) => Err((String::new(), error)),
        });
        let source = Self { file: file.to_owned(), text };
        match value {
            Ok(value) => Ok((value, source)),
            Err((key, error)) if error.is_data() => Err(source.error(source.all::<T>(refusal(&key, &error)))),
            // Not JSON: there are no keys yet.
            Err((key, error)) => Err(Error::of_line(file, error.line(), refusal(&key, &error).reason)),
        }
    }

    /// All the parser's rejections, of which it reports only the first: rereads the file without the rejected parts.
    fn all<T: DeserializeOwned>(&self, first: Refusal) -> Vec<Refusal> {
        let Ok(written) = serde_json::from_str::<Value>(&self.text) else { return vec![first] };
        let (mut content, mut refusals, mut next) = (written.clone(), Vec::new(), first);
        for _ in 0..MOST_READINGS {
            let missing = next.reason.strip_prefix("missing key '").and_then(|key| key.strip_suffix('\''));
            let place = missing.map_or(next.key.clone(), |missing| format!("{}.{missing}", next.key));
            // A key that the file has is missing only because it was rejected and removed.
            if missing.is_none() || written.pointer(&pointer(&place)).is_none() {
                refusals.push(next);
            }
            if !mend(&mut content, &place) {
                break;
            }
            let Err(error) = serde_path_to_error::deserialize::<_, T>(&content) else { break };
            next = refusal(&error.path().to_string(), error.inner());
        }
        refusals
    }

    /// Rejections of this file's content.
    pub(crate) fn error(&self, refusals: impl IntoIterator<Item = Refusal>) -> Error {
        let parsed = jsonc_parser::parse_to_ast(
            &self.text,
            &jsonc_parser::CollectOptions::default(),
            &jsonc_parser::ParseOptions::default(),
        );
        let root = parsed.ok().and_then(|parsed| parsed.value);
        let lines = Lines::new(&self.text);
        let findings = refusals.into_iter().map(|Refusal { key, reason }| {
            let line = root.as_ref().map(|root| lines.of(offset(root, &key)));
            Finding { file: self.file.clone(), line, key, reason }
        });
        let mut findings: Vec<_> = findings.collect();
        findings.sort_by_key(|finding| finding.line);
        Error(findings)
    }
}

/// Removes the value at a path, its innermost one with a key, or inserts one if there is none. Returns whether the
/// place exists.
fn mend(content: &mut Value, mut path: &str) -> bool {
    while let Some((list, _)) = path.strip_suffix(']').and_then(|path| path.rsplit_once('[')) {
        path = list;
    }
    let (around, key) = path.rsplit_once('.').unwrap_or(("", path));
    let around = content.pointer_mut(&pointer(around)).and_then(Value::as_object_mut);
    let Some(around) = around.filter(|_| !key.is_empty()) else { return false };
    if around.remove(key).is_none() {
        let is_list = matches!(key, "items" | "variables");
        around.insert(key.to_owned(), if is_list { Value::Array(vec![]) } else { key.into() });
    }
    true
}

/// The JSON pointer of a path.
fn pointer(path: &str) -> String {
    let segments = path.split(['.', '[']).filter(|segment| !segment.is_empty());
    segments.fold(String::new(), |pointer, segment| pointer + "/" + segment.trim_end_matches(']'))
}

/// The parser's rejection.
fn refusal(key: &str, error: &serde_json::Error) -> Refusal {
    // A finding states the position separately.
    let position = format!(" at line {} column {}", error.line(), error.column());
    let reason = error.to_string();
    let reason = reason.strip_suffix(&position).unwrap_or(&reason);
    Refusal::new(key.trim_end_matches(".?").trim_start_matches(['.', '?']), plain(reason))
}

/// The position in a text of the value at a path, or of the innermost existing one around it.
fn offset(root: &ast::Value<'_>, path: &str) -> usize {
    let (mut value, mut start) = (root, root.start());
    for segment in path.split(['.', '[']) {
        let next = match (value, segment.strip_suffix(']')) {
            (ast::Value::Array(array), Some(index)) => index
                .parse()
                .ok()
                .and_then(|index: usize| array.elements.get(index))
                .map(|next| (next, next.start())),
            // The last key may have dots: a variable's name.
            (ast::Value::Object(object), None) => object
                .get(segment)
                .or_else(|| {
                    object
                        .properties
                        .iter()
                        .find(|property| path.ends_with(&format!(".{}", property.name.as_str())))
                })
                .map(|property| (&property.value, property.start())),
            _ => None,
        };
        let Some(found) = next else { break };
        (value, start) = found;
    }
    start
}

/// Serde's reason in the terms of JSON, with a suggestion for an unknown word.
fn plain(reason: &str) -> String {
    let reason = reason.replace('`', "'").replace("unknown field", "unknown key");
    let reason = reason.replace("unknown variant", "unknown value").replace("missing field", "missing key");
    let Some((found, expected)) = reason.rsplit_once(", expected ") else { return reason };
    if found.starts_with("unknown ") {
        let words: Vec<_> = reason.split('\'').skip(1).step_by(2).map(str::to_owned).collect();
        let nearest = words.split_first().map(|(word, known)| nearest(word, known));
        if words.len() > 1 && words[0] == "state" && words.iter().any(|word| word == "calculatedParameter") {
            return format!("{found}; a state is a variable with the key 'derivative'");
        }
        return nearest
            .filter(|nearest| !nearest.is_empty())
            .map_or(reason.clone(), |nearest| format!("{found}{nearest}"));
    }
    let Some(found) = found.strip_prefix("invalid type: ").or_else(|| found.strip_prefix("invalid value: "))
    else {
        return reason;
    };
    let found = match found {
        "sequence" => "a list",
        "map" => "an object",
        _ => found,
    };
    let expected = match expected {
        "a sequence" => "a list",
        "f64" => "a number",
        "u32" => "a whole number from 0 to 4294967295",
        "usize" => "a whole number that is not negative",
        "i32" | "i64" => "a whole number",
        _ if expected.starts_with("struct ") => "an object",
        _ => expected,
    };
    format!("expected {expected}, found {found}")
}
