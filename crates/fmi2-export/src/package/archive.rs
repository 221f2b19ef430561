//! ZIP archives: written so that the same parts give the same bytes, and read as what they may be when a
//! stranger made them.
//!
//! Nothing is extracted here. What would do harm to whoever extracts it is refused: paths that lead out of
//! the archive's folder, two entries of one path, entries of unbelievable sizes.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read, Seek, Write};

use zip::result::ZipResult;
use zip::write::{SimpleFileOptions, ZipWriter};
use zip::{CompressionMethod, DateTime, ZipArchive};

/// What all entries together may claim to hold in bytes; no FMU or system is as large.
const LARGEST_CONTENT: u64 = 16 << 30;
/// What all entries together may hold in bytes where all are read at once.
const LARGEST_FILES: u64 = 2 << 30;
/// What a single text that is read may hold in bytes; descriptions of the largest models have some 50 MB.
const LARGEST_TEXT: u64 = 128 << 20;

/// Opens the archive of an FMU or a system, after a look at all its entries.
///
/// # Errors
/// When it is no ZIP archive, or an entry would do harm; the message names it.
pub fn open<R: Read + Seek>(reader: R) -> io::Result<ZipArchive<R>> {
    let mut archive =
        ZipArchive::new(reader).map_err(|error| broken(format!("it is no ZIP archive: {error}")))?;
    let mut paths = BTreeSet::new();
    let mut size = 0_u64;
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(|error| broken(error.to_string()))?;
        let path = entry.name().map_err(|error| broken(error.to_string()))?.into_owned();
        if !is_inside(&path) {
            return Err(broken(format!("its entry '{path}' would be extracted outside of its folder")));
        }
        // Windows and macOS take paths that differ in case for one.
        if !paths.insert(path.to_lowercase()) {
            return Err(broken(format!("its entry '{path}' stands twice")));
        }
        size = size.saturating_add(entry.size());
        if size > LARGEST_CONTENT {
            return Err(broken(format!("its entries claim to hold more than {LARGEST_CONTENT} bytes")));
        }
    }
    Ok(archive)
}

/// The text of an entry.
///
/// # Errors
/// When there is no such entry, or it is no text, too large or damaged.
pub fn read_text<R: Read + Seek>(archive: &mut ZipArchive<R>, path: &str) -> io::Result<String> {
    read_text_up_to(LARGEST_TEXT, archive, path)
}

fn read_text_up_to<R: Read + Seek>(
    largest: u64,
    archive: &mut ZipArchive<R>,
    path: &str,
) -> io::Result<String> {
    let entry = archive.by_name(path).map_err(|_| broken(format!("there is no {path} in it")))?;
    let mut text = String::new();
    let read = entry
        .take(largest + 1)
        .read_to_string(&mut text)
        .map_err(|error| broken(format!("its {path} cannot be read: {error}")))?;
    if read as u64 > largest {
        return Err(broken(format!("its {path} is larger than {largest} bytes")));
    }
    Ok(text)
}

/// All files of an archive, by their paths.
///
/// # Errors
/// When an entry is no file, damaged, or the files are too large.
pub fn read_files<R: Read + Seek>(archive: &mut ZipArchive<R>) -> io::Result<BTreeMap<String, Vec<u8>>> {
    read_files_up_to(LARGEST_FILES, archive)
}

fn read_files_up_to<R: Read + Seek>(
    largest: u64,
    archive: &mut ZipArchive<R>,
) -> io::Result<BTreeMap<String, Vec<u8>>> {
    let mut files = BTreeMap::new();
    let mut left = largest;
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|error| broken(error.to_string()))?;
        let path = entry.name().map_err(|error| broken(error.to_string()))?.into_owned();
        if entry.is_symlink() {
            return Err(broken(format!("its entry '{path}' is a link")));
        }
        if entry.is_dir() {
            continue;
        }
        let mut content = vec![];
        let read = entry
            .take(left + 1)
            .read_to_end(&mut content)
            .map_err(|error| broken(format!("its {path} cannot be read: {error}")))?;
        left = left
            .checked_sub(read as u64)
            .ok_or_else(|| broken(format!("its files are larger than {largest} bytes")))?;
        files.insert(path, content);
    }
    Ok(files)
}

/// Whether a path stays in the folder that it is extracted to, on every system.
fn is_inside(path: &str) -> bool {
    // A folder's path ends with a slash.
    let path = path.strip_suffix('/').unwrap_or(path);
    !path.contains(['\\', ':', '\0']) && path.split('/').all(|part| !["", ".", ".."].contains(&part))
}

/// What is wrong with a file that was read.
pub(super) fn broken(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message.into())
}

/// Writes an archive of paths and contents: the order of the entries, their times and permissions are fixed.
pub(super) fn write(writer: impl Write + Seek, entries: &[(String, &[u8])]) -> ZipResult<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(writer);
    for (path, content) in entries {
        zip.start_file(path.as_str(), options)?;
        zip.write_all(content)?;
    }
    zip.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn archive(paths: &[&str]) -> Cursor<Vec<u8>> {
        let mut bytes = Cursor::new(vec![]);
        let entries: Vec<_> = paths.iter().map(|&path| (path.to_owned(), b"text".as_slice())).collect();
        write(&mut bytes, &entries).unwrap();
        bytes
    }

    fn refusal(bytes: Cursor<Vec<u8>>) -> String {
        open(bytes).unwrap_err().to_string()
    }

    #[test]
    fn a_text_is_read() {
        let mut opened = open(archive(&["a.txt", "folder/b.txt"])).unwrap();
        assert_eq!(read_text(&mut opened, "folder/b.txt").unwrap(), "text");
        let missing = read_text(&mut opened, "c.txt").unwrap_err().to_string();
        assert_eq!(missing, "there is no c.txt in it");
    }

    #[test]
    fn what_leads_out_of_the_folder_is_refused() {
        for path in ["../a", "a/../../b", "/etc/passwd", "a//b", "./a", "C:/a", "a\\..\\b", "a/."] {
            let expected = format!("its entry '{path}' would be extracted outside of its folder");
            assert_eq!(refusal(archive(&["first", path])), expected);
        }
    }

    #[test]
    fn what_stands_twice_on_some_system_is_refused() {
        assert_eq!(refusal(archive(&["a/b", "A/b"])), "its entry 'A/b' stands twice");
    }

    #[test]
    fn what_is_no_archive_is_refused() {
        let message = refusal(Cursor::new(b"no archive".to_vec()));
        assert!(message.starts_with("it is no ZIP archive"), "{message}");
    }

    #[test]
    fn a_text_that_unpacks_to_more_than_is_sane_is_refused() {
        let blanks = vec![b' '; 100_000];
        let mut bytes = Cursor::new(vec![]);
        write(&mut bytes, &[("bomb.xml".to_owned(), blanks.as_slice())]).unwrap();
        let read = |largest| read_text_up_to(largest, &mut open(bytes.clone()).unwrap(), "bomb.xml");
        assert_eq!(read(100_000).unwrap().len(), 100_000);
        assert_eq!(read(99_999).unwrap_err().to_string(), "its bomb.xml is larger than 99999 bytes");
    }

    #[test]
    fn all_files_are_read_up_to_a_size() {
        let mut zip = ZipWriter::new(Cursor::new(vec![]));
        zip.add_directory("folder/", SimpleFileOptions::default()).unwrap();
        for path in ["folder/a", "b"] {
            zip.start_file(path, SimpleFileOptions::default()).unwrap();
            zip.write_all(b"text").unwrap();
        }
        let bytes = zip.finish().unwrap();
        let read = |largest| read_files_up_to(largest, &mut open(bytes.clone()).unwrap());
        let expected = ["b", "folder/a"].map(|path| (path.to_owned(), b"text".to_vec()));
        assert_eq!(read(8).unwrap(), BTreeMap::from(expected));
        assert_eq!(read(7).unwrap_err().to_string(), "its files are larger than 7 bytes");
    }

    #[test]
    fn a_link_is_no_file() {
        let mut zip = ZipWriter::new(Cursor::new(vec![]));
        zip.add_symlink("a", "/etc/passwd", SimpleFileOptions::default()).unwrap();
        let mut archive = open(zip.finish().unwrap()).unwrap();
        assert_eq!(read_files(&mut archive).unwrap_err().to_string(), "its entry 'a' is a link");
    }

    #[test]
    fn a_damaged_text_is_refused() {
        let mut bytes = archive(&["a.txt"]);
        let place = bytes.get_ref().windows(5).position(|window| window == b"a.txt").unwrap();
        bytes.get_mut()[place + 6] ^= 0x55;
        let message = read_text(&mut open(bytes).unwrap(), "a.txt").unwrap_err().to_string();
        assert!(message.starts_with("its a.txt cannot be read"), "{message}");
    }
}
