//! Writes files atomically.
//!
//! A file is written under a unique name in the same folder and then renamed: readers never see a part of it, two
//! processes with the same output do not mix, and an existing file stays if writing fails.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::temporary::Unfinished;

/// The writer of a file's content.
pub type Writer<'a> = BufWriter<&'a File>;

/// Writes a file. An existing one is replaced, and keeps its permissions; for a link, the target is replaced. Other
/// targets, such as a pipe or `/dev/stdout`, are written directly.
///
/// # Errors
/// When it cannot be written; the message names it.
pub fn write(path: &Path, content: impl FnOnce(&mut Writer<'_>) -> io::Result<()>) -> io::Result<()> {
    replace(path, content).map_err(|error| cannot_write(path, &error))
}

fn replace(path: &Path, content: impl FnOnce(&mut Writer<'_>) -> io::Result<()>) -> io::Result<()> {
    // A file without write permission must not be replaced either.
    let place = match OpenOptions::new().write(true).open(path) {
        Ok(known) if known.metadata()?.is_file() => Some((fs::canonicalize(path)?, known.metadata()?)),
        Ok(other) => return fill(&other, content),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    let target = place.as_ref().map_or(path, |(target, _)| target);
    let new = Unfinished::new_in(folder(target))?;
    if let Some((_, known)) = &place {
        new.file()?.set_permissions(known.permissions())?;
    }
    fill(new.file()?, content)?;
    // A full disk may only show now.
    new.file()?.sync_all()?;
    new.persist(target, true)
}

/// Writes a file for its user to edit, unless it exists.
///
/// # Errors
/// When it exists, or cannot be written; the message names it.
pub fn write_new(path: &Path, content: &[u8]) -> io::Result<()> {
    let write = || {
        let new = Unfinished::new_in(folder(path))?;
        fill(new.file()?, |writer| writer.write_all(content))?;
        new.file()?.sync_all()?;
        new.persist(path, false)
    };
    write().map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => {
            let message = format!("{} already exists; remove it, or choose another file", path.display());
            io::Error::new(ErrorKind::AlreadyExists, message)
        }
        _ => cannot_write(path, &error),
    })
}

fn fill(file: &File, content: impl FnOnce(&mut Writer<'_>) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::new(file);
    content(&mut writer)?;
    writer.flush()
}

/// Rejects outputs that would overwrite an input or each other; an output folder must not contain an input.
///
/// # Errors
/// When such an output exists, or its folder is missing; the message names it.
pub fn refuse_overlap(outputs: &[PathBuf], inputs: &[PathBuf]) -> io::Result<()> {
    // A missing input is reported when read.
    let inputs: Vec<_> =
        inputs.iter().filter_map(|path| Some((path, fs::canonicalize(path).ok()?))).collect();
    let mut seen: Vec<(&Path, PathBuf)> = vec![];
    for path in outputs {
        let place = place(path).map_err(|error| cannot_write(path, &error))?;
        let refuse = |reason: String| {
            Err(io::Error::new(ErrorKind::InvalidInput, format!("cannot write {}: {reason}", path.display())))
        };
        if let Some((input, _)) = inputs.iter().find(|(_, input)| input.starts_with(&place)) {
            return refuse(format!("the input {} would be lost", input.display()));
        }
        if let Some((other, _)) = seen.iter().find(|(_, other)| *other == place) {
            return refuse(format!("{} is written to the same place", other.display()));
        }
        seen.push((path, place));
    }
    Ok(())
}

/// A file's canonical path; the file need not exist.
fn place(path: &Path) -> io::Result<PathBuf> {
    match (fs::canonicalize(path), path.file_name()) {
        (Err(error), Some(name)) if error.kind() == ErrorKind::NotFound => {
            Ok(fs::canonicalize(folder(path))?.join(name))
        }
        (found, _) => found,
    }
}

/// A file's folder.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn cannot_write(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("cannot write {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names in a folder.
    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<_> = names.map(|name| name.to_str().unwrap().to_owned()).collect();
        names.sort();
        names
    }

    fn write_text(path: &Path, text: &str) -> io::Result<()> {
        write(path, |writer| writer.write_all(text.as_bytes()))
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write_text(&path, "good").unwrap();
        for path in [&path, &folder.path().join("b")] {
            let failed = write(path, |writer| {
                writer.write_all(b"cut")?;
                Err(io::Error::other("no more"))
            });
            assert_eq!(failed.unwrap_err().to_string(), format!("cannot write {}: no more", path.display()));
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), "good");
        assert_eq!(names(folder.path()), ["a"]);
    }

    /// Other files in the folder stay untouched.
    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_target_keeps_its_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [file, link, planted] = ["a", "link", "a.new"].map(|name| folder.path().join(name));
        write_text(&file, "first").unwrap();
        fs::set_permissions(&file, PermissionsExt::from_mode(0o640)).unwrap();
        symlink("a", &link).unwrap();
        symlink("elsewhere", &planted).unwrap();
        write_text(&link, "second").unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "second");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(names(folder.path()), ["a", "a.new", "link"]);
    }

    /// A new file has the permissions of the user's umask.
    #[cfg(unix)]
    #[test]
    fn a_new_file_has_the_permissions_of_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [any, whole, new] = ["any", "whole", "new"].map(|name| folder.path().join(name));
        fs::write(&any, "").unwrap();
        write_text(&whole, "").unwrap();
        write_new(&new, b"").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!([mode(&whole), mode(&new)], [mode(&any); 2]);
    }

    #[test]
    fn a_new_file_does_not_replace_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        write_new(&path, b"mine").unwrap();
        let refusal = write_new(&path, b"other").unwrap_err().to_string();
        assert!(refusal.ends_with("a already exists; remove it, or choose another file"), "{refusal}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
        assert_eq!(names(folder.path()), ["a"]);
    }

    #[test]
    fn outputs_that_would_destroy_something_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("folder")).unwrap();
        for name in ["a", "folder/b"] {
            write_text(&path(name), "").unwrap();
        }
        let refusal = |outputs: &[&str], inputs: &[&str]| {
            let paths = |names: &[&str]| names.iter().map(|name| path(name)).collect::<Vec<_>>();
            let refused = refuse_overlap(&paths(outputs), &paths(inputs));
            refused.map_or_else(|error| error.to_string(), |()| String::new())
        };
        assert_eq!(refusal(&["c", "folder/c"], &["a", "missing"]), "");
        assert!(refusal(&["folder/../a"], &["a"]).ends_with("a would be lost"));
        assert!(refusal(&["folder"], &["a", "folder/b"]).ends_with("folder/b would be lost"));
        assert!(refusal(&["c", "folder/../c"], &[]).ends_with("c is written to the same place"));
        assert!(refusal(&["missing/c"], &[]).starts_with("cannot write "));
    }
}
