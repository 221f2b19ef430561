//! Looks into an FMU of any maker, for the commands that take one.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Context, Result};
use fmi2_export::package::{ModelDescription, archive};

/// An FMU's description, after a look at the whole archive.
pub fn describe(path: &Path) -> Result<ModelDescription> {
    let shown = path.display();
    let file = File::open(path).with_context(|| format!("cannot open {shown}"))?;
    let read = || {
        let mut archive = archive::open(BufReader::new(file))?;
        archive::read_text(&mut archive, "modelDescription.xml")
    };
    let xml = read().with_context(|| format!("{shown} is no FMU"))?;
    ModelDescription::parse(&xml).with_context(|| format!("modelDescription.xml in {shown} is broken"))
}
