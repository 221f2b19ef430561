//! Temporary files and folders, removed when dropped and, on request, when the user interrupts the program.

use std::collections::BTreeSet;
use std::env;
use std::fs::{self, DirEntry, File};
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

/// The exit status of an interrupted program, as in shells.
pub const INTERRUPTED: i32 = 130;
/// The prefix of unfinished files.
const UNFINISHED: &str = ".unfinished-";
/// A folder is locked within this time of its creation.
const UNLOCKED: Duration = Duration::from_secs(60);

/// Whether the user has interrupted the program.
static IS_INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// What is done first when the user interrupts the program.
static ACTIONS: Mutex<Vec<Box<dyn FnOnce() + Send>>> = Mutex::new(Vec::new());
/// Everything to be removed.
static PATHS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn paths() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PATHS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on an interruption (Ctrl-C; on Unix also SIGTERM and SIGHUP) removes temporary files and folders, and ends
/// the process with [`INTERRUPTED`]. No effect if one of these signals is ignored, as under `nohup`.
pub fn remove_when_interrupted() {
    let end = || {
        IS_INTERRUPTED.store(true, Ordering::SeqCst);
        let actions = mem::take(&mut *ACTIONS.lock().unwrap_or_else(PoisonError::into_inner));
        for act in actions {
            act();
        }
        remove_all();
        process::exit(INTERRUPTED);
    };
    // It fails if a signal is ignored.
    let _ = ctrlc::try_set_handler(end);
}

/// Has something done when the user interrupts the program, before temporary files are removed.
pub fn when_interrupted(act: impl FnOnce() + Send + 'static) {
    ACTIONS.lock().unwrap_or_else(PoisonError::into_inner).push(Box::new(act));
}

/// Whether an interruption is ending the process.
#[must_use]
pub fn is_interrupted() -> bool {
    IS_INTERRUPTED.load(Ordering::SeqCst)
}

/// Waits for the end of the process if an interruption is ending it, so that what it causes is not reported as a failure.
pub fn leave_to_interruption() {
    while is_interrupted() {
        thread::park();
    }
}

/// Removes all temporary files and folders, just before the process ends.
pub fn remove_all() {
    let paths = paths();
    for path in paths.iter() {
        // Windows cannot remove a loaded library.
        let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    }
    // Locked until the process ends, so that nothing else is created or moved.
    mem::forget(paths);
}

/// A folder in the system's temporary folder, locked while its process lives.
pub struct Folder(Option<(TempDir, Option<File>)>);

impl Folder {
    /// Creates and fills a folder; removes it on failure. Only one is filled at a time. Removes folders with this
    /// prefix left by killed processes, so no other folders may use it.
    ///
    /// # Errors
    /// When it cannot be created, or `fill` fails.
    pub fn filled<E: From<io::Error>>(
        prefix: &str,
        fill: impl FnOnce(&Path) -> Result<(), E>,
    ) -> Result<Self, E> {
        // An interruption waits until the folder is registered.
        let mut paths = paths();
        remove_abandoned(prefix);
        let folder = Builder::new().prefix(prefix).tempdir()?;
        let lock = lock(folder.path());
        fill(folder.path())?;
        paths.insert(folder.path().to_owned());
        Ok(Self(Some((folder, lock))))
    }

    /// The folder's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.as_ref().map_or(Path::new(""), |(folder, _)| folder.path())
    }
}

/// Locks a folder, unless another process does; none on Windows, which cannot open folders as files.
fn lock(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    folder.try_lock().ok()?;
    Some(folder)
}

fn remove_abandoned(prefix: &str) {
    let age = |entry: &DirEntry| {
        let metadata = entry.metadata().ok().filter(fs::Metadata::is_dir)?;
        metadata.modified().ok()?.elapsed().ok()
    };
    // The name first: there may be thousands of other files.
    let is_abandoned = |entry: &DirEntry| {
        entry.file_name().to_string_lossy().starts_with(prefix)
            && age(entry).is_some_and(|age| age > UNLOCKED)
            && lock(&entry.path()).is_some()
    };
    for entry in fs::read_dir(env::temp_dir()).into_iter().flatten().flatten().filter(is_abandoned) {
        // Other users' folders cannot be removed.
        let _ = fs::remove_dir_all(entry.path());
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Some((folder, _lock)) = self.0.take() {
            let mut paths = paths();
            paths.remove(folder.path());
            drop(folder);
        }
    }
}

/// An unfinished file.
pub(crate) struct Unfinished(Option<NamedTempFile>);

impl Unfinished {
    /// Creates a file with a unique name and a new file's usual permissions.
    pub(crate) fn new_in(folder: &Path) -> io::Result<Self> {
        // Without this, the error of a missing folder would name the temporary file.
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
        self.0.as_ref().map(NamedTempFile::as_file).ok_or_else(|| io::Error::other("it was already moved"))
    }

    /// Moves the file to its path; replaces an existing file only if `replaces`.
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

/// Removes unfinished files left by killed processes in a folder to which no other process writes.
///
/// # Errors
/// When the folder cannot be read, or a file cannot be removed.
pub fn remove_unfinished(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;

    #[cfg(unix)]
    #[test]
    fn only_the_folders_of_killed_processes_are_removed() {
        let prefix = format!(".test-of-temporary-{}-", process::id());
        let filled = || Folder::filled(&prefix, |folder| fs::write(folder.join("a"), "")).unwrap();
        let plain = || Builder::new().prefix(&prefix).tempdir().unwrap();
        let (alive, killed, new) = (filled(), plain(), plain());
        for folder in [alive.path(), killed.path()] {
            let hour_ago = SystemTime::now() - Duration::from_secs(3600);
            File::open(folder).unwrap().set_modified(hour_ago).unwrap();
        }
        let other = filled();
        let exists = [alive.path(), killed.path(), new.path(), other.path()].map(Path::exists);
        assert_eq!(exists, [true, false, true, true]);
    }
}
