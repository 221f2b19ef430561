//! ZIP archives: reproducible writing, and safe reading of untrusted ones.
//!
//! An archive is read if nothing in its list of entries does harm: paths that escape the archive's folder, links, duplicate
//! paths and huge sizes are rejected.

mod files;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Cursor, Read, Seek, Write};
use std::path::Path;

use fmu_io::reading::{LARGEST_CONTENT, LARGEST_TEXT, broken};
use zip::read::ZipFile;
use zip::result::ZipError;
use zip::write::{SimpleFileOptions, ZipWriter};
use zip::{CompressionMethod, DateTime, ZipArchive};

use crate::xml;
pub use files::{Files, Reason, Refuse, is_inside};
use files::{normalized, unpack};

/// An opened archive.
pub type Archive<R> = ZipArchive<R>;

/// The bytes that are written at a time, for few calls of the system.
const UNPACKED: usize = 1 << 16;

/// Opens the archive of an FMU or a system.
///
/// # Errors
/// When it is not a ZIP archive, or its list has a harmful entry; the message names it.
pub fn open<R: Read + Seek>(reader: R) -> io::Result<ZipArchive<R>> {
    let mut first = None;
    let files = Files::open(reader, &mut |reason, path, message| {
        if reason != Reason::Stray {
            first.get_or_insert_with(|| match path {
                Some(path) => format!("its entry '{path}': {message}"),
                None => message,
            });
        }
    });
    match (files, first) {
        (Some(files), None) => Ok(files.into_archive()),
        (_, refusal) => Err(broken(refusal.unwrap_or_else(|| "it cannot be read".to_owned()))),
    }
}

/// The text of an XML entry, in any encoding that it declares.
///
/// # Errors
/// When there is no such entry, or it is not text, too large or damaged.
pub fn read_text<R: Read + Seek>(archive: &mut ZipArchive<R>, path: &str) -> io::Result<String> {
    read_text_up_to(LARGEST_TEXT, archive, path)
}

fn read_text_up_to<R: Read + Seek>(
    largest: u64,
    archive: &mut ZipArchive<R>,
    path: &str,
) -> io::Result<String> {
    let index = archive.file_names().position(|name| name.is_ok_and(|name| normalized(&name) == path));
    let Some(index) = index else {
        let mut names = archive.file_names().filter_map(Result::ok);
        let other = names.find(|name| normalized(name).eq_ignore_ascii_case(path));
        let other = other.map_or(String::new(), |name| format!(", but {name}: case matters"));
        return Err(broken(format!("it contains no {path}{other}")));
    };
    let entry = archive.by_index(index).map_err(plain)?;
    content(entry, largest)
        .and_then(xml::decode)
        .map(|(text, _)| text)
        .map_err(|error| broken(format!("its {path} cannot be read: {error}")))
}

fn content<R: Read>(entry: ZipFile<'_, R>, largest: u64) -> io::Result<Vec<u8>> {
    if entry.size() > largest {
        return Err(broken(format!("it is larger than {largest} bytes")));
    }
    let mut content = vec![];
    unpack(entry, &mut content)?;
    Ok(content)
}

/// All files of an [opened](open) archive, by path. Their sizes are subtracted from `left`, a budget that several
/// archives may share: [`LARGEST_CONTENT`] for all in memory.
///
/// # Errors
/// When an entry cannot be read, or the files exceed the budget.
pub fn read_files<R: Read + Seek>(
    archive: &mut ZipArchive<R>,
    left: &mut u64,
) -> io::Result<BTreeMap<String, Vec<u8>>> {
    let mut files = BTreeMap::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(plain)?;
        let path = path_of(&entry)?;
        if entry.is_dir() {
            continue;
        }
        *left = left.checked_sub(entry.size()).ok_or_else(|| {
            broken(format!("its {path} would exceed the memory limit of {LARGEST_CONTENT} bytes"))
        })?;
        let content = content(entry, LARGEST_CONTENT)
            .map_err(|error| broken(format!("its {path} cannot be read: {error}")))?;
        files.insert(path, content);
    }
    Ok(files)
}

/// Extracts those entries of an [opened](open) archive whose paths are needed to an empty folder.
///
/// # Errors
/// When an entry is damaged or cannot be written; the message names it.
pub fn extract<R: Read + Seek>(
    archive: &mut ZipArchive<R>,
    folder: &Path,
    mut is_needed: impl FnMut(&str) -> bool,
) -> io::Result<()> {
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(plain)?;
        let path = path_of(&entry)?;
        if !is_needed(&path) {
            continue;
        }
        let target = folder.join(&path);
        let extract = || {
            if path.is_empty() || path.ends_with('/') {
                return fs::create_dir_all(&target);
            }
            target.parent().map_or(Ok(()), fs::create_dir_all)?;
            let mut writer = BufWriter::with_capacity(UNPACKED, File::create_new(&target)?);
            unpack(entry, &mut writer)?;
            writer.flush()
        };
        extract().map_err(|error| {
            io::Error::new(error.kind(), format!("its entry '{path}' cannot be extracted: {error}"))
        })?;
    }
    Ok(())
}

fn path_of<R: Read>(entry: &ZipFile<'_, R>) -> io::Result<String> {
    Ok(normalized(&entry.name().map_err(plain)?))
}

/// The error, without the prefix that repeats the system's message.
fn plain(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => broken(other.to_string()),
    }
}

/// Writes an archive of paths and contents, with fixed order, times and permissions of entries. Entries that [`open`]
/// would reject are errors.
///
/// # Errors
/// When an entry would be rejected, or writing fails.
pub fn write(mut writer: impl Write, entries: &[(String, &[u8])]) -> io::Result<()> {
    let archive = zipped(entries)?;
    open(Cursor::new(&archive))?;
    writer.write_all(&archive)
}

/// An archive's bytes, made in memory: a `ZipWriter` dropped after a failed write retries and prints an error.
fn zipped(entries: &[(String, &[u8])]) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut zip = ZipWriter::new(Cursor::new(vec![]));
    for (path, content) in entries {
        zip.start_file(path.as_str(), options)
            .map_err(|_| broken(format!("its entry '{path}' occurs twice, or its path is too long")))?;
        zip.write_all(content)?;
    }
    Ok(zip.finish().map_err(plain)?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    use fmu_io::temporary::Folder;

    fn archive(paths: &[&str]) -> Cursor<Vec<u8>> {
        let entries: Vec<_> = paths.iter().map(|&path| (path.to_owned(), b"text".as_slice())).collect();
        Cursor::new(zipped(&entries).unwrap())
    }

    fn refusal(bytes: Cursor<Vec<u8>>) -> String {
        open(bytes).unwrap_err().to_string()
    }

    #[test]
    fn a_text_is_read() {
        let mut opened = open(archive(&["a.txt", "folder/b.txt"])).unwrap();
        assert_eq!(read_text(&mut opened, "folder/b.txt").unwrap(), "text");
        let missing = read_text(&mut opened, "c.txt").unwrap_err().to_string();
        assert_eq!(missing, "it contains no c.txt");
    }

    #[test]
    fn paths_out_of_the_folder_are_refused() {
        for path in [
            "../a",
            "./../a",
            "a/../../b",
            "/etc/passwd",
            "a//b",
            ".//a",
            "C:/a",
            "a\\..\\b",
            "a/.",
            ".. /a",
            "a/...",
        ] {
            let reason = if path.contains('\\') {
                "its path has backslashes"
            } else {
                "it would be extracted outside of its folder on some systems"
            };
            let expected = format!("its entry '{path}': {reason}");
            assert_eq!(refusal(archive(&["first", path])), expected);
            let written = write(io::sink(), &[(path.to_owned(), b"")]);
            assert_eq!(written.unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn folders_of_one_dot_are_none() {
        let mut zip = ZipWriter::new_append(archive(&["./a.txt", "./b/./c", "d"])).unwrap();
        zip.add_directory("./", SimpleFileOptions::default()).unwrap();
        let mut opened = open(zip.finish().unwrap()).unwrap();
        assert_eq!(read_text(&mut opened, "a.txt").unwrap(), "text");
        let files = read_files(&mut opened, &mut LARGEST_CONTENT.clone()).unwrap();
        assert_eq!(files.keys().collect::<Vec<_>>(), ["a.txt", "b/c", "d"]);
        let folder = Folder::filled(".archive-", |folder| extract(&mut opened, folder, |_| true)).unwrap();
        assert!(["a.txt", "b/c", "d"].iter().all(|path| folder.path().join(path).is_file()));
        let twice = refusal(archive(&["a", "./a"]));
        assert_eq!(twice, "its entry './a': another entry has this path");
    }

    #[test]
    fn paths_that_differ_only_in_case_are_refused() {
        assert_eq!(refusal(archive(&["a/b", "A/b"])), "its entry 'A/b': another entry has this path");
    }

    #[test]
    fn a_file_that_is_not_an_archive_is_refused() {
        let message = refusal(Cursor::new(b"no archive".to_vec()));
        assert!(message.starts_with("it is not a ZIP archive"), "{message}");
    }

    #[test]
    fn a_decompression_bomb_is_refused() {
        let blanks = vec![b' '; 100_000];
        let bytes = Cursor::new(zipped(&[("bomb.xml".to_owned(), blanks.as_slice())]).unwrap());
        let read = |largest| read_text_up_to(largest, &mut open(bytes.clone()).unwrap(), "bomb.xml");
        assert_eq!(read(100_000).unwrap().len(), 100_000);
        assert_eq!(
            read(99_999).unwrap_err().to_string(),
            "its bomb.xml cannot be read: it is larger than 99999 bytes"
        );
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
        let read =
            |mut left| read_files(&mut open(bytes.clone()).unwrap(), &mut left).map(|files| (files, left));
        let expected = ["b", "folder/a"].map(|path| (path.to_owned(), b"text".to_vec()));
        assert_eq!(read(9).unwrap(), (BTreeMap::from(expected), 1));
        assert_eq!(
            read(7).unwrap_err().to_string(),
            "its b would exceed the memory limit of 1073741824 bytes"
        );
    }

    #[test]
    fn a_link_is_refused() {
        let mut zip = ZipWriter::new(Cursor::new(vec![]));
        zip.add_symlink("a", "/etc/passwd", SimpleFileOptions::default()).unwrap();
        assert_eq!(refusal(zip.finish().unwrap()), "its entry 'a': it is a link");
    }

    /// The last one, by its header in the central directory.
    #[test]
    fn a_damaged_entry_is_refused() {
        let central = |bytes: &[u8]| bytes.windows(4).rposition(|window| window == b"PK\x01\x02").unwrap();
        for (offset, message) in [(16, "Invalid checksum"), (24, "its size is not what the archive states")] {
            let mut bytes = archive(&["a", "b"]);
            let place = central(bytes.get_ref()) + offset;
            bytes.get_mut()[place] ^= 1;
            let mut opened = open(bytes).unwrap();
            let extracted = Folder::filled(".archive-", |folder| extract(&mut opened, folder, |_| true));
            let extracted = extracted.err().unwrap().to_string();
            assert_eq!(extracted, format!("its entry 'b' cannot be extracted: {message}"));
            let read = format!("its b cannot be read: {message}");
            assert_eq!(read_text(&mut opened, "b").unwrap_err().to_string(), read);
            assert_eq!(read_files(&mut opened, &mut LARGEST_CONTENT.clone()).unwrap_err().to_string(), read);
        }
    }

    /// The archive's index holds only the last one.
    #[test]
    fn a_path_that_occurs_twice_is_refused() {
        let mut bytes = archive(&["a/one", "a/two"]);
        let places: Vec<_> = (0..bytes.get_ref().len() - 5)
            .filter(|&place| bytes.get_ref()[place..].starts_with(b"a/two"))
            .collect();
        for place in places {
            bytes.get_mut()[place..place + 5].copy_from_slice(b"a/one");
        }
        assert_eq!(refusal(bytes), "its entry 'a/one': another entry has this path");
    }

    /// One path would have to be both file and folder.
    #[test]
    fn an_entry_below_a_file_is_refused() {
        for paths in [["a.txt", "a.txt/b"], ["a.txt/b", "A.txt"], ["a", "a/"]] {
            let message = refusal(archive(&paths));
            assert!(message.contains("is also a file"), "{paths:?}: {message}");
        }
        open(archive(&["a", "a.txt", "a b/c", "b/a", "b/a.txt"])).unwrap();
    }
}
