//! The .fmu archive (FMI 2.0.5, section 2.3): a ZIP file that holds modelDescription.xml and, for each
//! platform, the model's library.
//!
//! The same parts give the same bytes.

use std::io::{self, Seek, Write};

use quick_xml::escape::escape;

use super::archive;
use crate::PACKAGE_MARK;

/// A platform that FMI 2.0 names a folder for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Platform {
    Darwin64,
    Linux32,
    Linux64,
    Win32,
    Win64,
}

impl Platform {
    /// The platform that this program runs on, if FMI 2.0 names a folder for it.
    #[must_use]
    pub fn host() -> Option<Self> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            // On macOS, one folder serves both architectures.
            ("macos", "x86_64" | "aarch64") => Some(Self::Darwin64),
            ("linux", "x86") => Some(Self::Linux32),
            ("linux", "x86_64") => Some(Self::Linux64),
            ("windows", "x86") => Some(Self::Win32),
            ("windows", "x86_64") => Some(Self::Win64),
            _ => None,
        }
    }

    /// Its folder below `binaries/`.
    #[must_use]
    pub fn folder(self) -> &'static str {
        match self {
            Self::Darwin64 => "darwin64",
            Self::Linux32 => "linux32",
            Self::Linux64 => "linux64",
            Self::Win32 => "win32",
            Self::Win64 => "win64",
        }
    }

    /// What the name of a library ends in there.
    #[must_use]
    pub fn library_suffix(self) -> &'static str {
        match self {
            Self::Darwin64 => "dylib",
            Self::Linux32 | Self::Linux64 => "so",
            Self::Win32 | Self::Win64 => "dll",
        }
    }
}

/// The parts of an FMU.
#[derive(Clone, Debug)]
pub struct Fmu<'a> {
    /// `modelIdentifier`: the name of the libraries inside.
    pub model_identifier: &'a str,
    /// The text of modelDescription.xml.
    pub model_description: &'a str,
    /// The libraries, each for its platform.
    pub libraries: Vec<(Platform, Vec<u8>)>,
    /// Further files by their path in the archive, `documentation/LICENSE` for one.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Fmu<'_> {
    /// Writes the archive.
    ///
    /// # Errors
    /// When writing fails, two parts have the same path, or a file lies where the standard has no place for
    /// it.
    pub fn write(&self, writer: impl Write + Seek) -> io::Result<()> {
        let mut entries = vec![];
        for (path, _) in &self.files {
            refuse_stray(path)?;
        }
        for (platform, library) in &self.libraries {
            let (folder, suffix) = (platform.folder(), platform.library_suffix());
            entries
                .push((format!("binaries/{folder}/{}.{suffix}", self.model_identifier), library.as_slice()));
        }
        entries.extend(self.files.iter().map(|(path, content)| (path.clone(), content.as_slice())));
        entries.sort();
        // First what every importer reads first.
        entries.insert(0, ("modelDescription.xml".to_owned(), self.model_description.as_bytes()));
        archive::write(writer, &entries)?;
        Ok(())
    }
}

/// Completes the page that the build made (its `index.html`) with what is known only now, for example the
/// platforms that the FMU has libraries for: a line of text each. It belongs to
/// `documentation/index.html`.
///
/// # Errors
/// When the page is not one that the build made.
pub fn documentation(page: &str, packed: &[String]) -> io::Result<String> {
    let (before, after) = page.split_once(PACKAGE_MARK).ok_or_else(|| {
        io::Error::new(io::ErrorKind::InvalidInput, format!("the page has no {PACKAGE_MARK}"))
    })?;
    let lines = packed.iter().map(escape).collect::<Vec<_>>().join("<br/>");
    Ok(format!("{before}<div><dt>Packed for</dt><dd>{lines}</dd></div>{after}"))
}

/// Refuses what lies neither in a folder of the standard nor is its picture, or would be extracted elsewhere.
fn refuse_stray(path: &str) -> io::Result<()> {
    let mut parts = path.split('/');
    let folder = parts.next().unwrap_or_default();
    let is_inside = ["documentation", "resources", "sources"].contains(&folder)
        && path.contains('/')
        && parts.all(|part| !["", ".", ".."].contains(&part));
    if (is_inside || path == "model.png") && !path.contains(['\\', ':']) {
        Ok(())
    } else {
        Err(io::Error::new(io::ErrorKind::InvalidInput, format!("the standard has no place for '{path}'")))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn archive() -> Vec<u8> {
        let fmu = Fmu {
            model_identifier: "Lag",
            model_description: "<xml/>",
            libraries: vec![(Platform::Win64, b"dll".to_vec()), (Platform::Linux64, b"so".to_vec())],
            files: vec![("documentation/LICENSE".to_owned(), b"free".to_vec())],
        };
        let mut bytes = Cursor::new(vec![]);
        fmu.write(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn parts_lie_where_the_standard_wants_them() {
        let mut zip = zip::ZipArchive::new(Cursor::new(archive())).unwrap();
        let names: Vec<_> =
            (0..zip.len()).map(|index| zip.by_index(index).unwrap().name().unwrap().into_owned()).collect();
        assert_eq!(
            names,
            [
                "modelDescription.xml",
                "binaries/linux64/Lag.so",
                "binaries/win64/Lag.dll",
                "documentation/LICENSE"
            ]
        );
        let mut content = String::new();
        io::Read::read_to_string(&mut zip.by_name("binaries/win64/Lag.dll").unwrap(), &mut content).unwrap();
        assert_eq!(content, "dll");
    }

    #[test]
    fn the_page_says_what_the_fmu_was_packed_for() {
        let page = format!("<dl>{PACKAGE_MARK}</dl>");
        let lines = ["linux64".to_owned(), "a <b> & c".to_owned()];
        assert_eq!(
            documentation(&page, &lines).unwrap(),
            "<dl><div><dt>Packed for</dt><dd>linux64<br/>a &lt;b&gt; &amp; c</dd></div></dl>"
        );
        let error = documentation("<dl></dl>", &lines).unwrap_err();
        assert_eq!(error.to_string(), "the page has no <!-- packed -->");
    }

    #[test]
    fn a_path_that_stands_twice_is_refused() {
        let fmu = Fmu {
            model_identifier: "Lag",
            model_description: "<xml/>",
            libraries: vec![],
            files: vec![("resources/a".to_owned(), vec![]), ("resources/a".to_owned(), vec![])],
        };
        let error = fmu.write(Cursor::new(vec![])).unwrap_err();
        assert!(error.to_string().contains("Duplicate filename"), "{error}");
    }

    #[test]
    fn a_file_that_the_standard_has_no_place_for_is_refused() {
        let written = |path: &str| {
            let files = vec![(path.to_owned(), vec![])];
            let fmu = Fmu { model_identifier: "Lag", model_description: "<xml/>", libraries: vec![], files };
            fmu.write(Cursor::new(vec![])).map_err(|error| error.to_string())
        };
        for path in ["documentation/index.html", "resources/a/b.csv", "sources/lag.c", "model.png"] {
            assert_eq!(written(path), Ok(()));
        }
        for path in [
            "",
            "LICENSE",
            "notes/a.txt",
            "Documentation/a.txt",
            "binaries/linux64/other.so",
            "documentation",
            "documentation/",
            "/etc/passwd",
            "../a.txt",
            "resources/../../a.txt",
            "resources//a.txt",
            "resources/./a.txt",
            "resources\\a.txt",
            "C:/a.txt",
        ] {
            assert_eq!(written(path), Err(format!("the standard has no place for '{path}'")));
        }
    }

    #[test]
    fn the_time_of_day_does_not_matter() {
        let mut zip = zip::ZipArchive::new(Cursor::new(archive())).unwrap();
        for index in 0..zip.len() {
            assert_eq!(zip.by_index(index).unwrap().last_modified(), Some(zip::DateTime::default()));
        }
    }
}
