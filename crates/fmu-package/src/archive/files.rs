//! The files of an archive, and why it is refused: it must be a ZIP file as the standard wants, safe to extract.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};

use encoding_rs::UTF_8;
use fmu_io::reading::{LARGEST_CONTENT, LARGEST_TEXT, broken, up_to};
use zip::read::ZipFile;
use zip::{CompressionMethod, ZipArchive};

use crate::xml;

/// The standard's top-level names; the last two since FMI 2.0.4 and 3.0.
const TOP: &[&str] = &[
    "modelDescription.xml",
    "model.png",
    "binaries",
    "documentation",
    "licenses",
    "resources",
    "sources",
    "extra",
    "terminalsAndIcons",
];

/// Why an archive or one of its entries is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The path has backslashes.
    Backslash,
    /// The entry is neither stored nor deflated.
    Compression,
    /// The entry cannot be unpacked.
    Damaged,
    /// Another entry has the path.
    Duplicate,
    /// The text is not in UTF-8.
    Encoding,
    /// The entry is encrypted.
    Encryption,
    /// An entry lies below a file.
    FileAndFolder,
    /// The file is not a ZIP archive.
    Format,
    /// The archive or the entry is too large.
    Limit,
    /// The entry is a link.
    Link,
    /// The path leads out of the archive's folder.
    Path,
    /// The standard has no place for the entry, which harms nobody.
    Stray,
}

/// Takes what is wrong with an archive: its kind, the path of the entry, none for the archive itself, and its description.
pub type Refuse<'a> = &'a mut dyn FnMut(Reason, Option<&str>, String);

/// The readable files of an FMU.
#[derive(Debug)]
pub struct Files<R = BufReader<File>> {
    archive: ZipArchive<R>,
    /// The entries by path, with `/` even if the archive has backslashes; none if an entry cannot be unpacked.
    entries: BTreeMap<String, Option<usize>>,
}

impl<R: Read + Seek> Files<R> {
    /// Opens an archive and refuses what is wrong with its list of entries; none if nothing can be read.
    pub fn open(mut reader: R, refuse: Refuse<'_>) -> Option<Self> {
        if reader.seek(SeekFrom::End(0)).is_ok_and(|length| length > LARGEST_CONTENT) {
            refuse(Reason::Limit, None, "the archive is larger than 1 GiB".to_owned());
            return None;
        }
        let archive = ZipArchive::new(reader).and_then(|archive| {
            if !archive.has_duplicate_names() {
                return Ok(archive);
            }
            let start = archive.central_directory_start();
            let mut reader = archive.into_inner();
            refuse_duplicates(&mut reader, start, refuse);
            ZipArchive::new(reader)
        });
        let archive = match archive {
            Ok(archive) => archive,
            Err(error) => {
                refuse(Reason::Format, None, format!("it is not a ZIP archive: {error}"));
                return None;
            }
        };
        let mut files = Self { archive, entries: BTreeMap::new() };
        let mut left = LARGEST_CONTENT;
        let mut paths = BTreeMap::new();
        for index in 0..files.archive.len() {
            if !files.add(index, &mut paths, &mut left, refuse) {
                refuse(Reason::Limit, None, "its entries exceed 1 GiB".to_owned());
                return None;
            }
        }
        for (lower, file) in paths.iter().filter(|(_, path)| !path.ends_with('/')) {
            let folder = format!("{lower}/");
            let next = paths.range(folder.clone()..).next();
            if let Some((_, below)) = next.filter(|(path, _)| path.starts_with(&folder)) {
                refuse(Reason::FileAndFolder, Some(below), format!("{file} is also a file"));
            }
        }
        let mut tops: Vec<_> = files.paths().map(|path| path.split('/').next().unwrap_or_default()).collect();
        tops.dedup();
        for top in tops.into_iter().filter(|top| !TOP.contains(top)) {
            refuse(Reason::Stray, Some(top), "the standard has no place for it".to_owned());
        }
        Some(files)
    }

    /// Checks what the list says of an entry. Returns whether the limit is met.
    fn add(
        &mut self,
        index: usize,
        paths: &mut BTreeMap<String, String>,
        left: &mut u64,
        refuse: Refuse<'_>,
    ) -> bool {
        let entry = match self.archive.by_index_raw(index) {
            Ok(entry) => entry,
            Err(error) => {
                refuse(Reason::Damaged, None, format!("its entry {index}: {error}"));
                return true;
            }
        };
        let name = entry
            .name()
            .map_or_else(|_| String::from_utf8_lossy(entry.name_raw()).into_owned(), Cow::into_owned);
        let path = normalized(&name.replace('\\', "/"));
        let place = Some(name.as_str());
        let (is_encrypted, is_link, is_folder) = (entry.encrypted(), entry.is_symlink(), path.ends_with('/'));
        let is_known = matches!(entry.compression(), CompressionMethod::Stored | CompressionMethod::Deflated);
        let (size, method) = (entry.size(), entry.compression());
        drop(entry);
        if path.is_empty() {
            return true;
        }
        if name.contains('\\') {
            refuse(Reason::Backslash, place, "its path has backslashes".to_owned());
        }
        if !is_inside(&path) {
            refuse(
                Reason::Path,
                place,
                "it would be extracted outside of its folder on some systems".to_owned(),
            );
        }
        if paths.insert(path.to_lowercase(), path.clone()).is_some() {
            refuse(Reason::Duplicate, place, "another entry has this path".to_owned());
        }
        if is_link {
            refuse(Reason::Link, place, "it is a link".to_owned());
        }
        if is_encrypted {
            refuse(Reason::Encryption, place, "it is encrypted".to_owned());
        }
        if !is_known {
            refuse(Reason::Compression, place, format!("it is compressed by {method}"));
        }
        if size > *left {
            return false;
        }
        *left -= size;
        if is_folder {
            return true;
        }
        let is_readable = !is_link && !is_encrypted && is_known;
        self.entries.insert(path, is_readable.then_some(index));
        true
    }

    /// Unpacks each entry once, refuses those that are damaged, and forgets them.
    pub fn unpack(&mut self, refuse: Refuse<'_>) {
        for (path, readable) in &mut self.entries {
            let Some(index) = *readable else { continue };
            let entry = self.archive.by_index(index).map_err(io::Error::other);
            if let Err(error) = entry.and_then(|entry| unpack(entry, &mut io::sink())) {
                *readable = None;
                refuse(Reason::Damaged, Some(path), format!("it cannot be unpacked: {error}"));
            }
        }
    }

    /// The archive.
    pub fn into_archive(self) -> ZipArchive<R> {
        self.archive
    }

    /// The paths of the files, sorted.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// Whether there is a file with a path.
    #[must_use]
    pub fn contains(&self, path: &str) -> bool {
        self.entries.contains_key(path)
    }

    /// A file's content; none if missing or not unpackable.
    pub fn bytes(&mut self, path: &str) -> Option<Vec<u8>> {
        let entry = self.archive.by_index((*self.entries.get(path)?)?).ok()?;
        up_to(LARGEST_CONTENT, entry).ok()
    }

    /// The text of an existing XML file; if it cannot be read, none, and a refusal.
    pub fn text(&mut self, path: &str, refuse: Refuse<'_>) -> Option<String> {
        let entry = self.archive.by_index((*self.entries.get(path)?)?).ok()?;
        if entry.size() > LARGEST_TEXT {
            refuse(Reason::Limit, Some(path), "it is larger than 64 MiB".to_owned());
            return None;
        }
        match up_to(LARGEST_TEXT, entry).and_then(xml::decode) {
            Ok((text, encoding)) => {
                if encoding != UTF_8 {
                    let message = format!("its bytes are {}, not UTF-8", encoding.name());
                    refuse(Reason::Encoding, Some(path), message);
                }
                Some(text)
            }
            Err(error) => {
                refuse(Reason::Encoding, Some(path), error.to_string());
                None
            }
        }
    }
}

/// Writes an entry's content.
///
/// # Errors
/// When it cannot be read or written, or its size or checksum is not what the archive states.
pub(super) fn unpack(entry: ZipFile<'_, impl Read>, writer: &mut impl Write) -> io::Result<()> {
    let size = entry.size();
    match io::copy(&mut entry.take(size + 1), writer)? {
        unpacked if unpacked == size => Ok(()),
        _ => Err(broken("its size is not what the archive states")),
    }
}

/// Refuses duplicate names, of which an index of the archive keeps the last: reads the headers of the central
/// directory (APPNOTE.TXT of ZIP, section 4.3.12).
fn refuse_duplicates(reader: &mut (impl Read + Seek), start: u64, refuse: Refuse<'_>) {
    let mut headers = vec![];
    if reader.seek(SeekFrom::Start(start)).and_then(|_| reader.read_to_end(&mut headers)).is_err() {
        headers.clear();
    }
    let mut is_found = false;
    let mut seen = BTreeSet::new();
    let mut rest = headers.as_slice();
    while rest.starts_with(b"PK\x01\x02") && rest.len() > 46 {
        let length = |place: usize| usize::from(u16::from_le_bytes([rest[place], rest[place + 1]]));
        let (name, more) = (length(28), length(30) + length(32));
        let Some(path) = rest.get(46..46 + name) else { break };
        if !seen.insert(path) {
            is_found = true;
            refuse(
                Reason::Duplicate,
                Some(&String::from_utf8_lossy(path)),
                "another entry has this path".to_owned(),
            );
        }
        rest = rest.get(46 + name + more..).unwrap_or_default();
    }
    if !is_found {
        refuse(Reason::Duplicate, None, "two entries have the same path".to_owned());
    }
}

/// An entry's path without the folders `.` that some tools write: `./a` is `a`, and `./` the empty path of all files' folder.
pub(super) fn normalized(path: &str) -> String {
    let (folders, name) =
        path.rsplit_once('/').map_or(("", path), |(_, name)| (&path[..path.len() - name.len()], name));
    let folders = folders.split_inclusive('/').filter(|folder| *folder != "./");
    folders.chain([name]).collect()
}

/// Whether a path stays in the folder of its archive, on every system.
#[must_use]
pub fn is_inside(path: &str) -> bool {
    // A folder's path ends with a slash.
    let path = path.strip_suffix('/').unwrap_or(path);
    // Windows ignores trailing dots and blanks in a name.
    let is_name = |part: &str| !part.trim_end_matches(['.', ' ']).is_empty();
    !path.contains(['\\', ':', '\0']) && path.split('/').all(is_name)
}
