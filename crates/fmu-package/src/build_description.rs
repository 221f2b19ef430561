//! How the C or C++ sources of an FMU are compiled: `sources/buildDescription.xml` (FMI 3.0.2, section 2.4.10), or the
//! source files that an FMU of FMI 2.0 lists in its description.

use std::collections::BTreeMap;
use std::io;

use fmu_io::reading::broken;

use crate::model_description::FmuDescription;
use crate::xml::{self, Element, flag, named, text};

/// How to compile a model's library on a platform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildConfiguration {
    /// The library's name.
    pub model_identifier: String,
    /// The platform tuple; any if it is empty.
    pub platform: String,
    /// The sources, by how they are compiled.
    pub source_file_sets: Vec<SourceFileSet>,
    /// The libraries with which the sources are linked.
    pub libraries: Vec<StaticLibrary>,
}

/// Source files that are compiled in one way. Paths are relative to `sources/`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceFileSet {
    /// The language, such as `C99` or `C++11`; empty if none is declared.
    pub language: String,
    /// The compiler, such as `gcc` or `VisualC`; empty if none is declared.
    pub compiler: String,
    /// The options for the declared compiler.
    pub compiler_options: Vec<String>,
    /// The files.
    pub source_files: Vec<String>,
    /// The preprocessor definitions that are not optional, each a name and perhaps a value.
    pub definitions: Vec<(String, Option<String>)>,
    /// The folders with headers.
    pub include_directories: Vec<String>,
}

/// A static library.
#[derive(Clone, Debug, PartialEq)]
pub struct StaticLibrary {
    /// The library's name.
    pub name: String,
    /// Whether the system has it; otherwise it is among the FMU's libraries for the platform.
    pub is_external: bool,
}

impl BuildConfiguration {
    /// The path of the build description in an FMU.
    pub const PATH: &'static str = "sources/buildDescription.xml";

    /// The configurations of an FMU, for each model identifier those that its build description has, else the files that
    /// its model description lists.
    ///
    /// # Errors
    /// When the build description is broken.
    pub fn of(description: &FmuDescription, files: &BTreeMap<String, Vec<u8>>) -> io::Result<Vec<Self>> {
        let read = |content: &Vec<u8>| {
            Self::read_all(content).map_err(|error| broken(format!("{} cannot be read: {error}", Self::PATH)))
        };
        let mut all = files.get(Self::PATH).map_or(Ok(vec![]), read)?;
        let mut listed: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for (interface, files) in &description.source_files {
            let identifier = description.identifier(*interface).unwrap_or_default();
            if all.iter().all(|known| known.model_identifier != identifier) {
                let known = listed.entry(identifier).or_default();
                known.extend(files.iter().filter(|file| !known.contains(file)).cloned().collect::<Vec<_>>());
            }
        }
        all.extend(listed.into_iter().map(|(identifier, source_files)| Self {
            model_identifier: identifier.to_owned(),
            source_file_sets: vec![SourceFileSet { source_files, ..SourceFileSet::default() }],
            ..Self::default()
        }));
        Ok(all)
    }

    fn read_all(content: &[u8]) -> io::Result<Vec<Self>> {
        let (text, _) = xml::decode(content.to_owned())?;
        let document = xml::read(&text, "fmiBuildDescription")?;
        Ok(named(document.root_element(), "BuildConfiguration").map(Self::read).collect())
    }

    fn read(element: Element<'_>) -> Self {
        let library =
            |library| StaticLibrary { name: text(library, "name"), is_external: flag(library, "external") };
        Self {
            model_identifier: text(element, "modelIdentifier"),
            platform: text(element, "platform"),
            source_file_sets: named(element, "SourceFileSet").map(SourceFileSet::read).collect(),
            libraries: named(element, "Library").map(library).collect(),
        }
    }
}

impl SourceFileSet {
    fn read(element: Element<'_>) -> Self {
        let names = |list| named(element, list).map(|listed| text(listed, "name")).collect();
        let definitions =
            named(element, "PreprocessorDefinition").filter(|defined| !flag(*defined, "optional"));
        let definitions =
            definitions.map(|defined| (text(defined, "name"), defined.attribute("value").map(str::to_owned)));
        Self {
            language: text(element, "language"),
            compiler: text(element, "compiler"),
            compiler_options: text(element, "compilerOptions")
                .split_whitespace()
                .map(str::to_owned)
                .collect(),
            source_files: names("SourceFile"),
            definitions: definitions.collect(),
            include_directories: names("IncludeDirectory"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interfaces of one identifier share a library; the build description takes precedence.
    #[test]
    fn listed_files_are_those_of_a_library() {
        let interface = |interface: &str, identifier: &str, files: &[&str]| {
            let file = |file: &&str| format!("<File name=\"{file}\"/>");
            let files = files.iter().map(file).collect::<Vec<_>>().concat();
            format!(
                "<{interface} modelIdentifier=\"{identifier}\"><SourceFiles>{files}</SourceFiles></{interface}>"
            )
        };
        let described = |interfaces: [String; 2]| {
            let [one, other] = interfaces;
            let xml = format!("<fmiModelDescription fmiVersion=\"2.0\">{one}{other}</fmiModelDescription>");
            FmuDescription::parse(&xml).unwrap()
        };
        let found = |interfaces, files: &BTreeMap<String, Vec<u8>>| {
            let all = BuildConfiguration::of(&described(interfaces), files).unwrap();
            let sources = |known: &BuildConfiguration| {
                let files = known.source_file_sets.iter().flat_map(|set| set.source_files.clone());
                (known.model_identifier.clone(), files.collect::<Vec<_>>().join(" "))
            };
            all.iter().map(sources).collect::<Vec<_>>()
        };
        let owned = |pairs: &[(&str, &str)]| -> Vec<_> {
            pairs.iter().map(|(name, files)| ((*name).to_owned(), (*files).to_owned())).collect()
        };
        let same = || {
            [
                interface("ModelExchange", "a", &["a.c", "b.c"]),
                interface("CoSimulation", "a", &["a.c", "c.c"]),
            ]
        };
        let two = [interface("ModelExchange", "a", &["a.c"]), interface("CoSimulation", "b", &["b.c"])];
        let mut files = BTreeMap::new();
        assert_eq!(found(same(), &files), owned(&[("a", "a.c b.c c.c")]));
        assert_eq!(found(two.clone(), &files), owned(&[("a", "a.c"), ("b", "b.c")]));
        let build = "<fmiBuildDescription fmiVersion=\"3.0\"><BuildConfiguration modelIdentifier=\"a\"><SourceFileSet>\
                     <SourceFile name=\"own.c\"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>";
        files.insert(BuildConfiguration::PATH.to_owned(), build.as_bytes().to_vec());
        assert_eq!(found(two, &files), owned(&[("a", "own.c"), ("b", "b.c")]));
        files.insert(BuildConfiguration::PATH.to_owned(), b"<other/>".to_vec());
        let refusal = BuildConfiguration::of(&described(same()), &files).unwrap_err().to_string();
        let reason = "the root element is other, not fmiBuildDescription";
        assert_eq!(refusal, format!("{} cannot be read: {reason}", BuildConfiguration::PATH));
    }
}
