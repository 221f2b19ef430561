//! The error of a failed call, as text for the user.

use core::fmt::{self, Write as _};

/// A message as long as it needs to be.
#[cfg(not(target_os = "none"))]
type Message = String;
/// A message without an allocator, which ends where its memory does.
#[cfg(target_os = "none")]
type Message = crate::display::Text<120>;

/// The error of a failed call; its message reaches the user through the importer's logger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(Message);

impl Error {
    /// An error whose message names the item and its value: a text, or `format_args!("…")`.
    pub fn new(message: impl fmt::Display) -> Self {
        let mut text = Message::default();
        // It fails where the memory ends.
        let _ = write!(text, "{message}");
        Self(text)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl core::error::Error for Error {}
