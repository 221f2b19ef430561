//! `export`: compiles the models' libraries with cargo and packs each into an .fmu.
//!
//! A model is a workspace member whose library is a `cdylib` named after the model. The description that
//! goes into the FMU is the very file that the build wrote and compiled into the library, as cargo's
//! messages tell, so the two cannot differ. Where both FMUs are exported, the system that they make goes into
//! a package beside them.

use std::collections::BTreeMap;
use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use cargo_metadata::{CrateType, Message, Metadata, MetadataCommand, Package};
use fmi2_export::package::{self, Fmu, Platform};

use super::coupling::Role;
use super::ssp;

/// Exports the named models, or all, into a folder; the package of both binds the parameter sets.
pub fn run(names: &[String], out: Option<PathBuf>, parameters: &[PathBuf]) -> Result<()> {
    let platform = Platform::host()
        .context("FMI 2.0 has no name for this platform; see binaries/ in its section 2.3")?;
    let metadata = MetadataCommand::new()
        // Nothing is asked of the dependencies: else cargo would fetch those of members that are not exported.
        .no_deps()
        .exec()
        .context("cargo finds no workspace here; run this in the folder of the repository")?;
    let models = choose(&metadata, names)?;
    let members = [Role::Plant, Role::Controller].map(Role::model_identifier);
    let is_system = members.iter().all(|name| models.contains_key(name));
    if !parameters.is_empty() && !is_system {
        bail!("parameter sets are bound in the system of {}; export both", members.join(" and "));
    }
    let build = compile(&metadata, models.values().copied(), platform)?;

    let out = out.unwrap_or_else(|| metadata.target_directory.join("fmu").into());
    fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let licenses = licenses(metadata.workspace_root.as_std_path())?;
    for &name in models.keys() {
        let generated = build.generated(name)?;
        let description = read_text(&generated.join("modelDescription.xml"))?;
        let mut files = documentation(&generated, &[platform])?;
        files.extend(licenses.clone());
        let library =
            build.libraries.get(name).with_context(|| format!("cargo built no library of {name}"))?;
        let fmu = Fmu {
            model_identifier: name,
            model_description: &description,
            libraries: vec![(platform, read(library)?)],
            files,
        };
        write(&fmu, &out.join(format!("{name}.fmu")))?;
    }
    if is_system {
        let [plant, controller] = members.map(|name| read(&out.join(format!("{name}.fmu"))));
        ssp::write(&ssp::own(plant?, controller?, parameters)?, &out.join("Boost.ssp"))?;
    }
    Ok(())
}

/// The models that are asked for, by name.
fn choose<'a>(metadata: &'a Metadata, names: &'a [String]) -> Result<BTreeMap<&'a str, &'a Package>> {
    let all: BTreeMap<&str, &Package> = metadata
        .workspace_packages()
        .into_iter()
        .flat_map(|package| {
            let libraries =
                package.targets.iter().filter(|target| target.crate_types.contains(&CrateType::CDyLib));
            libraries.map(move |target| (target.name.as_str(), package))
        })
        .collect();
    let known = all.keys().copied().collect::<Vec<_>>().join(", ");
    if all.is_empty() {
        bail!("no member of the workspace {} is a cdylib", metadata.workspace_root);
    }
    if names.is_empty() {
        return Ok(all);
    }
    names
        .iter()
        .map(|name| {
            all.get_key_value(name.as_str())
                .map(|(&name, &package)| (name, package))
                .with_context(|| format!("there is no model {name}; there are {known}"))
        })
        .collect()
}

/// What cargo built.
struct Build {
    /// The library of each model.
    libraries: BTreeMap<String, PathBuf>,
    /// The output folders of all build scripts.
    generated: Vec<PathBuf>,
}

impl Build {
    /// The folder of what the build generated for a model.
    fn generated(&self, model: &str) -> Result<PathBuf> {
        self.generated
            .iter()
            .map(|folder| folder.join(model))
            .find(|folder| folder.join("modelDescription.xml").is_file())
            .with_context(|| {
                format!("the build made no modelDescription.xml for {model}; does build.rs call fmi2_export::build::generate?")
            })
    }
}

/// Compiles packages for this platform; cargo's progress shows on stderr.
fn compile<'a>(
    metadata: &Metadata,
    packages: impl Iterator<Item = &'a Package>,
    platform: Platform,
) -> Result<Build> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .args(["build", "--release", "--message-format=json-render-diagnostics"])
        .arg("--manifest-path")
        .arg(metadata.workspace_root.join("Cargo.toml"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    for package in packages {
        command.args(["--package", &package.name]);
    }
    let mut child = command.spawn().context("cannot run cargo; install Rust, or set CARGO to where it is")?;
    let stdout = child.stdout.take().context("cargo has no output")?;
    let mut build = Build { libraries: BTreeMap::new(), generated: vec![] };
    for message in Message::parse_stream(BufReader::new(stdout)) {
        match message.context("cannot read cargo's messages")? {
            Message::BuildScriptExecuted(script) => build.generated.push(script.out_dir.into()),
            Message::CompilerArtifact(artifact)
                if artifact.target.crate_types.contains(&CrateType::CDyLib) =>
            {
                let is_library =
                    |file: &Path| file.extension().is_some_and(|suffix| suffix == platform.library_suffix());
                if let Some(file) = artifact.filenames.iter().find(|file| is_library(file.as_std_path())) {
                    build.libraries.insert(artifact.target.name, file.clone().into());
                }
            }
            _ => {}
        }
    }
    if !child.wait().context("cargo did not end")?.success() {
        bail!("cargo could not build the models; its messages stand above");
    }
    Ok(build)
}

/// The page that the build generated in a folder, with the platforms that the FMU has libraries for, and the
/// icon where the model has one.
fn documentation(generated: &Path, platforms: &[Platform]) -> Result<Vec<(String, Vec<u8>)>> {
    let file = generated.join("index.html");
    let folders: Vec<_> = platforms.iter().map(|platform| platform.folder().to_owned()).collect();
    let page = package::documentation(&read_text(&file)?, &folders)
        .with_context(|| format!("cannot use {}", file.display()))?;
    let mut files = vec![("documentation/index.html".to_owned(), page.into_bytes())];
    let icon = generated.join("model.png");
    if icon.is_file() {
        files.push(("model.png".to_owned(), read(&icon)?));
    }
    Ok(files)
}

/// The licenses of the workspace, for the FMU's documentation: the files whose names begin with LICENSE.
fn licenses(root: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    let failed = || format!("cannot read the folder {}", root.display());
    let mut files = vec![];
    for entry in fs::read_dir(root).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        if let Some(name) = path.file_name().and_then(|name| name.to_str())
            && name.to_uppercase().starts_with("LICENSE")
            && path.is_file()
        {
            files.push((format!("documentation/licenses/{name}"), read(&path)?));
        }
    }
    Ok(files)
}

fn read_text(file: &Path) -> Result<String> {
    fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))
}

fn read(file: &Path) -> Result<Vec<u8>> {
    fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}

/// Writes an FMU beside its place, then moves it there: whoever reads the file never sees half of it.
fn write(fmu: &Fmu<'_>, path: &Path) -> Result<()> {
    let new = path.with_extension("fmu.new");
    let failed = || format!("cannot write {}", path.display());
    fmu.write(fs::File::create(&new).with_context(failed)?).with_context(failed)?;
    fs::rename(&new, path).with_context(failed)?;
    let kilobytes = fs::metadata(path).with_context(failed)?.len().div_ceil(1000);
    let guid = fmu.model_description.split("guid=\"").nth(1).and_then(|rest| rest.split('"').next());
    println!("{}  {kilobytes} kB  {}", path.display(), guid.unwrap_or("no GUID"));
    Ok(())
}
