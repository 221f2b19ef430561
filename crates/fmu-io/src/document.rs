//! Reads a TOML file value by value: a scenario, connections, or a file of your own. Errors are reported with file,
//! line and key.
//!
//! In each function, `expected` describes a valid value, for the message: `a number above 0, in m`.
//!
//! ```
//! use fmu_io::document::Document;
//!
//! let document = Document::parse("study.toml", "runs = 3\nseeds = 1")?;
//! let root = document.root();
//! let runs: usize = root.required("runs", "the number of runs")?.integer("a whole number")?;
//! assert_eq!(runs, 3);
//! assert!(root.finish().unwrap_err().to_string().starts_with("study.toml, line 2, seeds: this key is not known"));
//! # Ok::<(), anyhow::Error>(())
//! ```

use std::cell::RefCell;
use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Error, Result, anyhow, bail};
use fmu_terms::{like, nearest};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A location in a file, or an argument of the command line.
#[derive(Clone, Debug)]
pub struct Location {
    /// The file, or the argument.
    source: Arc<str>,
    /// Line and key in the file.
    place: Option<(usize, String)>,
}

impl Location {
    /// An argument of the command line, or any other text with which a message begins.
    #[must_use]
    pub fn argument(text: &str) -> Self {
        Self { source: text.into(), place: None }
    }

    /// Whether the location is an argument of this text.
    #[must_use]
    pub fn is_argument(&self, text: &str) -> bool {
        self.place.is_none() && *self.source == *text
    }

    /// The line in the file, from 1 on; none for an argument.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.place.as_ref().map(|(line, _)| *line)
    }

    /// An error with its location.
    pub fn error(&self, message: impl Display) -> Error {
        match &self.place {
            Some((line, key)) => anyhow!("{}, line {line}, {key}: {message}", self.source),
            None => anyhow!("{}: {message}", self.source),
        }
    }

    /// Puts the location before an error's message. The error no longer downcasts.
    ///
    /// # Errors
    /// When the result is an error.
    pub fn locate<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|error| self.error(format!("{error:#}")))
    }

    /// The location of a value below this one.
    fn child(&self, key: impl Display, line: usize) -> Self {
        Self { source: Arc::clone(&self.source), place: Some((line, key.to_string())) }
    }
}

/// The largest TOML file in bytes: parsing takes up to a hundred times as much memory.
const LARGEST: usize = 1 << 20;

/// A TOML file.
pub struct Document<'a> {
    /// The places of its line breaks.
    line_breaks: Vec<usize>,
    file: Arc<str>,
    root: Spanned<DeTable<'a>>,
    /// The files whose paths were read.
    files: RefCell<Vec<PathBuf>>,
}

impl<'a> Document<'a> {
    /// Reads a text; `file` is its name in messages.
    ///
    /// # Errors
    /// When it is not TOML, or larger than 1 MiB.
    pub fn parse(file: &str, text: &'a str) -> Result<Self> {
        if text.len() > LARGEST {
            bail!("{file} is larger than {LARGEST} bytes; long signals are columns of CSV files");
        }
        let line_breaks: Vec<_> = text.match_indices('\n').map(|(place, _)| place).collect();
        let root = DeTable::parse(text).map_err(|error| {
            let line = line(&line_breaks, &error.span().unwrap_or_default());
            anyhow!("{file}, line {line}: {}", error.message())
        })?;
        Ok(Self { line_breaks, file: file.into(), root, files: RefCell::default() })
    }

    /// All paths that were read.
    #[must_use]
    pub fn into_files(self) -> Vec<PathBuf> {
        self.files.into_inner()
    }

    /// The table of the whole file.
    #[must_use]
    pub fn root(&self) -> TomlTable<'_> {
        let location = Location { source: Arc::clone(&self.file), place: Some((1, "the file".to_owned())) };
        TomlTable {
            document: self,
            table: self.root.get_ref(),
            path: String::new(),
            location,
            known: RefCell::default(),
        }
    }
}

fn line(line_breaks: &[usize], span: &Range<usize>) -> usize {
    1 + line_breaks.partition_point(|&place| place < span.start)
}

/// A table, and which keys were read.
pub struct TomlTable<'a> {
    document: &'a Document<'a>,
    table: &'a DeTable<'a>,
    path: String,
    location: Location,
    known: RefCell<Vec<String>>,
}

impl<'a> TomlTable<'a> {
    /// Where the table is.
    #[must_use]
    pub fn location(&self) -> &Location {
        &self.location
    }

    /// A value that may be missing.
    #[must_use]
    pub fn optional(&self, key: &str) -> Option<Node<'a>> {
        self.known.borrow_mut().push(key.to_owned());
        let (key, value) = self.table.get_key_value(key)?;
        Some(self.node(key.get_ref(), value))
    }

    /// The text under the key `title`: the subject of the file.
    ///
    /// # Errors
    /// When it is not a text.
    pub fn title(&self) -> Result<Option<&'a str>> {
        self.optional("title").map(|title| title.string("a text")).transpose()
    }

    /// A required value. If it is missing and there is a similar key, that key is misspelt.
    ///
    /// # Errors
    /// When it is missing.
    pub fn required(&self, key: &str, expected: &str) -> Result<Node<'a>> {
        self.optional(key).ok_or_else(|| {
            let known = self.known.borrow();
            let unread = self.table.keys().map(|other| other.get_ref().as_ref());
            let unread = unread.filter(|other| !known.iter().any(|read| read == other));
            match nearest(key, unread).and_then(|other| self.table.get_key_value(other)) {
                Some((other, value)) => {
                    let location = self.node(other.get_ref(), value).location;
                    location.error(format!("this key is not known; did you mean {key}?"))
                }
                None => self.location.error(format!("{key} is missing: {expected}")),
            }
        })
    }

    /// All values with their keys, in the order of the file.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, Node<'a>)> {
        self.table.iter().map(|(key, value)| {
            self.known.borrow_mut().push(key.get_ref().as_ref().to_owned());
            (key.get_ref().as_ref(), self.node(key.get_ref(), value))
        })
    }

    /// Refuses keys that were not read.
    ///
    /// # Errors
    /// When there is one.
    pub fn finish(self) -> Result<()> {
        let known = self.known.borrow();
        for (key, value) in self.table {
            let key = key.get_ref().as_ref();
            if !known.iter().any(|known| known == key) {
                let node = self.node(key, value);
                return Err(node
                    .location
                    .error(format!("this key is not known{}", like(key, known.iter().map(String::as_str)))));
            }
        }
        Ok(())
    }

    fn node(&self, key: &str, value: &'a Spanned<DeValue<'a>>) -> Node<'a> {
        let key = if key.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
            key.to_owned()
        } else {
            format!("\"{key}\"")
        };
        let path = if self.path.is_empty() { key } else { format!("{}.{key}", self.path) };
        Node::new(self.document, value, path, &self.location)
    }
}

/// A value with its location.
pub struct Node<'a> {
    document: &'a Document<'a>,
    value: &'a DeValue<'a>,
    path: String,
    location: Location,
}

impl<'a> Node<'a> {
    fn new(
        document: &'a Document<'a>,
        value: &'a Spanned<DeValue<'a>>,
        path: String,
        parent: &Location,
    ) -> Self {
        let location = parent.child(&path, line(&document.line_breaks, &value.span()));
        Self { document, value: value.get_ref(), path, location }
    }

    /// Where the value is.
    #[must_use]
    pub fn location(&self) -> &Location {
        &self.location
    }

    /// The value itself.
    #[must_use]
    pub fn value(&self) -> &'a DeValue<'a> {
        self.value
    }

    /// The error for an unexpected value: what was expected, and what was found.
    #[must_use]
    pub fn unexpected(&self, expected: &str) -> Error {
        let found = match self.value {
            DeValue::String(text) => format!("the text \"{text}\""),
            DeValue::Integer(number) => number.as_str().to_owned(),
            DeValue::Float(number) => number.as_str().to_owned(),
            DeValue::Boolean(value) => value.to_string(),
            DeValue::Datetime(_) => "a date".to_owned(),
            DeValue::Array(list) => format!("a list of {}", list.len()),
            DeValue::Table(_) => "a table".to_owned(),
        };
        self.location.error(format!("expected {expected}, found {found}"))
    }

    /// A finite number.
    ///
    /// # Errors
    /// When it is something else.
    pub fn number(&self, expected: &str) -> Result<f64> {
        let text = match self.value {
            DeValue::Float(number) => number.as_str(),
            DeValue::Integer(number) if number.radix() == 10 => number.as_str(),
            _ => return Err(self.unexpected(expected)),
        };
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.unexpected(expected))
    }

    /// A finite number above zero.
    ///
    /// # Errors
    /// When it is something else.
    pub fn positive(&self, expected: &str) -> Result<f64> {
        let number = self.number(expected)?;
        if number > 0.0 { Ok(number) } else { Err(self.unexpected(expected)) }
    }

    /// A whole decimal number in the range of `T`.
    ///
    /// # Errors
    /// When it is something else.
    pub fn integer<T: std::str::FromStr>(&self, expected: &str) -> Result<T> {
        match self.value {
            DeValue::Integer(number) if number.radix() == 10 => number.as_str().parse().ok(),
            _ => None,
        }
        .ok_or_else(|| self.unexpected(expected))
    }

    /// A text.
    ///
    /// # Errors
    /// When it is something else.
    pub fn string(&self, expected: &str) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.unexpected(expected))
    }

    /// The path of a file, relative to a folder.
    ///
    /// # Errors
    /// When it is not a text.
    pub fn path(&self, expected: &str, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(self.string(expected)?);
        self.document.files.borrow_mut().push(path.clone());
        Ok(path)
    }

    /// A table.
    ///
    /// # Errors
    /// When it is something else.
    pub fn table(&self, expected: &str) -> Result<TomlTable<'a>> {
        let DeValue::Table(table) = self.value else { return Err(self.unexpected(expected)) };
        Ok(TomlTable {
            document: self.document,
            table,
            path: self.path.clone(),
            location: self.location.clone(),
            known: RefCell::default(),
        })
    }

    /// A list; its first value is `[1]` in messages.
    ///
    /// # Errors
    /// When it is something else.
    pub fn list(&self, expected: &str) -> Result<Vec<Node<'a>>> {
        let DeValue::Array(list) = self.value else { return Err(self.unexpected(expected)) };
        let node = |(index, value)| {
            Node::new(self.document, value, format!("{}[{}]", self.path, index + 1), &self.location)
        };
        Ok(list.iter().enumerate().map(node).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parser takes much memory for brackets.
    #[test]
    fn a_file_of_a_mebibyte_is_read_and_no_larger_one() {
        let text = |length: usize| format!("title = \"{}\"", "x".repeat(length - 10));
        assert!(Document::parse("a.toml", &text(1 << 20)).is_ok());
        let refusal = Document::parse("a.toml", &"[".repeat((1 << 20) + 1)).err().unwrap().to_string();
        assert!(refusal.starts_with("a.toml is larger than 1048576 bytes"), "{refusal}");
    }
}
