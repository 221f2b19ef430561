//! The files of a system: structures, parameter sets and mappings, in folders, packages and FMUs.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, bail};
use fmu_io::temporary::Folder;
use fmu_package::{ComponentKind, Resource, SystemDescription, archive, read_xml};

use crate::importer::extract;

/// The temporary folders of a system's packages, with its FMUs: keep them while its scenario is in use.
#[derive(Default)]
pub struct Unpacked(Vec<(Folder, PathBuf)>);

impl Unpacked {
    /// Unpacks a package, and returns its folder.
    pub(super) fn add(&mut self, package: &Path) -> Result<PathBuf> {
        let folder =
            extract(package, |_| true).with_context(|| format!("cannot read {}", package.display()))?;
        let path = folder.path().to_owned();
        self.0.push((folder, package.to_owned()));
        Ok(path)
    }

    /// An error of the system's run, in which the packages' paths replace those of the folders.
    #[must_use]
    pub fn named(&self, error: &Error) -> Error {
        let mut message = format!("{error:#}");
        // A package within another is in the other's folder.
        for (folder, package) in self.0.iter().rev() {
            let [folder, package] = [folder.path(), package].map(|path| path.display().to_string());
            message = message.replace(&folder, &package);
        }
        Error::msg(message)
    }
}

/// The most files around a structure: one that contains itself ends here.
const DEEPEST: usize = 10;

/// The folder of a structure.
#[derive(Clone)]
pub struct Base {
    /// The folder of the package, or that of the structure if it is not packed.
    root: PathBuf,
    /// The structure's folder in the root.
    folder: String,
    /// Whether no path leaves the root.
    is_package: bool,
    /// How many files are around the structure's file.
    depth: usize,
}

impl Base {
    /// The folder of a package.
    pub fn of_package(root: PathBuf) -> Self {
        Self { root, folder: String::new(), is_package: true, depth: 0 }
    }

    /// The folder of a structure that is not packed.
    pub fn of_structure(structure: &Path) -> Self {
        let root = structure.parent().unwrap_or(Path::new("")).to_owned();
        Self { root, folder: String::new(), is_package: false, depth: 0 }
    }

    /// The path from the root of a file that the structure names.
    fn path(&self, path: &str) -> Result<String> {
        let mut parts = vec![];
        for part in self.folder.split('/').chain(path.split('/')) {
            match part {
                "" | "." => {}
                ".." if parts.last().is_some_and(|last| *last != "..") => drop(parts.pop()),
                part => parts.push(part),
            }
        }
        let joined = parts.join("/");
        if self.is_package && !archive::is_inside(&joined) {
            bail!("'{path}' is not a file in the package");
        }
        Ok(joined)
    }

    /// A file that the structure names.
    pub fn file(&self, path: &str) -> Result<PathBuf> {
        Ok(self.root.join(self.path(path)?))
    }

    /// Reads a structure by its path from this folder; returns its own folder, too.
    pub fn structure(&self, name: &str) -> Result<(SystemDescription, Self)> {
        let path = self.path(name)?;
        let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned();
        Ok((parse(&self.root.join(&path))?, Self { folder, ..self.clone() }))
    }

    /// The structure of a component, and its folder.
    pub fn open(
        &self,
        source: &str,
        kind: &ComponentKind,
        unpacked: &mut Unpacked,
    ) -> Result<(SystemDescription, Self)> {
        if self.depth == DEEPEST {
            bail!("there are more than {DEEPEST} systems around it");
        }
        let (base, structure) = match kind {
            ComponentKind::Package(structure) => {
                (Self::of_package(unpacked.add(&self.file(source)?)?), structure.as_str())
            }
            _ => (self.clone(), source),
        };
        let (description, base) = base.structure(structure)?;
        Ok((description, Self { depth: self.depth + 1, ..base }))
    }

    /// Reads what the structure contains or refers to; files in a component are in an FMU.
    pub fn load<T: Clone>(
        &self,
        resource: &Resource<T>,
        fmu: Option<&Path>,
        parse: impl FnOnce(&str) -> io::Result<T>,
    ) -> Result<T> {
        let (text, path) = match resource {
            Resource::Inline(content) => return Ok(content.clone()),
            Resource::File(path) => (read_xml(&self.file(path)?)?, path),
            Resource::InComponent(path) => {
                let fmu = fmu.with_context(|| format!("'{path}' is not in an FMU"))?;
                let mut archive = archive::open(BufReader::new(File::open(fmu)?))?;
                (archive::read_text(&mut archive, path)?, path)
            }
        };
        parse(&text).with_context(|| path.clone())
    }
}

/// Reads a structure.
fn parse(structure: &Path) -> Result<SystemDescription> {
    let text = read_xml(structure)?;
    SystemDescription::parse(&text).with_context(|| structure.display().to_string())
}
