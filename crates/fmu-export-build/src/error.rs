//! What is wrong in a declaration, and where.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use jsonc_parser::ast;
use jsonc_parser::common::Ranged as _;
use serde::de::DeserializeOwned;

/// Why nothing was generated: one or more findings, each with file, line and key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(Vec<Finding>);

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    file: PathBuf,
    line: Option<usize>,
    key: String,
    reason: String,
}

impl Error {
    /// What is wrong with a file as a whole.
    pub(crate) fn of_file(file: &Path, reason: impl fmt::Display) -> Self {
        Self(vec![Finding {
            file: file.to_owned(),
            line: None,
            key: String::new(),
            reason: reason.to_string(),
        }])
    }

    /// What is wrong in a line of a file.
    pub(crate) fn of_line(file: &Path, line: usize, reason: impl fmt::Display) -> Self {
        let reason = reason.to_string();
        Self(vec![Finding { file: file.to_owned(), line: Some(line), key: String::new(), reason }])
    }

    /// Everything that is wrong, in the order in which it was found.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.0
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<_> = self.0.iter().map(Finding::to_string).collect();
        formatter.write_str(&lines.join("\n"))
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:", self.file.display())?;
        if let Some(line) = self.line {
            write!(formatter, "{line}:")?;
        }
        if !self.key.is_empty() {
            write!(formatter, " {}:", self.key)?;
        }
        write!(formatter, " {}", self.reason)
    }
}

impl std::error::Error for Error {}

/// What a check refuses: the path of the key to blame, such as `variables[3].unit`, and the reason.
#[derive(Debug)]
pub(crate) struct Refusal {
    key: String,
    reason: String,
}

impl Refusal {
    pub(crate) fn new(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { key: key.into(), reason: reason.into() }
    }
}

/// Refusals that are collected, to be told all at once: of each key the first, as what is wrong in a component type
/// is wrong in all its components.
#[derive(Debug, Default)]
pub(crate) struct Refusals {
    found: Vec<Refusal>,
    keys: BTreeSet<String>,
}

impl Refusals {
    pub(crate) fn add(&mut self, key: impl Into<String>, reason: impl Into<String>) {
        self.push(Refusal::new(key, reason));
    }

    fn push(&mut self, refusal: Refusal) {
        if self.keys.insert(refusal.key.clone()) {
            self.found.push(refusal);
        }
    }

    /// The value of what was not refused.
    pub(crate) fn take<T>(&mut self, result: Result<T, Refusal>) -> Option<T> {
        result.map_err(|refusal| self.push(refusal)).ok()
    }

    /// Ends a round of checks whose results the next ones need.
    pub(crate) fn check(&mut self) -> Result<(), Self> {
        if self.found.is_empty() { Ok(()) } else { Err(std::mem::take(self)) }
    }
}

impl IntoIterator for Refusals {
    type Item = Refusal;
    type IntoIter = std::vec::IntoIter<Refusal>;

    fn into_iter(self) -> Self::IntoIter {
        self.found.into_iter()
    }
}

/// The lines of a text, by the positions of its line breaks.
pub(crate) struct Lines(Vec<usize>);

impl Lines {
    pub(crate) fn new(text: &str) -> Self {
        Self(text.match_indices('\n').map(|(position, _)| position).collect())
    }

    /// The line that a position is in.
    pub(crate) fn of(&self, position: usize) -> usize {
        1 + self.0.partition_point(|&line_break| line_break < position)
    }
}

/// A file of JSON that was read.
pub(crate) struct Source {
    file: PathBuf,
    text: String,
}

impl Source {
    /// Reads a file of the schema `T`.
    pub(crate) fn read<T: DeserializeOwned>(file: &Path) -> Result<(T, Self), Error> {
        let text = fs::read_to_string(file).map_err(|error| Error::of_file(file, error))?;
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
            Err((key, error)) => {
                // The position has a place of its own in a finding.
                let position = format!(" at line {} column {}", error.line(), error.column());
                let reason = error.to_string();
                let reason = reason.strip_suffix(&position).unwrap_or(&reason);
                let reason = plain(reason);
                if error.is_data() {
                    let key = key.trim_end_matches(".?").trim_start_matches(['.', '?']);
                    return Err(source.error([Refusal::new(key, reason)]));
                }
                // Not JSON: there are no keys yet.
                Err(Error::of_line(file, error.line(), reason))
            }
        }
    }

    /// Refusals of this file's content.
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

/// Where in a text the value of a path stands, or else the innermost one around it that is there.
fn offset(root: &ast::Value<'_>, path: &str) -> usize {
    let (mut value, mut start) = (root, root.start());
    for segment in path.split(['.', '[']) {
        let next = match (value, segment.strip_suffix(']')) {
            (ast::Value::Array(array), Some(index)) => index
                .parse()
                .ok()
                .and_then(|index: usize| array.elements.get(index))
                .map(|next| (next, next.start())),
            (ast::Value::Object(object), None) => {
                object.get(segment).map(|property| (&property.value, property.start()))
            }
            _ => None,
        };
        let Some(found) = next else { break };
        (value, start) = found;
    }
    start
}

/// Serde's reason in the words of those who write JSON, with the word that is likely meant by an unknown one.
fn plain(reason: &str) -> String {
    let reason = reason.replace('`', "'").replace("unknown field", "unknown key");
    let reason = reason.replace("unknown variant", "unknown value").replace("missing field", "missing key");
    let Some((found, expected)) = reason.rsplit_once(", expected ") else { return reason };
    if found.starts_with("unknown ") {
        let words: Vec<_> = reason.split('\'').skip(1).step_by(2).map(str::to_owned).collect();
        let nearest = words.split_first().map(|(word, known)| nearest(word, known.iter().cloned()));
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
        "i32" => "a whole number",
        _ if expected.starts_with("struct ") => "an object",
        _ => expected,
    };
    format!("expected {expected}, found {found}")
}

/// The known name that is most like one, as the end of a message; nothing where none is like it.
pub(crate) fn nearest(name: &str, known: impl Iterator<Item = String>) -> String {
    let distance = |other: &str| {
        let lower = strsim::osa_distance(&name.to_lowercase(), &other.to_lowercase());
        (lower, strsim::osa_distance(name, other), other.len())
    };
    let is_like = |other: &str| 3 * distance(other).0 <= name.chars().count().max(other.chars().count()) + 1;
    known
        .filter(|known| is_like(known))
        .min_by_key(|known| distance(known))
        .map_or_else(String::new, |known| format!("; the nearest is '{known}'"))
}
