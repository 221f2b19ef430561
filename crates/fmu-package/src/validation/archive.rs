//! The archive: a ZIP file that follows the standard and is safe to extract.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};

use encoding_rs::UTF_8;
use fmu_io::reading::{LARGEST_CONTENT, LARGEST_TEXT, broken, up_to};
use zip::read::ZipFile;
use zip::{CompressionMethod, ZipArchive};

use super::report::{Place, Report};
use super::rules::{
    ARCHIVE_BACKSLASH, ARCHIVE_COMPRESSION, ARCHIVE_DAMAGED, ARCHIVE_DUPLICATE, ARCHIVE_ENCRYPTION,
    ARCHIVE_FILE_AND_FOLDER, ARCHIVE_FORMAT, ARCHIVE_LINK, ARCHIVE_PATH, ARCHIVE_STRAY, LIMIT, XML_ENCODING,
};
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

/// The readable files of an FMU.
pub(crate) struct Files<R = BufReader<File>> {
    archive: ZipArchive<R>,
    /// By path, with `/` even if the archive has backslashes; none if an entry cannot be unpacked.
    entries: BTreeMap<String, Option<usize>>,
}

impl<R: Read + Seek> Files<R> {
    /// Opens an archive and reports problems with its list of entries; none if nothing can be read.
    pub fn open(mut reader: R, report: &mut Report) -> Option<Self> {
        if reader.seek(SeekFrom::End(0)).is_ok_and(|length| length > LARGEST_CONTENT) {
            report.add(&LIMIT, Place::default(), "the archive is larger than 1 GiB");
            return None;
        }
        let archive = ZipArchive::new(reader).and_then(|archive| {
            if !archive.has_duplicate_names() {
                return Ok(archive);
            }
            let start = archive.central_directory_start();
            let mut reader = archive.into_inner();
            report_duplicates(&mut reader, start, report);
            ZipArchive::new(reader)
        });
        let archive = match archive {
            Ok(archive) => archive,
            Err(error) => {
                report.add(&ARCHIVE_FORMAT, Place::default(), format!("it is not a ZIP archive: {error}"));
                return None;
            }
        };
        let mut files = Self { archive, entries: BTreeMap::new() };
        let mut left = LARGEST_CONTENT;
        let mut paths = BTreeMap::new();
        for index in 0..files.archive.len() {
            if !files.add(index, &mut paths, &mut left, report) {
                report.add(&LIMIT, Place::default(), "its entries exceed 1 GiB");
                return None;
            }
        }
        for (lower, file) in paths.iter().filter(|(_, path)| !path.ends_with('/')) {
            let folder = format!("{lower}/");
            let next = paths.range(folder.clone()..).next();
            if let Some((_, below)) = next.filter(|(path, _)| path.starts_with(&folder)) {
                report.add(&ARCHIVE_FILE_AND_FOLDER, Place::file(below), format!("{file} is also a file"));
            }
        }
        let mut tops: Vec<_> = files.paths().map(|path| path.split('/').next().unwrap_or_default()).collect();
        tops.dedup();
        for top in tops.into_iter().filter(|top| !TOP.contains(top)) {
            report.add(&ARCHIVE_STRAY, Place::file(top), "the standard has no place for it");
        }
        Some(files)
    }

    /// Checks what the list says of an entry. Returns whether the limit is met.
    fn add(
        &mut self,
        index: usize,
        paths: &mut BTreeMap<String, String>,
        left: &mut u64,
        report: &mut Report,
    ) -> bool {
        let entry = match self.archive.by_index_raw(index) {
            Ok(entry) => entry,
            Err(error) => {
                report.add(&ARCHIVE_DAMAGED, Place::default(), format!("its entry {index}: {error}"));
                return true;
            }
        };
        let name = entry
            .name()
            .map_or_else(|_| String::from_utf8_lossy(entry.name_raw()).into_owned(), Cow::into_owned);
        let path = normalized(&name.replace('\\', "/"));
        let place = Place::file(&name);
        let (is_encrypted, is_link, is_folder) = (entry.encrypted(), entry.is_symlink(), path.ends_with('/'));
        let is_known = matches!(entry.compression(), CompressionMethod::Stored | CompressionMethod::Deflated);
        let (size, method) = (entry.size(), entry.compression());
        drop(entry);
        if path.is_empty() {
            return true;
        }
        if name.contains('\\') {
            report.add(&ARCHIVE_BACKSLASH, place.clone(), "its path has backslashes");
        }
        if !is_inside(&path) {
            report.add(
                &ARCHIVE_PATH,
                place.clone(),
                "it would be extracted outside of its folder on some systems",
            );
        }
        if paths.insert(path.to_lowercase(), path.clone()).is_some() {
            report.add(&ARCHIVE_DUPLICATE, place.clone(), "another entry has this path");
        }
        if is_link {
            report.add(&ARCHIVE_LINK, place.clone(), "it is a link");
        }
        if is_encrypted {
            report.add(&ARCHIVE_ENCRYPTION, place.clone(), "it is encrypted");
        }
        if !is_known {
            report.add(&ARCHIVE_COMPRESSION, place.clone(), format!("it is compressed by {method}"));
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

    /// Unpacks each entry once, reports those that are damaged, and forgets them.
    pub fn unpack(&mut self, report: &mut Report) {
        for (path, readable) in &mut self.entries {
            let Some(index) = *readable else { continue };
            let entry = self.archive.by_index(index).map_err(io::Error::other);
            if let Err(error) = entry.and_then(|entry| unpack(entry, &mut io::sink())) {
                *readable = None;
                report.add(&ARCHIVE_DAMAGED, Place::file(path), format!("it cannot be unpacked: {error}"));
            }
        }
    }

    pub fn into_archive(self) -> ZipArchive<R> {
        self.archive
    }

    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    pub fn contains(&self, path: &str) -> bool {
        self.entries.contains_key(path)
    }

    /// A file's content; none if missing or not unpackable.
    pub fn bytes(&mut self, path: &str) -> Option<Vec<u8>> {
        let entry = self.archive.by_index((*self.entries.get(path)?)?).ok()?;
        up_to(LARGEST_CONTENT, entry).ok()
    }

    /// The text of an existing XML file; if it cannot be read, none, and a report why.
    pub fn text(&mut self, path: &str, report: &mut Report) -> Option<String> {
        let entry = self.archive.by_index((*self.entries.get(path)?)?).ok()?;
        if entry.size() > LARGEST_TEXT {
            report.add(&LIMIT, Place::file(path), "it is larger than 64 MiB");
            return None;
        }
        match up_to(LARGEST_TEXT, entry).and_then(xml::decode) {
            Ok((text, encoding)) => {
                if encoding != UTF_8 {
                    let message = format!("its bytes are {}, not UTF-8", encoding.name());
                    report.add(&XML_ENCODING, Place::file(path), message);
                }
                Some(text)
            }
            Err(error) => {
                report.add(&XML_ENCODING, Place::file(path), error.to_string());
                None
            }
        }
    }
}

/// Writes an entry's content.
///
/// # Errors
/// When it cannot be read or written, or its size or checksum is not what the archive states.
pub(crate) fn unpack(entry: ZipFile<'_, impl Read>, writer: &mut impl Write) -> io::Result<()> {
    let size = entry.size();
    match io::copy(&mut entry.take(size + 1), writer)? {
        unpacked if unpacked == size => Ok(()),
        _ => Err(broken("its size is not what the archive states")),
    }
}

/// Reports duplicate names, of which an index of the archive keeps the last: reads the headers of the central
/// directory (APPNOTE.TXT of ZIP, section 4.3.12).
fn report_duplicates(reader: &mut (impl Read + Seek), start: u64, report: &mut Report) {
    let mut headers = vec![];
    if reader.seek(SeekFrom::Start(start)).and_then(|_| reader.read_to_end(&mut headers)).is_err() {
        headers.clear();
    }
    let before = report.findings.len();
    let mut seen = BTreeSet::new();
    let mut rest = headers.as_slice();
    while rest.starts_with(b"PK\x01\x02") && rest.len() > 46 {
        let length = |place: usize| usize::from(u16::from_le_bytes([rest[place], rest[place + 1]]));
        let (name, more) = (length(28), length(30) + length(32));
        let Some(path) = rest.get(46..46 + name) else { break };
        if !seen.insert(path) {
            report.add(
                &ARCHIVE_DUPLICATE,
                Place::file(String::from_utf8_lossy(path)),
                "another entry has this path",
            );
        }
        rest = rest.get(46 + name + more..).unwrap_or_default();
    }
    if report.findings.len() == before {
        report.add(&ARCHIVE_DUPLICATE, Place::default(), "two entries have the same path");
    }
}

/// An entry's path without the folders `.` that some tools write: `./a` is `a`, and `./` the empty path of all files' folder.
pub(crate) fn normalized(path: &str) -> String {
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
