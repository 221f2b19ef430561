//! The folder that an FMU is extracted to, as long as it is used.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::Path;

use anyhow::{Context, Result};
use fmi2_export::package::archive;
use tempfile::TempDir;

/// Extracts an FMU, of which [`archive::open`] has seen that it stays in its folder.
pub fn extract(path: &Path) -> Result<TempDir> {
    let file = File::open(path).context("it cannot be opened")?;
    let mut archive = archive::open(BufReader::new(file))?;
    let folder =
        tempfile::Builder::new().prefix("boost-lab-").tempdir().context("there is no place for it")?;
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index)?;
        let name = entry.name()?.into_owned();
        let mut extract = || {
            let target = folder.path().join(&name);
            if name.ends_with('/') {
                return fs::create_dir_all(target);
            }
            target.parent().map_or(Ok(()), fs::create_dir_all)?;
            let size = entry.size();
            // An entry that holds more than it says would fill the disk.
            let copied = io::copy(&mut io::Read::take(&mut entry, size + 1), &mut File::create_new(target)?)?;
            if copied == size {
                Ok(())
            } else {
                Err(io::Error::other("its size is not what the archive says"))
            }
        };
        extract().with_context(|| format!("its entry '{name}' cannot be extracted"))?;
    }
    Ok(folder)
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
    fn what_a_uri_reserves_is_encoded() {
        assert_eq!(uri(Path::new("/tmp/an fmu#1/ü")), "file:///tmp/an%20fmu%231/%C3%BC");
        assert_eq!(uri(Path::new("C:\\fmu")), "file:///C:/fmu");
    }
}
