//! The problems found in an FMU.

use fmu_package::archive::Reason;

use crate::rules::{
    ARCHIVE_BACKSLASH, ARCHIVE_COMPRESSION, ARCHIVE_DAMAGED, ARCHIVE_DUPLICATE, ARCHIVE_ENCRYPTION,
    ARCHIVE_FILE_AND_FOLDER, ARCHIVE_FORMAT, ARCHIVE_LINK, ARCHIVE_PATH, ARCHIVE_STRAY, LIMIT, Rule,
    Severity, XML_ENCODING,
};

/// The most findings kept, which bounds memory.
const MOST_FINDINGS: usize = 100_000;
/// The longest message in characters: it quotes the FMU.
const LONGEST_MESSAGE: usize = 500;

/// The location of a problem.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file in the archive; none for the archive itself.
    pub file: Option<String>,
    /// The line in this file.
    pub line: Option<usize>,
    /// The variable.
    pub variable: Option<String>,
}

impl Place {
    pub(crate) fn file(path: impl Into<String>) -> Self {
        Self { file: Some(path.into()), ..Self::default() }
    }
}

/// A problem in an FMU.
#[derive(Debug)]
pub struct Finding {
    /// The broken rule.
    pub rule: &'static Rule,
    /// The problem's location.
    pub place: Place,
    /// The problem's description.
    pub message: String,
}

/// All problems in an FMU.
#[derive(Debug, Default)]
pub struct Report {
    /// The `fmiVersion`, if readable.
    pub fmi_version: Option<String>,
    /// The findings, at most 100,000.
    pub findings: Vec<Finding>,
    /// The number of findings beyond that.
    pub omitted: usize,
}

impl Report {
    pub(crate) fn add(&mut self, rule: &'static Rule, place: Place, message: impl Into<String>) {
        if self.findings.len() == MOST_FINDINGS {
            self.omitted += 1;
        } else {
            let message = message.into();
            let end = message.char_indices().nth(LONGEST_MESSAGE).map_or(message.len(), |(end, _)| end);
            self.findings.push(Finding { rule, place, message: message[..end].to_owned() });
        }
    }

    /// Takes what reading an archive refuses, each by its rule.
    pub(crate) fn refusals(&mut self) -> impl FnMut(Reason, Option<&str>, String) {
        |reason, path, message| {
            let rule = match reason {
                Reason::Backslash => &ARCHIVE_BACKSLASH,
                Reason::Compression => &ARCHIVE_COMPRESSION,
                Reason::Damaged => &ARCHIVE_DAMAGED,
                Reason::Duplicate => &ARCHIVE_DUPLICATE,
                Reason::Encoding => &XML_ENCODING,
                Reason::Encryption => &ARCHIVE_ENCRYPTION,
                Reason::FileAndFolder => &ARCHIVE_FILE_AND_FOLDER,
                Reason::Format => &ARCHIVE_FORMAT,
                Reason::Limit => &LIMIT,
                Reason::Link => &ARCHIVE_LINK,
                Reason::Path => &ARCHIVE_PATH,
                Reason::Stray => &ARCHIVE_STRAY,
            };
            self.add(rule, path.map_or_else(Place::default, Place::file), message);
        }
    }

    /// The number of findings of a severity.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.rule.severity == severity).count()
    }
}

/// Reports a problem at a known place.
pub(crate) type Wrong<'a> = &'a mut dyn FnMut(&'static Rule, String);
