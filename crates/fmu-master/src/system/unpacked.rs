//! The temporary folders of a system's packages.

use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result};
use fmu_io::temporary::Folder;

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
