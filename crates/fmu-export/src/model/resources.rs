//! The files in an FMU's folder `resources`, which an importer passes as a URI (FMI 2.0.5, section 2.1.5).

use std::borrow::Cow;
#[cfg(not(target_family = "wasm"))]
use std::fs;
use std::path::{Component, Path, PathBuf};

use fmu_solve::Error;

use crate::model::variables::Variables;

/// The folder's path, or why there is none.
#[derive(Debug)]
pub(crate) struct Resources(Result<Cow<'static, Path>, Cow<'static, str>>);

impl Resources {
    /// The resources of an FMU without files.
    pub(crate) fn none() -> Self {
        Self(Err("the model's JSON has no \"resources\"".into()))
    }

    /// The folder from which an FMU's resources come.
    pub(crate) fn of<V: Variables>() -> Self {
        V::RESOURCES.map_or_else(Self::none, |folder| Self(Ok(Path::new(folder).into())))
    }

    /// The folder of a URI; some importers pass a path instead, or nothing.
    pub(crate) fn at(location: Option<&[u8]>) -> Self {
        Self(match location {
            None => Err("fmuResourceLocation was NULL".into()),
            Some(location) => path(location).map(Cow::Owned).ok_or_else(|| {
                format!(
                    "fmuResourceLocation {:?} is not a URI of a folder on this computer (file:///...)",
                    String::from_utf8_lossy(location)
                )
                .into()
            }),
        })
    }

    /// The folder of a path, which importers may omit (FMI 3.0.2, section 2.3.1).
    pub(crate) fn at_path(path: Option<&[u8]>) -> Self {
        Self(match path.map(str::from_utf8) {
            None => Err("resourcePath was NULL".into()),
            Some(Err(_)) => Err("resourcePath is not valid UTF-8".into()),
            Some(Ok(path)) => Ok(Cow::Owned(path.into())),
        })
    }

    /// The content of a file up to a size in bytes, by its path in the folder.
    pub(crate) fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, Error> {
        let unreadable = |why: &str| Error::new(format!("the resource {name} cannot be read: {why}"));
        if !Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        {
            return Err(unreadable(
                "its path leads out of the folder `resources`; `Context::file` reads other files",
            ));
        }
        let file = self.0.as_ref().map_err(|why| unreadable(why))?.join(name);
        read(&file, most).map_err(|why| unreadable(&format!("{}: {why}", file.display())))
    }
}

/// The content of a user's file up to a size in bytes.
pub(crate) fn file(path: &str, most: u64) -> Result<Vec<u8>, Error> {
    read(Path::new(path), most).map_err(|why| Error::new(format!("the file {path:?} cannot be read: {why}")))
}

/// Reads a file up to a size in bytes: not a pipe or device, which may never end.
#[cfg(not(target_family = "wasm"))]
fn read(file: &Path, most: u64) -> Result<Vec<u8>, String> {
    let found = fs::metadata(file).map_err(|error| error.to_string())?;
    if !found.is_file() {
        return Err("it is not a file".to_owned());
    }
    check_size(found.len(), most)?;
    fs::read(file).map_err(|error| error.to_string())
}

#[cfg(target_family = "wasm")]
fn read(file: &Path, most: u64) -> Result<Vec<u8>, String> {
    let path = file.to_str().ok_or("its path is not valid UTF-8")?;
    let size = crate::host::size_of(path).ok_or("the host does not find it")?;
    check_size(size as u64, most)?;
    crate::host::read(path, size).ok_or_else(|| "the host cannot read it".to_owned())
}

fn check_size(size: u64, most: u64) -> Result<(), String> {
    if size <= most { Ok(()) } else { Err(format!("it has {size} bytes; the model accepts at most {most}")) }
}

/// The path of a file URI (RFC 8089), or of a location without a scheme.
fn path(location: &[u8]) -> Option<PathBuf> {
    let location = str::from_utf8(location).ok()?;
    let rest = match location.split_once(':') {
        // Schemes have no case.
        Some((scheme, rest)) if scheme.eq_ignore_ascii_case("file") => rest,
        // A Windows drive has one letter.
        Some((scheme, _)) if scheme.len() > 1 && !scheme.contains('/') => return None,
        _ => return (!location.is_empty()).then(|| Path::new(location).to_path_buf()),
    };
    let encoded = match rest.strip_prefix("//") {
        None => rest,
        Some(with_host) => {
            let path = with_host.find('/')?;
            let (host, path) = with_host.split_at(path);
            matches!(host, "" | "localhost").then_some(path)?
        }
    };
    let decoded = decoded(encoded)?;
    // "/C:/fmu" is "C:/fmu".
    let is_drive = matches!(decoded.as_bytes(), [b'/', letter, b':', ..] if letter.is_ascii_alphabetic());
    Some(PathBuf::from(if is_drive { &decoded[1..] } else { &decoded }))
}

/// A text with percent-encoded bytes decoded.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        if *first == b'%' {
            let digits = str::from_utf8(after.get(..2)?).ok()?;
            bytes.push(u8::from_str_radix(digits, 16).ok()?);
            rest = &after[2..];
        } else {
            bytes.push(*first);
        }
    }
    String::from_utf8(bytes).ok().filter(|path| path.starts_with('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn locations_become_paths() {
        for (location, expected) in [
            ("file:///tmp/a%20fmu/resources", Some("/tmp/a fmu/resources")),
            ("file:/tmp/resources", Some("/tmp/resources")),
            ("FILE:///tmp/resources", Some("/tmp/resources")),
            ("file://localhost/tmp/resources", Some("/tmp/resources")),
            ("file:///C:/fmu%C3%A4/resources", Some("C:/fmuä/resources")),
            ("/tmp/resources", Some("/tmp/resources")),
            (r"C:\fmu\resources", Some(r"C:\fmu\resources")),
            ("file://server/resources", None),
            ("https://example.org/resources", None),
            ("file:///tmp/%zz", None),
            ("file:///tmp/%e", None),
            ("file:tmp", None),
            ("filé:/tmp", None),
            (":tmp", Some(":tmp")),
            ("file://", None),
            ("", None),
        ] {
            assert_eq!(path(location.as_bytes()), expected.map(PathBuf::from), "{location}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_named_with_the_reason() {
        let reason =
            |location: Option<&[u8]>| Resources::at(location).read("y.txt", 9).unwrap_err().to_string();
        assert_eq!(reason(None), "the resource y.txt cannot be read: fmuResourceLocation was NULL");
        assert!(reason(Some(b"https://example.org")).contains("\"https://example.org\""));
        assert!(reason(Some(b"file:///nowhere")).starts_with("the resource y.txt cannot be read: /nowhere"));
    }

    /// A pipe or device could be read forever, and a file of any size into memory.
    #[test]
    fn only_files_of_some_size_are_read() {
        let resources = Resources::at_path(Some(env!("CARGO_MANIFEST_DIR").as_bytes()));
        let size = fs::metadata(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap().len();
        assert_eq!(resources.read("Cargo.toml", size).unwrap().len() as u64, size);
        let reason = |name, most| resources.read(name, most).unwrap_err().to_string();
        assert!(reason("Cargo.toml", size - 1).contains(&format!("it has {size} bytes; the model accepts")));
        assert!(reason("src", size).ends_with("src: it is not a file"));
        let refused = |path, most| file(path, most).unwrap_err().to_string();
        #[cfg(unix)]
        assert_eq!(refused("/dev/zero", size), "the file \"/dev/zero\" cannot be read: it is not a file");
        assert!(refused("", size).starts_with("the file \"\" cannot be read: "));
        assert_eq!(file("Cargo.toml", size).unwrap(), resources.read("./Cargo.toml", size).unwrap());
    }

    #[test]
    fn resources_are_in_their_folder_only() {
        let resources = Resources::at_path(Some(concat!(env!("CARGO_MANIFEST_DIR"), "/src").as_bytes()));
        assert!(resources.read("fmi2/c_api.rs", 1 << 20).is_ok());
        let absolute = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        for name in ["../Cargo.toml", "fmi2/../../Cargo.toml", "..", absolute] {
            let reason = resources.read(name, 1 << 20).unwrap_err().to_string();
            assert!(reason.contains("its path leads out of the folder `resources`"), "{reason}");
        }
    }
}
