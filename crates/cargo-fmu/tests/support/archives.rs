//! Archives of tests.

use std::fs;
use std::io::Write;
use std::path::Path;

/// Writes a ZIP archive.
pub fn write_archive(path: &Path, entries: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(fs::File::create(path).unwrap());
    for (entry, content) in entries {
        zip.start_file(*entry, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap();
}
