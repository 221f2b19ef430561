//! The contents of FMUs and modules, and their files.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use anyhow::{Context, Result, bail};
use fmu_io::terminal::print;
use fmu_io::{reading, writing};
use fmu_package::{Fmu, Library, Platform, PlatformList, library};
use fmu_terms::{Interface, Version};

use crate::compile::{Compiled, GeneratedDescription};
use crate::target::Build;

/// A library to pack.
pub(super) struct ModelLibrary<'a> {
    platform: Platform,
    file: &'a Path,
    bytes: Vec<u8>,
}

impl<'a> ModelLibrary<'a> {
    /// Reads a library, which must be one for its platform.
    pub(super) fn read(platform: Platform, file: &'a Path) -> Result<Self> {
        let given = Self { platform, file, bytes: reading::bytes(file)? };
        Library::read(&given.bytes)
            .and_then(|library| library.fits(platform))
            .with_context(|| given.refused())?;
        Ok(given)
    }

    /// Whether the library was built from one of some descriptions.
    pub(super) fn is_of(&self, descriptions: &BTreeMap<&str, GeneratedDescription>) -> bool {
        self.model_of(descriptions).is_some()
    }

    /// The model whose description the library was built from, identified by the GUID in it.
    fn model_of<'d>(&self, descriptions: &BTreeMap<&'d str, GeneratedDescription>) -> Option<&'d str> {
        let is_of =
            |description: &GeneratedDescription| holds(&self.bytes, description.content.guid().as_bytes());
        descriptions.iter().find(|(_, description)| is_of(description)).map(|(&name, _)| name)
    }

    pub(super) fn refused(&self) -> String {
        format!("{} cannot be the library for {}", self.file.display(), self.platform.folder())
    }
}

/// Each model's libraries: compiled here, and built elsewhere.
pub(super) fn libraries_of<'a>(
    descriptions: &BTreeMap<&'a str, GeneratedDescription>,
    built: &[(Build, Compiled)],
    given: Vec<ModelLibrary<'_>>,
) -> Result<BTreeMap<&'a str, BTreeMap<Platform, Vec<u8>>>> {
    let mut all = vec![];
    for &name in descriptions.keys() {
        for (build, compiled) in built {
            all.push(ModelLibrary::read(build.platform, compiled.library(name)?)?);
        }
    }
    all.extend(given);

    let mut libraries: BTreeMap<&str, BTreeMap<Platform, Vec<u8>>> = BTreeMap::new();
    for given in all {
        let Some(name) = given.model_of(descriptions) else {
            let models = descriptions.keys().copied().collect::<Vec<_>>().join(" or ");
            bail!("{}: it was not built from the description of {models}", given.refused());
        };
        let of_model = libraries.entry(name).or_default();
        let bytes = match of_model.get(&given.platform) {
            None => given.bytes,
            Some(other) if given.platform == Platform::Darwin64 => {
                library::join(&[other, &given.bytes]).with_context(|| given.refused())?
            }
            Some(_) => bail!("{}: {name} already has one", given.refused()),
        };
        of_model.insert(given.platform, bytes);
    }
    Ok(libraries)
}

/// Whether bytes hold a text.
fn holds(bytes: &[u8], text: &[u8]) -> bool {
    bytes.windows(text.len()).any(|window| window == text)
}

/// The page generated in a folder, the list of the FMU's platforms, and the model's icon and terminals, if any.
pub(super) fn documentation(
    generated: &Path,
    version: Version,
    libraries: &BTreeMap<Platform, Vec<u8>>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let mut platforms = PlatformList::default();
    for (platform, library) in libraries {
        let library = Library::read(library)?;
        for folder in library.folders(*platform, version) {
            platforms.libraries.entry(folder).or_insert_with(|| library.clone());
        }
    }
    let mut files = vec![
        ("documentation/index.html".to_owned(), reading::bytes(&generated.join("index.html"))?),
        (PlatformList::PATH.to_owned(), platforms.to_string().into_bytes()),
    ];
    let icons: &[_] = if version == Version::Three {
        &[("model.png", "terminalsAndIcons/icon.png"), ("model.svg", "terminalsAndIcons/icon.svg")]
    } else {
        &[("model.png", "model.png")]
    };
    for (name, path) in
        icons.iter().chain(&[("terminalsAndIcons.xml", "terminalsAndIcons/terminalsAndIcons.xml")])
    {
        let file = generated.join(name);
        if file.is_file() {
            files.push(((*path).to_owned(), reading::bytes(&file)?));
        }
    }
    Ok(files)
}

/// The files that the model reads at run time: those in the `resources` folder of the build, if any.
pub(super) fn resources(generated: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    let (mut files, mut pending) = (vec![], vec!["resources".to_owned()]);
    pending.retain(|path| generated.join(path).is_dir());
    while let Some(path) = pending.pop() {
        let folder = generated.join(&path);
        let unreadable = || format!("cannot read {}", folder.display());
        for entry in fs::read_dir(&folder).with_context(unreadable)? {
            let entry = entry.with_context(unreadable)?.path();
            let name = entry.file_name().and_then(OsStr::to_str).with_context(unreadable)?;
            let inside = format!("{path}/{name}");
            if entry.is_dir() {
                pending.push(inside);
            } else {
                files.push((inside, reading::bytes(&entry)?));
            }
        }
    }
    Ok(files)
}

/// An FMI 2.0 description with the files to compile (FMI 2.0.5, section 2.2.7: `SourceFiles` is the first element of
/// an interface).
pub(super) fn with_source_files(description: &str, files: &[&str]) -> Result<String> {
    let mut list = "\n    <SourceFiles>\n".to_owned();
    for name in files {
        list += &format!("      <File name=\"{name}\"/>\n");
    }
    list += "    </SourceFiles>\n";
    let mut text = description.to_owned();
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let Some(begin) =
            text.find(&format!("<{interface}\n")).or_else(|| text.find(&format!("<{interface} ")))
        else {
            continue;
        };
        let end = begin + text[begin..].find('>').context("an element does not end")?;
        if text[..end].ends_with('/') {
            text.replace_range(end - 1..=end, &format!(">{list}  </{interface}>"));
        } else {
            text.insert_str(end + 1, list.trim_end());
        }
    }
    Ok(text)
}

/// A model description without descriptions of FMI 3.0's types; nothing else changes.
pub(super) fn without_type_descriptions(description: &str) -> String {
    ["<Float64Type ", "<EnumerationType "].into_iter().fold(description.to_owned(), |description, begin| {
        let mut types = description.split(begin);
        let mut text = types.next().unwrap_or_default().to_owned();
        for rest in types {
            let attributes = rest.split('>').next().unwrap_or_default();
            let described = attributes.split_once(" description=\"");
            let described = described.and_then(|(before, value)| Some((before, value.split_once('"')?.1)));
            let (before, after) = described.unwrap_or((attributes, ""));
            text += &[begin, before, after, &rest[attributes.len()..]].concat();
        }
        text
    })
}

/// A custom section of a WebAssembly module (WebAssembly Core Specification 1.0, sections 5.5.2 and 5.5.3).
pub(super) fn custom_section(name: &str, bytes: &[u8]) -> Vec<u8> {
    let name = [&number(name.len()), name.as_bytes()].concat();
    [&[0], &*number(name.len() + bytes.len()), &name, bytes].concat()
}

/// A number in LEB128 format (section 5.2.2).
fn number(mut rest: usize) -> Vec<u8> {
    let mut bytes = vec![];
    loop {
        let [low, ..] = rest.to_le_bytes();
        rest >>= 7;
        if rest == 0 {
            bytes.push(low & 0x7f);
            return bytes;
        }
        bytes.push(low | 0x80);
    }
}

/// Creates the folder of a file.
pub(super) fn create_folder_of(file: &Path) -> Result<()> {
    let Some(folder) = file.parent() else { return Ok(()) };
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))
}

/// Writes bytes to a file and reports it.
pub(super) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    create_folder_of(path)?;
    writing::write(path, |writer| writer.write_all(bytes))?;
    say(path, "")
}

/// Writes an FMU and reports it, with its GUID.
pub(super) fn write(fmu: &Fmu<'_>, guid: &str, path: &Path) -> Result<()> {
    writing::write(path, |writer| fmu.write(writer))?;
    say(path, guid)
}

/// Reports a written file: its path, size, and further text.
///
/// # Errors
/// When the file does not exist, or standard output cannot be written.
pub fn say(path: &Path, rest: &str) -> Result<()> {
    let size = fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.len();
    let line = format!("{}  {} kB  {rest}", path.display(), size.div_ceil(1000));
    Ok(print(&format!("{}\n", line.trim_end()))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_lose_their_descriptions_only() {
        let text = |of_type| {
            format!(
                "<M description=\"a\"><Float64Type name=\"R\"{of_type} unit=\"m\"/><EnumerationType name=\"T\"{of_type}>\n<Item description=\"b\"/></EnumerationType>\
                 <EnumerationType name=\"U\"/></M>"
            )
        };
        for of_type in [" description=\"&lt; &quot;c&quot; &gt;\"", ""] {
            assert_eq!(without_type_descriptions(&text(of_type)), text(""));
        }
    }

    #[test]
    fn numbers_are_those_of_the_format() {
        // The second is the example of Wikipedia's article LEB128.
        assert_eq!(number(0x7f), [0x7f]);
        assert_eq!(number(624_485), [0xe5, 0x8e, 0x26]);
        assert_eq!(custom_section("ab", b"c"), [0, 4, 2, b'a', b'b', b'c']);
    }
}
