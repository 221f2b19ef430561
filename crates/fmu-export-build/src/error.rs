//! What `generate` says when a model's description is refused.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why no interface was generated: the file, the variable where one is to blame, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    file: PathBuf,
    refusal: Refusal,
}

impl Error {
    pub(crate) fn new(file: &Path, refusal: impl Into<Refusal>) -> Self {
        Self { file: file.to_owned(), refusal: refusal.into() }
    }

    /// The file that has to be mended.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The variable that the reason is about, when it is about a single one.
    #[must_use]
    pub fn variable(&self) -> Option<&str> {
        self.refusal.variable.as_deref()
    }

    /// What is wrong.
    #[must_use]
    pub fn reason(&self) -> &str {
        &self.refusal.reason
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: ", self.file.display())?;
        if let Some(variable) = &self.refusal.variable {
            write!(formatter, "variable '{variable}': ")?;
        }
        formatter.write_str(&self.refusal.reason)
    }
}

impl std::error::Error for Error {}

/// An error before it is known which file is being read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    variable: Option<String>,
    reason: String,
}

impl Refusal {
    /// A reason that concerns the model as a whole.
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self { variable: None, reason: reason.into() }
    }

    /// A reason that concerns one variable.
    pub(crate) fn of(variable: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { variable: Some(variable.into()), reason: reason.into() }
    }
}

impl From<String> for Refusal {
    fn from(reason: String) -> Self {
        Self::new(reason)
    }
}
