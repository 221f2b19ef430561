//! The error of a failed call, as text for the user, and numbers in such texts.

use core::fmt;

/// The error of a failed call; the user gets the message through the importer's logger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(String);

impl Error {
    /// An error with a message that names the thing and its value.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl core::error::Error for Error {}

/// A number in messages: all its digits, but no long rows of zeros.
#[derive(Debug)]
pub(crate) struct Shown(pub(crate) f64);

impl fmt::Display for Shown {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:?}", self.0);
        formatter.write_str(text.strip_suffix(".0").unwrap_or(&text))
    }
}
