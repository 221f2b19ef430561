//! FMUs and archives as the tests of commands need them.

use std::fs;
use std::path::PathBuf;

pub use archives::{archive_of, scratch};

mod archives;

/// A ZIP archive with one entry.
pub fn archive(name: &str, entry: &str, content: &str) -> String {
    archive_of(name, &[(entry, content.as_bytes())])
}

/// What an FMU's description holds around its variables.
pub fn description(variables: &str) -> String {
    format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Other" guid="g">
          <CoSimulation modelIdentifier="Other"/>
          <ModelVariables>{variables}</ModelVariables>
        </fmiModelDescription>"#
    )
}

/// A folder of its own, empty.
pub fn empty(name: &str) -> PathBuf {
    let folder = scratch(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).unwrap();
    folder
}
