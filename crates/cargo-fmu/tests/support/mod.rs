//! FMUs and archives as the tests of commands need them.

use std::fs;
use std::path::{Path, PathBuf};

use archives::write_archive;

mod archives;

/// A path in the folder of tests.
pub fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A ZIP archive in the folder of tests.
pub fn archive_of(name: &str, entries: &[(&str, &[u8])]) -> String {
    let path = scratch(name);
    write_archive(&path, entries);
    path.to_str().unwrap().to_owned()
}

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
