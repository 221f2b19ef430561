//! The .fmu archive (FMI 2.0.5, section 2.3; FMI 3.0.2, section 2.5.1): a ZIP file with modelDescription.xml and the
//! model's library for each platform.

use std::io::{self, Write};

use fmu_terms::Version;

use crate::archive;
use crate::identifier::refuse_no_identifier;
use crate::library::Library;
use crate::model_description::MODEL_DESCRIPTION;
use crate::platform::Platform;

/// The parts of an FMU.
#[derive(Clone, Debug)]
pub struct Fmu<'a> {
    /// `modelIdentifier`: the name of the libraries inside.
    pub model_identifier: &'a str,
    /// The text of modelDescription.xml.
    pub model_description: &'a str,
    /// The FMU's version of FMI.
    pub version: Version,
    /// The libraries, by platform.
    pub libraries: Vec<(Platform, Vec<u8>)>,
    /// Further files by path in the archive, such as `documentation/LICENSE`.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Fmu<'_> {
    /// Writes the archive.
    ///
    /// # Errors
    /// When writing fails, the identifier is not a C identifier, two parts have the same path, or the standard does
    /// not allow a file's path.
    pub fn write(&self, writer: impl Write) -> io::Result<()> {
        refuse_no_identifier(self.model_identifier)?;
        let mut entries = vec![];
        for (path, _) in &self.files {
            refuse_stray(path)?;
        }
        for (platform, library) in &self.libraries {
            for folder in self.folders(*platform, library)? {
                entries.push((platform.path_in(&folder, self.model_identifier), library.as_slice()));
            }
        }
        entries.extend(self.files.iter().map(|(path, content)| (path.clone(), content.as_slice())));
        entries.sort();
        // Every importer reads this first.
        entries.insert(0, (MODEL_DESCRIPTION.to_owned(), self.model_description.as_bytes()));
        archive::write(writer, &entries)
    }
}

impl Fmu<'_> {
    /// A library's folders: in FMI 3.0 one per processor.
    fn folders(&self, platform: Platform, library: &[u8]) -> io::Result<Vec<String>> {
        if self.version == Version::Two {
            return Ok(vec![platform.folder().to_owned()]);
        }
        let mut folders = Library::read(library)?.folders(platform, Version::Three);
        // A library for this processor only takes precedence over the universal one, which would be in the same
        // folder.
        let own = Platform::Aarch64Darwin;
        if platform != own && self.libraries.iter().any(|(platform, _)| *platform == own) {
            folders.retain(|folder| folder != own.folder());
        }
        Ok(folders)
    }
}

/// Rejects a file outside the standard's folders other than its picture, or with a harmful path.
fn refuse_stray(path: &str) -> io::Result<()> {
    let mut parts = path.split('/');
    let folder = parts.next().unwrap_or_default();
    let is_inside = ["documentation", "resources", "sources", "terminalsAndIcons"].contains(&folder)
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
            version: Version::Two,
            libraries: vec![(Platform::Win64, b"dll".to_vec()), (Platform::Linux64, b"so".to_vec())],
            files: vec![("documentation/LICENSE".to_owned(), b"free".to_vec())],
        };
        let mut bytes = Cursor::new(vec![]);
        fmu.write(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn files_are_where_the_standard_requires_them() {
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
    fn a_duplicate_path_is_refused() {
        let fmu = Fmu {
            model_identifier: "Lag",
            model_description: "<xml/>",
            version: Version::Two,
            libraries: vec![],
            files: vec![("resources/a".to_owned(), vec![]), ("resources/a".to_owned(), vec![])],
        };
        let error = fmu.write(Cursor::new(vec![])).unwrap_err();
        assert!(error.to_string().contains("its entry 'resources/a' occurs twice"), "{error}");
    }

    #[test]
    fn a_file_outside_the_standards_folders_is_refused() {
        let written = |path: &str| {
            let files = vec![(path.to_owned(), vec![])];
            let fmu = Fmu {
                model_identifier: "Lag",
                model_description: "<xml/>",
                version: Version::Two,
                libraries: vec![],
                files,
            };
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
            "resources/..\\a.txt",
            "C:/a.txt",
            "resources/C:a.txt",
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
