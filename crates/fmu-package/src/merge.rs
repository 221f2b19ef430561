//! Joins FMUs of one model, with libraries for different platforms, into one with all of them.
//!
//! The FMUs are not trusted: the descriptions must be equal, each library must match its folder, and other differences
//! are rejected.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};

use fmu_io::reading::broken;
use fmu_terms::Version;

use crate::archive;
use crate::library::{self, Library};
use crate::model_description::{FmuDescription, MODEL_DESCRIPTION};
use crate::platform::Platform;
use crate::platform_list::PlatformList;
use crate::xml;

/// An FMU to merge.
#[derive(Clone, Debug)]
pub struct Part {
    /// The FMU's name in messages.
    pub name: String,
    /// The FMU's files by path, from [`archive::read_files`].
    pub files: BTreeMap<String, Vec<u8>>,
}

/// An FMU with the libraries of all parts.
#[derive(Clone, Debug)]
pub struct Merged<'a> {
    files: BTreeMap<&'a str, Cow<'a, [u8]>>,
    /// The libraries of the merged FMU, by platform.
    pub platforms: PlatformList,
}

impl<'a> Merged<'a> {
    /// Merges parts. `runs` lists where libraries were run, beyond the parts' own lists.
    ///
    /// # Errors
    /// When the parts are of different models, or conflict; the message names them.
    pub fn new(parts: &'a [Part], runs: &BTreeMap<Platform, String>) -> io::Result<Self> {
        let (first, others) = parts.split_first().ok_or_else(|| broken("there is nothing to merge"))?;
        let description = first.description()?;
        let version = description.version();
        let mut all_runs = first.runs();
        let of_part = |part: &'a Part| {
            part.files
                .iter()
                .map(move |(path, content)| (path.as_str(), (part, Cow::Borrowed(content.as_slice()))))
        };
        let mut files: BTreeMap<_, _> = of_part(first).collect();
        for other in others {
            first.refuse_another_model(other)?;
            first.refuse_other_documents(other)?;
            for (path, (part, content)) in of_part(other) {
                match files.get_mut(path) {
                    None => drop(files.insert(path, (part, content))),
                    Some((_, known)) if *known == content || path == PlatformList::PATH => {}
                    Some((part, known)) => {
                        let united = unite(path, known, &content)
                            .map_err(|error| broken(format!("{} and {}: {error}", part.name, other.name)))?;
                        *known = Cow::Owned(united);
                    }
                }
            }
            for (folder, run) in other.runs() {
                let known: &mut String = all_runs.entry(folder).or_default();
                if !known.contains(&run) {
                    *known = if known.is_empty() { run } else { format!("{known}, {run}") };
                }
            }
        }

        let mut libraries = BTreeMap::new();
        for (_, attributes) in &description.interfaces {
            let identifier = attributes.iter().find(|(name, _)| name == "modelIdentifier");
            let identifier = identifier.map_or("", |(_, identifier)| identifier);
            for (path, (part, content)) in &files {
                let Some((platform, folder)) = library_at(path, identifier, version) else { continue };
                let library = Library::read(content).and_then(|library| {
                    let is_for_it = |own: &String| own == folder && library.format == platform.format();
                    if version == Version::Three && library.folders(platform, version).iter().any(is_for_it) {
                        return Ok(library);
                    }
                    library.fits(platform).map(|()| library)
                });
                let library = library
                    .map_err(|error| broken(format!("the library for {folder} in {}: {error}", part.name)))?;
                libraries.insert((*folder).to_owned(), library);
            }
        }
        // A platform may have a folder per processor.
        for (&platform, run) in runs {
            let folders: Vec<_> = libraries
                .keys()
                .filter(|folder| Platform::of_folder(folder, version) == Some(platform))
                .collect();
            if folders.is_empty() {
                return Err(broken(format!("there is no library for {} that was run", platform.folder())));
            }
            all_runs.extend(folders.into_iter().map(|folder| (folder.clone(), run.clone())));
        }
        if let Some(folder) = all_runs.keys().find(|run| !libraries.contains_key(*run)) {
            return Err(broken(format!("there is no library for {folder} that was run")));
        }
        let platforms = PlatformList { libraries, runs: all_runs };
        let mut files: BTreeMap<_, _> =
            files.into_iter().map(|(path, (_, content))| (path, content)).collect();
        files.insert(PlatformList::PATH, Cow::Owned(platforms.to_string().into_bytes()));
        Ok(Self { files, platforms })
    }

    /// Writes the archive.
    ///
    /// # Errors
    /// When writing fails.
    pub fn write(&self, writer: impl Write) -> io::Result<()> {
        let mut entries: Vec<_> =
            self.files.iter().map(|(path, content)| ((*path).to_owned(), content.as_ref())).collect();
        // Every importer reads this first.
        entries.sort_by_key(|(path, _)| path != MODEL_DESCRIPTION);
        archive::write(writer, &entries)
    }
}

impl Part {
    fn description(&self) -> io::Result<FmuDescription> {
        let bytes = self.files.get(MODEL_DESCRIPTION);
        let bytes =
            bytes.ok_or_else(|| broken(format!("there is no {MODEL_DESCRIPTION} in {}", self.name)))?;
        xml::decode(bytes.clone())
            .and_then(|(text, _)| FmuDescription::parse(&text))
            .map_err(|error| broken(format!("{MODEL_DESCRIPTION} in {} cannot be read: {error}", self.name)))
    }

    fn runs(&self) -> BTreeMap<String, String> {
        let text = self.files.get(PlatformList::PATH).map(|bytes| String::from_utf8_lossy(bytes));
        text.map(|text| PlatformList::read_runs(&text)).unwrap_or_default()
    }

    fn refuse_another_model(&self, other: &Self) -> io::Result<()> {
        let [own, others] = [self, other].map(Self::description);
        let (own, others) = (own?, others?);
        let guids = [own.guid(), others.guid()];
        let refuse = |what: String| Err(broken(format!("{} and {} {what}", self.name, other.name)));
        if guids[0] != guids[1] {
            return refuse(format!("are different models, with the GUIDs {} and {}", guids[0], guids[1]));
        }
        if self.files.get(MODEL_DESCRIPTION) != other.files.get(MODEL_DESCRIPTION) {
            return refuse(format!("have the same GUID {}, but different descriptions", guids[0]));
        }
        Ok(())
    }

    /// Rejects another FMU that differs in more than its libraries and their list.
    fn refuse_other_documents(&self, other: &Self) -> io::Result<()> {
        for path in self.files.keys().chain(other.files.keys()) {
            if path.starts_with("binaries/") || path == PlatformList::PATH {
                continue;
            }
            // Another compiler may link other packages, whose licenses are also kept.
            if path.starts_with("documentation/licenses/")
                && !(self.files.contains_key(path) && other.files.contains_key(path))
            {
                continue;
            }
            if self.files.get(path) != other.files.get(path) {
                return Err(broken(format!("{} and {} differ in {path}", self.name, other.name)));
            }
        }
        Ok(())
    }
}

/// The platform and folder of a model's library.
fn library_at<'a>(path: &'a str, identifier: &str, version: Version) -> Option<(Platform, &'a str)> {
    let folder = path.strip_prefix("binaries/")?.split('/').next()?;
    let platform = Platform::of_folder(folder, version)?;
    (platform.path_in(folder, identifier) == path).then_some((platform, folder))
}

/// Joins two libraries with the same path.
fn unite(path: &str, first: &[u8], second: &[u8]) -> io::Result<Vec<u8>> {
    if path.split('/').nth(1) == Some(Platform::Darwin64.folder()) {
        return library::join(&[first, second])
            .map_err(|error| broken(format!("both contain {path}: {error}")));
    }
    Err(broken(format!("both contain {path}, which differ")))
}
