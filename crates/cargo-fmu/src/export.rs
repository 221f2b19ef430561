//! `export`: compiles the models' libraries with cargo and packs each into an .fmu.
//!
//! A model is a workspace member whose library is a `cdylib` named after the model. The description in the FMU is the
//! very file that the build wrote and compiled into the library, according to cargo's messages, so the two cannot
//! differ.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use fmu_io::terminal::{complain, print};
use fmu_io::{reading, writing};
use fmu_package::{Fmu, Library, Platform, PlatformList, library};
use fmu_terms::{Interfaces, Version};

use super::compile::{Compiled, compile};
use super::metadata::{Metadata, Package};
use super::sources::Module;
use super::target::{Build, Made, PROFILE, Target, WebAssembly};
use super::{licenses, of_platform, sources, validate};

/// Compile the models of this workspace and write their .fmu files
#[derive(Args, Debug, Default)]
#[group(skip)]
pub struct Export {
    /// Identifiers of the models to export [default: all in the workspace]
    #[arg(value_name = "MODEL")]
    models: Vec<String>,
    /// Packages whose models to export
    #[arg(long = "package", short, value_name = "PACKAGE")]
    packages: Vec<String>,
    /// The workspace's Cargo.toml [default: in this folder or the nearest above]
    #[arg(long, value_name = "FILE")]
    manifest_path: Option<PathBuf>,
    /// Output folder [default: fmu in cargo's target folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Platform to build for: an FMI folder name (linux64, win64, darwin64, aarch64-linux ...) or a Rust target, which
    /// may end in the oldest glibc, as x86_64-unknown-linux-gnu.2.17 [default: this platform]
    #[arg(long = "target", value_name = "TARGET")]
    targets: Vec<Target>,
    /// FMI version: 2, 3, or 2,3 for both; FMI 3.0 goes to the folder `fmi3` [default: the variable `FMU_FMI_VERSION`,
    /// else 2, or 3 for a model with FMI 3.0 types]
    #[arg(long = "fmi", value_name = "VERSION", value_delimiter = ',', value_parser = versions())]
    versions: Vec<Version>,
    /// FMI interfaces [default: the variable `FMU_INTERFACES`, else cs]
    #[arg(long, value_name = "INTERFACES", value_parser = interfaces())]
    interfaces: Option<Interfaces>,
    /// Cargo profile for the libraries; `dev` compiles faster and checks for overflow [default: fmu-library, or release if
    /// Cargo.toml has no such profile]
    #[arg(long, value_name = "PROFILE", default_value = PROFILE, hide_default_value = true)]
    profile: String,
    /// A library built elsewhere from the same sources, with its platform
    #[arg(long = "binary", value_name = "PLATFORM=FILE", value_parser = of_platform::<PathBuf>)]
    binaries: Vec<(Platform, PathBuf)>,
    /// Write WebAssembly modules, MODEL.wasm, instead of FMUs; see docs/wasm.md
    #[arg(long, conflicts_with_all = ["targets", "profile", "binaries", "sources"])]
    wasm: bool,
    /// Include the models as C in the FMUs, for platforms without a library; see docs/sources.md
    #[arg(long)]
    sources: bool,
}

/// What to export, and where to; nothing is built yet.
#[derive(Debug)]
pub struct Plan {
    metadata: Metadata,
    builds: Vec<Build>,
    /// Whether modules are written instead of FMUs.
    wasm: bool,
    /// Whether FMUs have sources.
    sources: bool,
    /// `None` leaves it to the environment.
    versions: Vec<Option<Version>>,
    interfaces: Option<Interfaces>,
    profile: String,
    binaries: Vec<(Platform, PathBuf)>,
    /// The package of each model.
    models: BTreeMap<String, Package>,
    /// The folder of the FMUs.
    out: PathBuf,
}

impl Export {
    /// The export of what is in the current folder.
    #[cfg(feature = "simulate")]
    pub(crate) fn of_this_folder() -> Self {
        Self { profile: PROFILE.to_owned(), ..Self::default() }
    }

    /// Finds the models and the tools to build them.
    ///
    /// # Errors
    /// When there is no workspace, model or target of this name, or a target's tools are missing.
    pub fn plan(self) -> Result<Plan> {
        let builds = if self.wasm { vec![] } else { builds(&self.targets)? };
        self.check_tools(&builds)?;
        let metadata = Metadata::of(self.manifest_path.as_deref())
            .context("cargo finds no package here; run this in its folder")?;
        let models = choose(&metadata, &self.models, &self.packages)?;
        let out = self.out.unwrap_or_else(|| metadata.target_directory.join("fmu"));
        let Self { mut versions, interfaces, profile, binaries, .. } = self;
        if interfaces == Some(Interfaces::ScheduledExecution) && versions.contains(&Version::Two) {
            bail!("--interfaces se needs FMI 3.0, but --fmi is 2");
        }
        versions.sort();
        versions.dedup();
        let versions =
            if versions.is_empty() { vec![None] } else { versions.into_iter().map(Some).collect() };
        let Self { wasm, sources, .. } = self;
        Ok(Plan { metadata, builds, wasm, sources, versions, interfaces, profile, binaries, models, out })
    }

    /// Lists all missing tools before starting.
    fn check_tools(&self, builds: &[Build]) -> Result<()> {
        let mut checks: Vec<_> = builds.iter().map(Build::check_tools).collect();
        if self.wasm || self.sources {
            checks.push(WebAssembly::check_tools());
        }
        if self.sources {
            checks.push(sources::check_tools());
        }
        let mut missing: Vec<_> = checks.into_iter().filter_map(Result::err).collect();
        match missing.len() {
            0 => Ok(()),
            1 => Err(missing.remove(0)),
            _ => {
                let list: Vec<_> = missing.iter().map(|error| format!("{error:#}")).collect();
                bail!("nothing was built, as several things are missing:\n- {}", list.join("\n- "))
            }
        }
    }
}

impl Plan {
    /// The identifiers of the models.
    pub fn models(&self) -> impl Iterator<Item = &str> {
        self.models.keys().map(String::as_str)
    }

    /// The folders of the FMUs, of FMI 2.0 and 3.0.
    #[must_use]
    pub fn folders(&self) -> [PathBuf; 2] {
        [self.out.clone(), self.folder_of_fmi3()]
    }

    /// The file of a model's FMI 2.0 FMU.
    fn fmu(&self, model: &str) -> PathBuf {
        self.out.join(format!("{model}.fmu"))
    }

    /// The folder of the FMI 3.0 FMUs.
    fn folder_of_fmi3(&self) -> PathBuf {
        self.out.join("fmi3")
    }

    /// The file of the FMU with a description.
    fn fmu_of(&self, model: &str, description: &str) -> PathBuf {
        let of_fmi2 = self.fmu(model);
        match of_fmi2.file_name() {
            Some(name) if is_fmi3(description) => self.folder_of_fmi3().join(name),
            _ => of_fmi2,
        }
    }

    /// Builds and writes the FMUs or modules, reports them, and returns the FMU files. `inputs` and `outputs` are
    /// other files that the command reads and writes: none may be both.
    ///
    /// # Errors
    /// When a library cannot be built or does not fit, or a file cannot be read or written.
    pub fn run(&self, inputs: &[PathBuf], outputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
        let mut given = self
            .binaries
            .iter()
            .map(|(platform, file)| ModelLibrary::read(*platform, file))
            .collect::<Result<Vec<_>>>()?;
        fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot create the folder {}", self.out.display()))?;
        let fmus = self
            .folders()
            .map(|folder| self.models().map(|name| folder.join(format!("{name}.fmu"))).collect::<Vec<_>>());
        // Files in a folder yet to be created overwrite nothing.
        let outputs: Vec<PathBuf> = [fmus.concat(), outputs.to_vec()]
            .concat()
            .into_iter()
            .filter(|file| file.parent().is_some_and(Path::is_dir))
            .collect();
        let inputs: Vec<_> =
            self.binaries.iter().map(|(_, file)| file.clone()).chain(inputs.iter().cloned()).collect();
        writing::refuse_overlap(&outputs, &inputs)?;
        if self.wasm {
            self.versions.iter().try_for_each(|&version| self.write_modules(version))?;
            return Ok(vec![]);
        }

        let mut written = vec![];
        for (number, &version) in self.versions.iter().enumerate() {
            // One by one, as each build overwrites the libraries of the one before.
            let built = self.compile(version)?;
            let descriptions = descriptions(self.models(), &built)?;
            let (of_these, others) = given.into_iter().partition(|given| given.is_of(&descriptions));
            given = others;
            if number + 1 == self.versions.len()
                && let Some(stray) = given.first()
            {
                let models = self.models().collect::<Vec<_>>().join(" or ");
                bail!("{}: it was built from a description other than that of {models}", stray.refused());
            }
            let modules = self.sources.then(|| self.compile_for(&WebAssembly, "", version)).transpose()?;
            written.extend(self.pack(&built, modules.as_ref(), &descriptions, of_these)?);
        }
        Ok(written)
    }

    /// Builds and writes the modules of an FMI version.
    fn write_modules(&self, version: Option<Version>) -> Result<()> {
        let compiled = self.compile_for(&WebAssembly, "", version)?;
        for model in self.models() {
            let description = compiled.description(model)?;
            let mut module = reading::bytes(compiled.library(model)?)?;
            module.extend(custom_section("modelDescription.xml", description.as_bytes()));
            write_file(&self.fmu_of(model, &description).with_extension("wasm"), &module)?;
        }
        Ok(())
    }

    /// The files of the folder `sources` in a model's FMU.
    fn sources_of(
        &self,
        model: &str,
        identifier: &str,
        modules: &Compiled,
        description: &str,
    ) -> Result<Vec<(String, Vec<u8>)>> {
        if modules.description(model)? != description {
            bail!("the build for WebAssembly made a different description of {model}");
        }
        let bytes = reading::bytes(modules.library(model)?)?;
        let version = if is_fmi3(description) { Version::Three } else { Version::Two };
        let folder = self.metadata.target_directory.join("fmu-sources");
        sources::files(&Module { model: identifier, version, description, bytes: &bytes }, &folder)
    }

    /// Builds the libraries of an FMI version.
    fn compile(&self, version: Option<Version>) -> Result<Vec<(Build, Compiled)>> {
        let compile = |(number, build): (usize, &Build)| {
            let of = match self.builds.len() {
                1 => String::new(),
                builds => format!(" ({} of {builds})", number + 1),
            };
            Ok((build.clone(), self.compile_for(build, &of, version)?))
        };
        self.builds.iter().enumerate().map(compile).collect()
    }

    /// Builds an FMI version for one target; `of` says which of how many.
    fn compile_for(&self, build: &dyn Made, of: &str, version: Option<Version>) -> Result<Compiled> {
        // Cargo's progress, and its waiting for another cargo, appear on standard error, which is shared.
        complain(&format!(
            "Compiling {} for {}{of}, a minute or more the first time; cargo shows its progress:",
            self.models().collect::<Vec<_>>().join(", "),
            build.name()
        ));
        compile(&self.metadata, self.models.values(), build, &self.profile, version, self.interfaces)
            .with_context(|| match version {
                Some(version) if self.versions.first() != Some(&Some(version)) => {
                    format!("nothing was exported of FMI {version}.0")
                }
                _ => "nothing was exported".to_owned(),
            })
    }

    /// Writes the FMUs from the build and from libraries built elsewhere, reports them, and returns their files.
    fn pack(
        &self,
        built: &[(Build, Compiled)],
        modules: Option<&Compiled>,
        descriptions: &BTreeMap<&str, String>,
        given: Vec<ModelLibrary<'_>>,
    ) -> Result<Vec<PathBuf>> {
        let mut libraries = libraries_of(descriptions, built, given)?;
        let mut written = vec![];
        for (&name, description) in descriptions {
            let libraries = libraries.remove(name).unwrap_or_default();
            // Differs from the library's for Scheduled Execution.
            let identifier = model_identifier(description).unwrap_or(name);
            let generated = built[0].1.generated(name)?;
            let mut files = documentation(&generated, description, &libraries)?;
            files.extend(resources(&generated)?);
            files.extend(licenses::files(name, &self.models[name], built)?);
            let mut description = Cow::Borrowed(description.as_str());
            if let Some(modules) = modules {
                let sources = self.sources_of(name, identifier, modules, &description)?;
                // FMI 3.0 lists them in a separate file.
                if !is_fmi3(&description) {
                    description = with_source_files(&description, &sources::compiled(&sources))?.into();
                }
                files.extend(sources);
            }
            let fmu = Fmu {
                model_identifier: identifier,
                model_description: &description,
                libraries: libraries.into_iter().collect(),
                files,
            };
            let file = self.fmu_of(identifier, &description);
            create_folder_of(&file)?;
            write(&fmu, &file)?;
            validate::check(&file)?;
            written.push(file);
        }
        Ok(written)
    }
}

/// The values of `--fmi`.
fn versions() -> impl TypedValueParser<Value = Version> {
    let values = Version::ALL.map(|version| {
        PossibleValue::new(version.as_str()).help(match version {
            Version::Two => "FMI 2.0, which nearly every tool imports",
            Version::Three => "FMI 3.0",
        })
    });
    PossibleValuesParser::new(values).try_map(|text| text.parse::<Version>())
}

/// The values of `--interfaces`.
fn interfaces() -> impl TypedValueParser<Value = Interfaces> {
    let values = Interfaces::ALL.map(|interfaces| {
        let value = PossibleValue::new(interfaces.as_str());
        match interfaces {
            Interfaces::CoSimulation => value.help("Co-simulation: the FMU steps itself"),
            Interfaces::ModelExchange => value.help("Model Exchange: the importer's solver integrates it"),
            Interfaces::Both => value.alias("me,cs").help("Both; importers choose"),
            Interfaces::ScheduledExecution => value
                .help("Scheduled Execution of FMI 3.0, in a separate FMU: the importer schedules the clock"),
        }
    });
    PossibleValuesParser::new(values).try_map(|text| text.parse::<Interfaces>())
}

/// The requested models, by identifier.
fn choose(metadata: &Metadata, names: &[String], packages: &[String]) -> Result<BTreeMap<String, Package>> {
    let members = &metadata.packages;
    for name in packages {
        if !members.iter().any(|package| package.name == *name) {
            let known: Vec<_> = members.iter().map(|package| package.name.as_str()).collect();
            bail!("the workspace has no package {name}; it has {}", known.join(", "));
        }
    }
    let mut models = BTreeMap::new();
    for package in members {
        if packages.is_empty() || packages.contains(&package.name) {
            models.extend(package.libraries().map(|target| (target.name.clone(), package.clone())));
        }
    }
    if models.is_empty() {
        bail!(
            "there is no model in {}: a model is a package with `crate-type = [\"cdylib\"]` in the [lib] of its \
             Cargo.toml, named after the model identifier",
            metadata.workspace_root.display()
        );
    }
    let known = models.keys().cloned().collect::<Vec<_>>().join(", ");
    if let Some(name) = names.iter().find(|name| !models.contains_key(*name)) {
        bail!("there is no model {name}; there are {known}");
    }
    models.retain(|name, _| names.is_empty() || names.contains(name));
    Ok(models)
}

/// What is to be built.
fn builds(targets: &[Target]) -> Result<Vec<Build>> {
    let mut builds: Vec<Build> = vec![];
    for build in targets.iter().flat_map(Target::builds) {
        if builds.contains(&build) {
            continue;
        }
        if let Some(other) = builds.iter().find(|other| other.platform == build.platform)
            && build.platform != Platform::Darwin64
        {
            bail!("{} and {} are both for {}", other.name(), build.name(), build.platform.folder());
        }
        builds.push(build);
    }
    if builds.is_empty() {
        builds.push(Build::host()?);
    }
    Ok(builds)
}

/// Each model's description, which is the same in all builds.
fn descriptions<'a>(
    models: impl Iterator<Item = &'a str>,
    built: &[(Build, Compiled)],
) -> Result<BTreeMap<&'a str, String>> {
    let mut descriptions = BTreeMap::new();
    for name in models {
        for (build, compiled) in built {
            let description = compiled.description(name)?;
            if *descriptions.entry(name).or_insert_with(|| description.clone()) != description {
                bail!("the build for {} made a different description of {name}", build.platform.folder());
            }
        }
    }
    Ok(descriptions)
}

/// A library to pack.
struct ModelLibrary<'a> {
    platform: Platform,
    file: &'a Path,
    bytes: Vec<u8>,
}

impl<'a> ModelLibrary<'a> {
    /// Reads a library, which must be one for its platform.
    fn read(platform: Platform, file: &'a Path) -> Result<Self> {
        let given = Self { platform, file, bytes: reading::bytes(file)? };
        Library::read(&given.bytes)
            .and_then(|library| library.fits(platform))
            .with_context(|| given.refused())?;
        Ok(given)
    }

    /// Whether it was built from one of some descriptions.
    fn is_of(&self, descriptions: &BTreeMap<&str, String>) -> bool {
        self.model_of(descriptions).is_some()
    }

    /// The model whose description it was built from, identified by the GUID in the library.
    fn model_of<'d>(&self, descriptions: &BTreeMap<&'d str, String>) -> Option<&'d str> {
        let is_of =
            |description: &str| guid(description).is_some_and(|guid| holds(&self.bytes, guid.as_bytes()));
        descriptions.iter().find(|(_, description)| is_of(description)).map(|(&name, _)| name)
    }

    fn refused(&self) -> String {
        format!("{} cannot be the library for {}", self.file.display(), self.platform.folder())
    }
}

/// Each model's libraries: compiled here, and built elsewhere.
fn libraries_of<'a>(
    descriptions: &BTreeMap<&'a str, String>,
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
            bail!("{}: it was built from a description other than that of {models}", given.refused());
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

/// Whether a description is one of FMI 3.0.
fn is_fmi3(model_description: &str) -> bool {
    model_description.contains(" fmiVersion=\"3.")
}

/// A description's model identifier.
fn model_identifier(model_description: &str) -> Option<&str> {
    model_description.split(" modelIdentifier=\"").nth(1)?.split('"').next()
}

/// A description's GUID, or instantiation token.
fn guid(model_description: &str) -> Option<&str> {
    let attributes = [" guid=\"", " instantiationToken=\""];
    let begin = attributes.iter().find_map(|attribute| model_description.split(attribute).nth(1));
    begin.and_then(|rest| rest.split('"').next())
}

/// Whether bytes hold a text.
fn holds(bytes: &[u8], text: &[u8]) -> bool {
    bytes.windows(text.len()).any(|window| window == text)
}

/// The page generated in a folder, the list of the FMU's platforms, and the model's icon and terminals, if any.
fn documentation(
    generated: &Path,
    description: &str,
    libraries: &BTreeMap<Platform, Vec<u8>>,
) -> Result<Vec<(String, Vec<u8>)>> {
    let mut platforms = PlatformList::default();
    for (platform, library) in libraries {
        let library = Library::read(library)?;
        for folder in library.folders(*platform, is_fmi3(description)) {
            platforms.libraries.entry(folder).or_insert_with(|| library.clone());
        }
    }
    let mut files = vec![
        ("documentation/index.html".to_owned(), reading::bytes(&generated.join("index.html"))?),
        (PlatformList::PATH.to_owned(), platforms.to_string().into_bytes()),
    ];
    let icons: &[_] = if is_fmi3(description) {
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

/// The files that the model reads at run time: those in the build's folder `resources`, if any.
fn resources(generated: &Path) -> Result<Vec<(String, Vec<u8>)>> {
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
fn with_source_files(description: &str, files: &[&str]) -> Result<String> {
    let mut list = "\n    <SourceFiles>\n".to_owned();
    for name in files {
        list += &format!("      <File name=\"{name}\"/>\n");
    }
    list += "    </SourceFiles>\n";
    let mut text = description.to_owned();
    for interface in ["CoSimulation", "ModelExchange"] {
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

/// A custom section of a WebAssembly module (WebAssembly Core Specification 1.0, sections 5.5.2 and 5.5.3).
fn custom_section(name: &str, bytes: &[u8]) -> Vec<u8> {
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
fn create_folder_of(file: &Path) -> Result<()> {
    let Some(folder) = file.parent() else { return Ok(()) };
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))
}

/// Writes bytes to a file and reports it.
fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    create_folder_of(path)?;
    writing::write(path, |writer| writer.write_all(bytes))?;
    say(path, "")
}

/// Writes an FMU and reports it.
fn write(fmu: &Fmu<'_>, path: &Path) -> Result<()> {
    writing::write(path, |writer| fmu.write(writer))?;
    say(path, guid(fmu.model_description).unwrap_or("no GUID"))
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
    fn numbers_are_those_of_the_format() {
        // The second is the example of Wikipedia's article LEB128.
        assert_eq!(number(0x7f), [0x7f]);
        assert_eq!(number(624_485), [0xe5, 0x8e, 0x26]);
        assert_eq!(custom_section("ab", b"c"), [0, 4, 2, b'a', b'b', b'c']);
    }
}
