//! What an FMU declares where the standard wants one of its words, or a number.

use std::fmt;

use fmu_terms::Word;

/// A declared text with its meaning. FMUs declare texts that mean nothing, too; they stay readable.
#[derive(Clone, Debug)]
pub struct Declared<M> {
    text: String,
    meaning: Option<M>,
}

impl<M> Declared<M> {
    /// Reads a text, if one is declared.
    pub(crate) fn read(text: Option<&str>, meaning: impl FnOnce(&str) -> Option<M>) -> Self {
        Self { text: text.unwrap_or_default().to_owned(), meaning: text.and_then(meaning) }
    }

    /// The text; empty if nothing is declared.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}

impl<M: Word> Declared<M> {
    /// Reads a word.
    pub fn word(text: Option<&str>) -> Self {
        Self::read(text, M::of)
    }
}

impl<M: Copy> Declared<M> {
    /// The meaning of the text, if it has one.
    #[must_use]
    pub fn meaning(&self) -> Option<M> {
        self.meaning
    }
}

impl Declared<u32> {
    /// Reads a number.
    pub(crate) fn number(text: Option<&str>) -> Self {
        Self::read(text, |text| text.trim().parse().ok())
    }
}

impl<M> Default for Declared<M> {
    fn default() -> Self {
        Self { text: String::new(), meaning: None }
    }
}

impl<M: fmt::Display> From<M> for Declared<M> {
    fn from(meaning: M) -> Self {
        Self { text: meaning.to_string(), meaning: Some(meaning) }
    }
}

impl<M: PartialEq> PartialEq<M> for Declared<M> {
    fn eq(&self, meaning: &M) -> bool {
        self.meaning.as_ref() == Some(meaning)
    }
}

/// The text.
impl<M> fmt::Display for Declared<M> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(&self.text)
    }
}
