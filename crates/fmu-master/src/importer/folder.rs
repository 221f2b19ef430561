//! The temporary folder of an extracted FMU or system.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Context, Result};
use fmu_io::temporary::Folder;
use fmu_package::archive;

/// A unique prefix: leftovers of killed processes are recognized by it and removed.
const PREFIX: &str = ".unpacked-by-fmu-master-";

/// The entries of an archive whose paths are needed; the folder is removed when dropped.
pub fn extract(path: &Path, is_needed: impl FnMut(&str) -> bool) -> Result<Folder> {
    let file = File::open(path).context("it cannot be opened")?;
    let mut archive = archive::open(BufReader::new(file))?;
    Ok(Folder::filled(PREFIX, |folder| archive::extract(&mut archive, folder, is_needed))?)
}

/// The `file` URI (RFC 8089) of a folder, as `fmi2Instantiate` takes it.
pub fn uri(folder: &Path) -> String {
    let path = folder.to_string_lossy().replace('\\', "/");
    let mut uri = "file://".to_owned();
    // A drive's letter comes after a slash.
    if !path.starts_with('/') {
        uri.push('/');
    }
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri += &format!("%{byte:02X}");
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reserved_characters_of_a_uri_are_encoded() {
        assert_eq!(uri(Path::new("/tmp/an fmu#1/ü")), "file:///tmp/an%20fmu%231/%C3%BC");
        assert_eq!(uri(Path::new("C:\\fmu")), "file:///C:/fmu");
    }
}
