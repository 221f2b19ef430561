//! Temporary files and folders: they are removed when dropped and, on request, when the user interrupts the program.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, NamedTempFile, TempDir};

/// The exit status of an interrupted program, as in shells.
pub const INTERRUPTED: i32 = 130;
/// The prefix of unfinished files.
const UNFINISHED: &str = ".unfinished-";

/// Everything to be removed.
static PATHS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn paths() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PATHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on an interruption (Ctrl-C; on Unix also SIGTERM and SIGHUP) removes them, and ends the process with
/// [`INTERRUPTED`]. If one of these signals is ignored, as under `nohup`, this has no effect.
pub fn remove_when_interrupted() {
    let remove = || {
        // Locked until the process ends, so that nothing is created or moved any more.
        let paths = paths();
        for path in paths.iter() {
            // A loaded library cannot be removed on Windows.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
        process::exit(INTERRUPTED);
    };
    // It fails where a signal is ignored.
    let _ = ctrlc::try_set_handler(remove);
}

/// A folder in the system's folder for temporary files.
pub struct Folder(Option<TempDir>);

impl Folder {
    /// Makes a folder and fills it; if that fails, removes it. Only one is filled at a time.
    ///
    /// # Errors
    /// When it cannot be made, or what `fill` returns.
    pub fn filled<E: From<io::Error>>(
        prefix: &str,
        fill: impl FnOnce(&Path) -> Result<(), E>,
    ) -> Result<Self, E> {
        // An interruption waits until the folder is registered.
        let mut paths = paths();
        let folder = Builder::new().prefix(prefix).tempdir()?;
        fill(folder.path())?;
        paths.insert(folder.path().to_owned());
        Ok(Self(Some(folder)))
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.as_ref().map_or(Path::new(""), TempDir::path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Some(folder) = self.0.take() {
            let mut paths = paths();
            paths.remove(folder.path());
            drop(folder);
        }
    }
}

/// An unfinished file.
pub(crate) struct Unfinished(Option<NamedTempFile>);

impl Unfinished {
    /// Makes a file with a unique name and the permissions of any new file.
    pub(crate) fn new_in(folder: &Path) -> io::Result<Self> {
        // Otherwise the error of a missing folder would name the temporary file.
        fs::metadata(folder)?;
        let mut builder = Builder::new();
        builder.prefix(UNFINISHED);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut paths = paths();
        let file = builder.tempfile_in(folder)?;
        paths.insert(file.path().to_owned());
        Ok(Self(Some(file)))
    }

    pub(crate) fn file(&self) -> io::Result<&File> {
        self.0.as_ref().map(NamedTempFile::as_file).ok_or_else(|| io::Error::other("it is in its place"))
    }

    /// Moves the file to its path, and replaces an existing file only if wanted.
    pub(crate) fn persist(mut self, place: &Path, replaces: bool) -> io::Result<()> {
        let mut paths = paths();
        let Some(file) = self.0.take() else { return Ok(()) };
        paths.remove(file.path());
        let moved = if replaces { file.persist(place) } else { file.persist_noclobber(place) };
        moved.map(drop).map_err(|error| error.error)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(file) = self.0.take() {
            let mut paths = paths();
            paths.remove(file.path());
            drop(file);
        }
    }
}

/// Removes the unfinished files that killed processes left in a folder in which no other process writes.
///
/// # Errors
/// When the folder cannot be read, or a file not be removed.
pub fn remove_unfinished(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
