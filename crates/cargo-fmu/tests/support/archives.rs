//! Archives of tests.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

pub fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// A ZIP archive.
pub fn archive_of(name: &str, entries: &[(&str, &[u8])]) -> String {
    let path = scratch(name);
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    for (entry, content) in entries {
        zip.start_file(*entry, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap();
    path.to_str().unwrap().to_owned()
}
