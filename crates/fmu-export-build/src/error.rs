//! What is wrong in a declaration, and where.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// The reason why nothing was generated: one or more findings, each with file, line and key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(pub(crate) Vec<Finding>);

/// One problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub(crate) file: PathBuf,
    pub(crate) line: Option<usize>,
    pub(crate) key: String,
    pub(crate) reason: String,
}

impl Error {
    fn new(file: &Path, line: Option<usize>, reason: &impl fmt::Display) -> Self {
        let (file, key, reason) = (file.to_owned(), String::new(), reason.to_string());
        Self(vec![Finding { file, line, key, reason }])
    }

    /// A problem with a file as a whole.
    pub(crate) fn of_file(file: &Path, reason: impl fmt::Display) -> Self {
        Self::new(file, None, &reason)
    }

    /// A problem in a line of a file.
    pub(crate) fn of_line(file: &Path, line: usize, reason: impl fmt::Display) -> Self {
        Self::new(file, Some(line), &reason)
    }

    /// All problems, in the order found.
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

impl Finding {
    /// As [`Display`](fmt::Display) shows it, in one line: a rejected name may contain a line break.
    #[must_use]
    pub fn in_one_line(&self) -> String {
        self.to_string().replace('\n', " ")
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

/// A check's rejection: the path of the key at fault, such as `variables[3].unit`, and the reason.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub(crate) key: String,
    pub(crate) reason: String,
}

/// The rejection of a variable whose path the caller adds: the key, such as `unit`, and the reason.
pub(crate) type Blame = (&'static str, String);

/// Rejects a variable's key if it is wrong.
pub(crate) fn refuse_if(is_wrong: bool, key: &'static str, reason: impl fmt::Display) -> Result<(), Blame> {
    if is_wrong { Err((key, reason.to_string())) } else { Ok(()) }
}

impl Refusal {
    pub(crate) fn new(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { key: key.into(), reason: reason.into() }
    }
}

/// Rejections collected for a single report. Only the first for each key is kept, because a problem of a component type
/// affects all its components.
#[derive(Debug, Default)]
pub(crate) struct Refusals {
    found: Vec<Refusal>,
    keys: BTreeSet<String>,
}

impl Refusals {
    pub(crate) fn add(&mut self, key: impl Into<String>, reason: impl Into<String>) {
        self.push(Refusal::new(key, reason));
    }

    /// Adds a check's reason, if it has one.
    pub(crate) fn require(&mut self, key: impl Into<String>, result: Result<(), String>) {
        if let Err(reason) = result {
            self.add(key, reason);
        }
    }

    fn push(&mut self, refusal: Refusal) {
        if self.keys.insert(refusal.key.clone()) {
            self.found.push(refusal);
        }
    }

    /// The value, unless rejected.
    pub(crate) fn take<T>(&mut self, result: Result<T, Refusal>) -> Option<T> {
        result.map_err(|refusal| self.push(refusal)).ok()
    }

    /// Ends a round of checks that the next ones depend on.
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

/// The nearest known name, as the end of a message; empty if none is near.
pub(crate) fn nearest<T: AsRef<str>>(name: &str, known: impl IntoIterator<Item = T>) -> String {
    let nearest = fmu_terms::nearest(name, known);
    nearest.map_or_else(String::new, |known| format!("; did you mean '{}'?", known.as_ref()))
}
