//! Finds problems in FMUs from any tool, FMI 1.0, 2.0 and 3.0, by the published [`rules`].
//!
//! Libraries are not loaded, nothing is extracted, and the sizes read bound time and memory.

pub(crate) mod archive;
mod description;
pub mod importers;
mod libraries;
mod model;
mod other_files;
pub mod rules;
mod schema;
mod structure;
mod types;
mod variables;
mod xml;

use std::io::{self, BufReader};
use std::path::Path;

use importers::Importer;
use rules::{ARCHIVE_NAME, DESCRIPTION_MISSING, Rule, Severity, VERSION};
use xml::Xml;

use crate::fmu::MODEL_DESCRIPTION;
use crate::reading;

/// The most findings kept: more of them help nobody.
const MOST_FINDINGS: usize = 1000;
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
    fn file(path: impl Into<String>) -> Self {
        Self { file: Some(path.into()), ..Self::default() }
    }
}

/// A problem in an FMU.
#[derive(Debug)]
pub struct Finding {
    /// The broken rule.
    pub rule: &'static Rule,
    /// Its location.
    pub place: Place,
    /// Its description.
    pub message: String,
}

/// All problems in an FMU.
#[derive(Debug, Default)]
pub struct Report {
    /// The `fmiVersion`, if readable.
    pub fmi_version: Option<String>,
    /// At most 1000 findings.
    pub findings: Vec<Finding>,
    /// The number of further ones.
    pub omitted: usize,
}

impl Report {
    fn add(&mut self, rule: &'static Rule, place: Place, message: impl Into<String>) {
        if self.findings.len() == MOST_FINDINGS {
            self.omitted += 1;
        } else {
            let message = message.into();
            let end = message.char_indices().nth(LONGEST_MESSAGE).map_or(message.len(), |(end, _)| end);
            self.findings.push(Finding { rule, place, message: message[..end].to_owned() });
        }
    }

    /// The number of findings of a severity.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.rule.severity == severity).count()
    }
}

/// Reports a problem at a known place.
type Wrong<'a> = &'a mut dyn FnMut(&'static Rule, String);

/// The FMI versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Version {
    One,
    Two,
    Three,
}

/// Finds an FMU's problems, and what some importers reject.
///
/// # Errors
/// When the file cannot be read.
pub fn validate(fmu: &Path, importers: &[&Importer]) -> io::Result<Report> {
    let file = reading::open(fmu)?;
    let mut report = Report::default();
    if fmu.extension().is_none_or(|extension| extension != "fmu") {
        report.add(&ARCHIVE_NAME, Place::default(), "the file's name does not end in .fmu");
    }
    if let Some(mut files) = archive::Files::open(BufReader::new(file), &mut report) {
        check(&mut files, importers, &mut report);
    }
    Ok(report)
}

fn check(files: &mut archive::Files, importers: &[&Importer], report: &mut Report) {
    if !files.contains(MODEL_DESCRIPTION) {
        let inside = files.paths().find(|path| path.ends_with("/modelDescription.xml"));
        let message = match inside {
            Some(path) => format!("there is no modelDescription.xml at its top, but {path}"),
            None => "there is no modelDescription.xml in it".to_owned(),
        };
        return report.add(&DESCRIPTION_MISSING, Place::default(), message);
    }
    let Some(text) = files.text(MODEL_DESCRIPTION, report) else { return };
    let Some(xml) = Xml::parse(MODEL_DESCRIPTION, &text, report) else { return };
    let root = xml.root();
    report.fmi_version = root.attribute("fmiVersion").map(str::to_owned);
    let version = match root.attribute("fmiVersion").unwrap_or_default() {
        _ if root.tag_name().name() != "fmiModelDescription" => None,
        "1.0" => Some(Version::One),
        "2.0" => Some(Version::Two),
        text if text == "3" || text.starts_with("3.") => Some(Version::Three),
        _ => None,
    };
    let Some(version) = version else {
        let shown = root.attribute("fmiVersion").unwrap_or_default();
        let message = format!("the root is {} with the fmiVersion '{shown}'", root.tag_name().name());
        return report.add(&VERSION, xml.at(root), message);
    };
    schema::check(version, &xml, report);
    let model = model::Model::new(version, &xml);
    description::check(&model, report);
    types::check(&model, report);
    variables::check(&model, report);
    structure::check(&model, report);
    libraries::check(&model, files, report);
    other_files::check(&model, files, report);
    importers::check(&model, importers, report);
}
