//! `compile`: adds to an FMU, or to those of a system, a library for this platform, compiled from its C or C++ sources.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::{Cursor, ErrorKind, Read, Seek, Write};
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, anyhow, bail, ensure};
use cc::Tool;
use clap::Args;
use fmu_io::reading::{self, LARGEST_CONTENT};
use fmu_io::temporary::Folder;
use fmu_io::terminal::{complain, print};
use fmu_io::threads::{self, each};
use fmu_io::writing;
use fmu_package::library::{Linkage, missing_in_words};
use fmu_package::{
    BuildConfiguration, FmuDescription, MODEL_DESCRIPTION, Merged, Part, Platform, PlatformList,
    SourceFileSet, StaticLibrary, archive, functions,
};
use fmu_terms::{Interface, Version, Word as _};

use super::target::host_triple;

/// The temporary folders of sources and results.
const PREFIX: &str = ".compiled-by-cargo-fmu-";

/// The standard's headers, which the importer provides (FMI 2.0.5, section 2.3; FMI 3.0.2, section 2.4.10).
const HEADERS: [(&str, &str); 6] = [
    ("fmi2FunctionTypes.h", include_str!("../headers/fmi2FunctionTypes.h")),
    ("fmi2Functions.h", include_str!("../headers/fmi2Functions.h")),
    ("fmi2TypesPlatform.h", include_str!("../headers/fmi2TypesPlatform.h")),
    ("fmi3FunctionTypes.h", include_str!("../headers/fmi3FunctionTypes.h")),
    ("fmi3Functions.h", include_str!("../headers/fmi3Functions.h")),
    ("fmi3PlatformTypes.h", include_str!("../headers/fmi3PlatformTypes.h")),
];

/// Functions of a shared library have no prefix, by the headers of FMI 2.0.4 and 3.0 on.
const WITHOUT_PREFIX: [&str; 2] = ["-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX"];

/// The languages that compilers have an option for.
const LANGUAGES: [&str; 13] =
    ["C89", "C90", "C99", "C11", "C17", "C23", "C++98", "C++11", "C++14", "C++17", "C++20", "C++23", "C++26"];

/// Compile the C sources of an FMU, or of those of a system, for this platform, into a new file
///
/// Takes the compilers of this machine, or those of the environment variables CC and CXX, and the FMU's own definitions,
/// compiler options and libraries. In a system, FMUs that have a library for this platform stay as they are.
#[derive(Args, Debug)]
pub struct Compile {
    /// An FMU with sources, or a package with such FMUs
    #[arg(value_name = "FILE.fmu|SYSTEM.ssp")]
    file: PathBuf,
    /// The file to write [default: beside the other, with the platform in its name]
    #[arg(long, short, value_name = "FILE.fmu|SYSTEM.ssp")]
    out: Option<PathBuf>,
}

impl Compile {
    /// Writes the FMU with its new library, and lists its libraries; or the package with its FMUs.
    ///
    /// # Errors
    /// When the file cannot be read or has no sources, they cannot be compiled, or the file cannot be written.
    pub fn run(&self) -> Result<()> {
        let Some(platform) = Platform::host() else { bail!("FMI does not support this platform") };
        // `simulate` names an FMU in a package by both paths.
        let package = self.file.ancestors().find(|path| is_package(path) && path.is_file());
        let file = package.unwrap_or(&self.file);
        let ending = file.extension().unwrap_or_default().to_string_lossy();
        let beside = || file.with_extension(format!("{}.{ending}", platform.folder()));
        let out = self.out.clone().unwrap_or_else(beside);
        writing::refuse_overlap(std::slice::from_ref(&out), &[file.to_owned()])?;
        let content = reading::bytes(file)?;
        let compiled = match package {
            Some(_) => package_of_compiled(content, platform).map(|content| (content, String::new())),
            None => compiled(&file.display().to_string(), content, platform),
        };
        let (content, listed) = compiled.with_context(|| format!("cannot compile {}", file.display()))?;
        writing::write(&out, |writer| writer.write_all(&content))?;
        Ok(print(&format!("{}\n{listed}", out.display()))?)
    }
}

fn is_package(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ssp"))
}

/// A package in which the FMUs without a library for a platform are compiled.
fn package_of_compiled(content: Vec<u8>, platform: Platform) -> Result<Vec<u8>> {
    let mut count = 0;
    let package = compile_within(content, platform, &mut count)?;
    ensure!(count > 0, "none of its FMUs lacks a library for this platform and lists C sources");
    Ok(package)
}

/// Compiles the FMUs of a package, and of those in it, and counts them.
fn compile_within(content: Vec<u8>, platform: Platform, count: &mut usize) -> Result<Vec<u8>> {
    let mut archive = archive::open(Cursor::new(content))?;
    let mut files = archive::read_files(&mut archive, &mut LARGEST_CONTENT.clone())?;
    for (path, content) in &mut files {
        let within = || format!("its {path}");
        if is_package(Path::new(path)) {
            *content = compile_within(std::mem::take(content), platform, count).with_context(within)?;
        } else if path.to_lowercase().ends_with(".fmu")
            && needs_library(content, platform).with_context(within)?
        {
            (*content, _) = compiled(path, std::mem::take(content), platform).with_context(within)?;
            *count += 1;
        }
    }
    let entries: Vec<_> = files.iter().map(|(path, content)| (path.clone(), content.as_slice())).collect();
    let mut package = vec![];
    archive::write(&mut package, &entries)?;
    Ok(package)
}

/// Whether an FMU has no library for a platform, but lists sources.
fn needs_library(fmu: &[u8], platform: Platform) -> Result<bool> {
    let mut archive = archive::open(Cursor::new(fmu))?;
    let description = description(&mut archive)?;
    let files = archive::read_files(&mut archive, &mut LARGEST_CONTENT.clone())?;
    let has_library = identifiers(&description)
        .iter()
        .any(|identifier| files.contains_key(&platform.library_path(identifier, description.version())));
    Ok(!has_library && !BuildConfiguration::of(&description, &files)?.is_empty())
}

fn description(archive: &mut archive::Archive<impl Read + Seek>) -> Result<FmuDescription> {
    let text = archive::read_text(archive, MODEL_DESCRIPTION)?;
    FmuDescription::parse(&text).with_context(|| format!("its {MODEL_DESCRIPTION} cannot be read"))
}

/// The identifiers of an FMU's libraries.
fn identifiers(description: &FmuDescription) -> BTreeSet<&str> {
    let interfaces = description.interfaces.iter();
    interfaces.filter_map(|(interface, _)| description.identifier(*interface)).collect()
}

/// An FMU with the libraries of its sources, and the list of its libraries. The name is for messages.
fn compiled(name: &str, content: Vec<u8>, platform: Platform) -> Result<(Vec<u8>, String)> {
    let mut archive = archive::open(Cursor::new(content))?;
    let description = description(&mut archive)?;
    let mut files = archive::read_files(&mut archive, &mut LARGEST_CONTENT.clone())?;
    let configurations = BuildConfiguration::of(&description, &files)?;
    let is_needed = |path: &str| path.starts_with("sources/") || path.starts_with("binaries/");
    let folder = Folder::filled(PREFIX, |folder| archive::extract(&mut archive, folder, is_needed))?;
    let host = platform.folder_for_host(description.version());
    let sources = Sources::new(&folder, &host, description.version(), &files)?;
    let mut libraries = vec![];
    for identifier in identifiers(&description) {
        let own: Vec<_> =
            configurations.iter().filter(|known| known.model_identifier == identifier).collect();
        if !own.is_empty() {
            let path = platform.library_path(identifier, description.version());
            let library =
                sources.compile(sources.choose(&own, &platform.folder_for_host(Version::Three))?, &path)?;
            inspect(&library, identifier, &description)
                .with_context(|| format!("its sources make {path}"))?;
            libraries.push((path, library));
        }
    }
    ensure!(!libraries.is_empty(), "it lists no C sources");
    files.extend(libraries);
    // The new library has not been run.
    let list = files.remove(PlatformList::PATH).unwrap_or_default();
    let runs = PlatformList::read_runs(&String::from_utf8_lossy(&list)).into_iter();
    let runs = runs.filter_map(|(folder, run)| Some((folder.parse().ok()?, run)));
    let runs = runs.filter(|(other, _)| *other != platform).collect();
    let parts = [Part { name: name.to_owned(), files }];
    let merged = Merged::new(&parts, &runs)?;
    let mut fmu = vec![];
    merged.write(&mut fmu)?;
    Ok((fmu, merged.platforms.to_string()))
}

/// Refuses a library that makes no instances; complains about other functions that it does not export.
fn inspect(library: &[u8], identifier: &str, description: &FmuDescription) -> Result<()> {
    let interfaces = description.interfaces.iter().map(|(interface, _)| *interface);
    let interfaces: Vec<_> =
        interfaces.filter(|interface| description.identifier(*interface) == Some(identifier)).collect();
    for linkage in Linkage::read(library)? {
        let missing = linkage.missing_functions(description.version(), &interfaces);
        let makes_instances = |function: &&&str| {
            let of_fmi3 = function.strip_prefix("fmi3Instantiate").and_then(Interface::of);
            **function == "fmi2Instantiate"
                || of_fmi3.is_some_and(|interface| interfaces.contains(&interface))
        };
        if let Some(function) = missing.iter().find(makes_instances) {
            let prefixed = linkage.exports.iter().find(|name| name.ends_with(function));
            let prefixed = prefixed.map_or(String::new(), |name| format!("; it exports {name}"));
            bail!("{}{prefixed}", missing_in_words(&missing));
        }
        if !missing.is_empty() {
            complain(&format!("warning: {identifier}: {}", missing_in_words(&missing)));
        }
    }
    Ok(())
}

/// The extracted sources of an FMU.
struct Sources<'a> {
    folder: &'a Path,
    /// The folder of this platform's libraries.
    binaries: String,
    files: &'a BTreeMap<String, Vec<u8>>,
    version: Version,
    compiler: Tool,
}

impl<'a> Sources<'a> {
    fn new(
        folder: &'a Folder,
        platform: &str,
        version: Version,
        files: &'a BTreeMap<String, Vec<u8>>,
    ) -> Result<Self> {
        let headers = folder.path().join("headers");
        fs::create_dir(&headers)?;
        for (name, text) in HEADERS {
            fs::write(headers.join(name), text)?;
        }
        let binaries = format!("binaries/{platform}");
        Ok(Self { folder: folder.path(), binaries, files, version, compiler: compiler(false)? })
    }

    /// The configuration for this platform, if there is one, and for this kind of compiler.
    fn choose<'c>(&self, all: &[&'c BuildConfiguration], tuple: &str) -> Result<&'c BuildConfiguration> {
        let has = |platform: &str| all.iter().any(|known| known.platform == platform);
        let platform = if has(tuple) { tuple } else { "" };
        let mut suiting = all.iter().filter(|known| known.platform == platform);
        let first = suiting.clone().next();
        let takes_options =
            |known: &&&BuildConfiguration| known.source_file_sets.iter().all(|set| self.takes_options(set));
        let found = suiting.find(takes_options).or(first);
        found
            .copied()
            .with_context(|| format!("its {} has no configuration for {tuple}", BuildConfiguration::PATH))
    }

    /// Whether the compiler options of a set are for this kind of compiler.
    fn takes_options(&self, set: &SourceFileSet) -> bool {
        let name = set.compiler.to_lowercase();
        name.is_empty() || (name.contains("visual") || name == "cl") == self.compiler.is_like_msvc()
    }

    /// The library of a configuration, whose path in the FMU has its name.
    fn compile(&self, configuration: &BuildConfiguration, path: &str) -> Result<Vec<u8>> {
        let folder = self.folder.join("objects").join(&configuration.model_identifier);
        fs::create_dir_all(&folder)?;
        let (mut objects, mut commands) = (vec![], vec![]);
        for set in &configuration.source_file_sets {
            let compiler = compiler(is_cpp(set))?;
            let options = [self.without_prefix(&configuration.model_identifier), self.options(set)?].concat();
            for file in &set.source_files {
                let object = folder.join(format!("{}.o", objects.len()));
                let mut command = compiler.to_command();
                command.arg("-c").arg(self.source(file)?).args(&options).current_dir(&folder);
                self.write_to(&mut command, "-Fo", &object);
                objects.push(object);
                commands.push((file.as_str(), command));
            }
        }
        self.run_all(commands)?;
        let mut link = compiler(configuration.source_file_sets.iter().any(is_cpp))?.to_command();
        let library = folder.join(Path::new(path).file_name().context("a library has a name")?);
        link.arg(if self.is_msvc() { "-LD" } else { "-shared" }).args(objects).current_dir(&folder);
        self.write_to(&mut link, "-Fe", &library);
        for library in &configuration.libraries {
            link.arg(self.library(library)?);
        }
        if !self.is_msvc() {
            link.arg("-lm");
        }
        self.run(path, &mut link)?;
        Ok(reading::bytes(&library)?)
    }

    fn is_msvc(&self) -> bool {
        self.compiler.is_like_msvc()
    }

    /// Has a command write to a file, by an option of Microsoft's compiler or that of the others.
    fn write_to(&self, command: &mut Command, of_msvc: &str, file: &Path) {
        if self.is_msvc() {
            command.arg(format!("{of_msvc}{}", file.display()));
        } else {
            command.arg("-o").arg(file);
        }
    }

    /// The path of a source file.
    fn source(&self, name: &str) -> Result<PathBuf> {
        let path = format!("sources/{}", name.trim_start_matches("./"));
        ensure!(self.files.contains_key(&path), "there is no {path}");
        Ok(self.folder.join(path))
    }

    /// Definitions that take the prefix off each function. Headers before those of [`WITHOUT_PREFIX`] prepend the model
    /// identifier and `_` (FMI 2.0, section 2.1.1), which the sources of a shared library should not ask for.
    fn without_prefix(&self, identifier: &str) -> Vec<String> {
        let prefixed = functions(self.version).map(|name| format!("-D{identifier}_{name}={name}"));
        WITHOUT_PREFIX.map(str::to_owned).into_iter().chain(prefixed).collect()
    }

    /// What the files of a set are compiled with.
    fn options(&self, set: &SourceFileSet) -> Result<Vec<String>> {
        let include = |folder: PathBuf| format!("-I{}", folder.display());
        let mut options = vec![include(self.folder.join("headers")), include(self.folder.join("sources"))];
        for directory in &set.include_directories {
            let is_inside = Path::new(directory)
                .components()
                .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
            ensure!(is_inside, "its include directory '{directory}' is not below sources");
            options.push(include(self.folder.join("sources").join(directory)));
        }
        options.extend(set.definitions.iter().map(|(name, value)| match value {
            Some(value) => format!("-D{name}={value}"),
            None => format!("-D{name}"),
        }));
        let language = set.language.to_uppercase();
        if LANGUAGES.contains(&language.as_str()) && !self.is_msvc() {
            options.push(format!("-std={}", language.replace('C', "gnu")));
        }
        if self.takes_options(set) {
            options.extend(set.compiler_options.clone());
        }
        Ok(options)
    }

    /// What a library is linked by.
    fn library(&self, library: &StaticLibrary) -> Result<OsString> {
        let StaticLibrary { name, is_external } = library;
        if *is_external {
            let is_file = Path::new(name).extension().is_some();
            return Ok(match (self.is_msvc(), is_file) {
                (true, true) => name.clone(),
                (true, false) => format!("{name}.lib"),
                (false, true) => format!("-l:{name}"),
                (false, false) => format!("-l{name}"),
            }
            .into());
        }
        let names = [name.clone(), format!("lib{name}.a"), format!("{name}.lib")];
        let mut paths = names.iter().map(|name| format!("{}/{name}", self.binaries));
        let path = paths.find(|path| self.files.contains_key(path));
        let path = path.with_context(|| format!("there is no library {name} in {}", self.binaries))?;
        Ok(self.folder.join(path).into())
    }

    /// Runs commands, each of which compiles a source file, on all cores.
    fn run_all(&self, commands: Vec<(&str, Command)>) -> Result<()> {
        let run = |(file, mut command)| self.run(&format!("sources/{file}"), &mut command);
        each(threads::number(None), commands, run).map(drop)
    }

    /// Runs a command that makes something.
    fn run(&self, made: &str, command: &mut Command) -> Result<()> {
        let program = command.get_program().display().to_string();
        let output = command.output().map_err(|error| match error.kind() {
            ErrorKind::NotFound => {
                anyhow!("there is no C compiler {program}; install one, or set CC to the path of yours")
            }
            _ => anyhow!("cannot run {program}: {error}"),
        })?;
        if output.status.success() {
            return Ok(());
        }
        let said =
            [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        let said = said.replace(&format!("{}/", self.folder.display()), "");
        bail!("{program} cannot make {made}:\n{}", said.trim_end());
    }
}

/// Whether a set's files are in C++.
fn is_cpp(set: &SourceFileSet) -> bool {
    let is_suffix =
        |suffix: &OsStr| ["cc", "cpp", "cxx"].iter().any(|known| suffix.eq_ignore_ascii_case(known));
    let mut suffixes = set.source_files.iter().filter_map(|file| Path::new(file).extension());
    set.language.to_uppercase().starts_with("C++") || suffixes.any(is_suffix)
}

/// The compiler of this machine, optimizing, for shared libraries.
fn compiler(is_cpp: bool) -> Result<Tool> {
    let triple = host_triple()?;
    let mut build = cc::Build::new();
    build.cpp(is_cpp).target(triple).host(triple).opt_level(2).debug(false).warnings(false).pic(true);
    // The run-time library of Windows goes into the FMU (FMI 2.0.5, section 2.3: "option MT").
    build.static_crt(true).cargo_metadata(false).cargo_warnings(false).cargo_output(false);
    build.try_get_compiler().context("there is no C compiler")
}
