#![doc = include_str!("../README.md")]
//!
//! Libraries are not loaded, nothing is extracted, and the sizes read bound time and memory.

mod description;
pub mod importers;
mod libraries;
mod model;
mod other_files;
mod report;
pub mod rules;
mod schema;
mod structure;
mod types;
mod variables;
mod xml;

use std::io::{self, BufReader};
use std::path::Path;

use fmu_io::reading;
use fmu_package::archive::Files;
use fmu_package::{DescriptionElements, MODEL_DESCRIPTION, refuse_fmi1};

use importers::Importer;
use rules::{ARCHIVE_NAME, DESCRIPTION_MISSING, VERSION};
use xml::Xml;

pub use report::{Finding, Place, Report};

/// Finds the problems of an FMU, and those that only some importers have with it.
///
/// # Errors
/// When the file cannot be read.
pub fn validate(fmu: &Path, importers: &[&Importer]) -> io::Result<Report> {
    let file = reading::open(fmu)?;
    let mut report = Report::default();
    if fmu.extension().is_none_or(|extension| extension != "fmu") {
        report.add(&ARCHIVE_NAME, Place::default(), "the file's name does not end in .fmu");
    }
    let files = Files::open(BufReader::new(file), &mut report.refusals());
    if let Some(mut files) = files {
        files.unpack(&mut report.refusals());
        check(&mut files, importers, &mut report);
    }
    Ok(report)
}

fn check(files: &mut Files, importers: &[&Importer], report: &mut Report) {
    if !files.contains(MODEL_DESCRIPTION) {
        let inside = files.paths().find(|path| path.ends_with("/modelDescription.xml"));
        let message = match inside {
            Some(path) => format!("there is no modelDescription.xml at its top, but {path}"),
            None => "there is no modelDescription.xml in it".to_owned(),
        };
        return report.add(&DESCRIPTION_MISSING, Place::default(), message);
    }
    let Some(text) = files.text(MODEL_DESCRIPTION, &mut report.refusals()) else { return };
    let Some(xml) = Xml::parse(MODEL_DESCRIPTION, &text, report) else { return };
    let root = xml.root();
    report.fmi_version = root.attribute("fmiVersion").map(str::to_owned);
    if let Err(error) = refuse_fmi1(root) {
        return report.add(&VERSION, xml.at(root), error.to_string());
    }
    let elements = DescriptionElements::new(root);
    let version = elements.version().filter(|_| root.tag_name().name() == "fmiModelDescription");
    let Some(version) = version else {
        let shown = root.attribute("fmiVersion").unwrap_or_default();
        let message = format!("the root is {} with the fmiVersion '{shown}'", root.tag_name().name());
        return report.add(&VERSION, xml.at(root), message);
    };
    schema::check(version, &xml, report);
    let model = model::Model::new(version, &xml, elements);
    description::check(&model, report);
    types::check(&model, report);
    variables::check(&model, report);
    structure::check(&model, report);
    libraries::check(&model, files, report);
    other_files::check(&model, files, report);
    importers::check(&model, importers, report);
}
