//! Words of the standard.

/// A word that the standard defines, such as a causality.
pub trait Word: Copy + PartialEq + 'static {
    /// All words of the kind.
    const ALL: &[Self];

    /// The word as modelDescription.xml has it.
    #[must_use]
    fn as_str(self) -> &'static str;

    /// The word that a text is.
    #[must_use]
    fn of(text: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|word| word.as_str() == text)
    }
}

/// Declares words of a kind, each with its text.
macro_rules! words {
    (
        $(#[$attribute:meta])*
        pub enum $kind:ident { $($(#[$of_word:meta])* $word:ident = $text:literal,)* }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[allow(missing_docs, reason = "the standard defines them")]
        pub enum $kind {
            $($(#[$of_word])* #[cfg_attr(feature = "serde", serde(rename = $text))] $word,)*
        }

        impl $crate::Word for $kind {
            const ALL: &[Self] = &[$(Self::$word,)*];

            fn as_str(self) -> &'static str {
                match self {
                    $(Self::$word => $text,)*
                }
            }
        }

        impl core::fmt::Display for $kind {
            fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                formatter.pad($crate::Word::as_str(*self))
            }
        }
    };
}

pub(crate) use words;
