//! The files that the model reads at run time: the folder `resources` of the FMU (FMI 2.0.5, section 2.3).

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::Error;

/// A folder of files.
pub(crate) struct Resources {
    pub(crate) folder: PathBuf,
    /// The files in the folder and its subfolders, relative to it.
    files: Vec<PathBuf>,
}

impl Resources {
    /// Finds the files of a folder. The folder must not contain the declaration, because it would then be a whole
    /// package, with cargo's build output.
    pub(crate) fn find(folder: PathBuf, declaration: &Path) -> Result<Self, String> {
        if !folder.is_dir() {
            return Err(format!("there is no folder {}", folder.display()));
        }
        let unreadable =
            |error: io::Error| format!("the folder {} cannot be read: {error}", folder.display());
        let within = declaration.canonicalize().map_err(unreadable)?;
        if within.starts_with(folder.canonicalize().map_err(unreadable)?) {
            return Err(
                "the folder also holds this file; put the resources into a separate folder".to_owned()
            );
        }
        let (mut files, mut pending) = (Vec::new(), vec![folder.clone()]);
        while let Some(next) = pending.pop() {
            for entry in fs::read_dir(&next).map_err(unreadable)? {
                let path = entry.map_err(unreadable)?.path();
                if path.file_name().and_then(OsStr::to_str).is_none() {
                    return Err(format!(
                        "the name {} is not Unicode, as names in an FMU must be",
                        path.display()
                    ));
                }
                if path.is_dir() {
                    pending.push(path);
                } else if path.is_file() {
                    files.extend(path.strip_prefix(&folder).map(Path::to_owned));
                } else {
                    return Err(format!("{} is neither a file nor a folder", path.display()));
                }
            }
        }
        Ok(Self { folder, files })
    }

    /// Copies the files into another folder.
    pub(crate) fn copy_to(&self, target: &Path) -> Result<(), Error> {
        let of = |file: &Path| {
            let file = file.to_owned();
            move |error: io::Error| Error::of_file(&file, error)
        };
        fs::create_dir_all(target).map_err(of(target))?;
        for file in &self.files {
            let (source, target) = (self.folder.join(file), target.join(file));
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder).map_err(of(folder))?;
            }
            // Copies only the content, because a copy with read-only permissions could not be replaced.
            let content = fs::read(&source).map_err(of(&source))?;
            fs::write(&target, content).map_err(of(&target))?;
        }
        Ok(())
    }
}
