//! Compiles models with cargo, and finds the results.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, bail};
use fmu_io::reading;
use fmu_package::{FmuDescription, MODEL_DESCRIPTION};

use super::generation::{Choice, GeneratedInterface};
use super::metadata::{Message, Metadata, Package};
use super::target::{Made, Profile};

/// The results of a cargo build.
pub struct Compiled {
    /// Each model's library.
    libraries: BTreeMap<String, PathBuf>,
    /// The folders in which build scripts, and this command in their place, have generated.
    generated: Vec<PathBuf>,
    /// Each package's folder, by name and version.
    folders: BTreeMap<String, PathBuf>,
}

impl Compiled {
    /// A model's library.
    pub fn library(&self, model: &str) -> Result<&Path> {
        let library = self.libraries.get(model).map(PathBuf::as_path);
        library.with_context(|| format!("cargo built no library of {model}"))
    }

    /// The folder generated for a model.
    pub fn generated(&self, model: &str) -> Result<PathBuf> {
        self.generated
            .iter()
            .map(|folder| folder.join(model))
            .find(|folder| folder.join(MODEL_DESCRIPTION).is_file())
            .with_context(|| {
                format!("the build generated no {MODEL_DESCRIPTION} for {model}; does build.rs call fmu_export_build::generate?")
            })
    }

    /// A package's folder by name and version, if it was compiled.
    pub fn folder(&self, package: &str) -> Option<&Path> {
        self.folders.get(package).map(PathBuf::as_path)
    }

    /// The description generated for a model.
    pub fn description(&self, model: &str) -> Result<GeneratedDescription> {
        let xml = reading::text(&self.generated(model)?.join(MODEL_DESCRIPTION))?;
        let content = FmuDescription::parse(&xml)?;
        Ok(GeneratedDescription { xml, content })
    }
}

/// A generated modelDescription.xml.
pub struct GeneratedDescription {
    /// The description's text.
    pub xml: String,
    /// What the description says.
    pub content: FmuDescription,
}

/// Compiles packages of a workspace with a profile, as an export chooses; cargo reports progress on stderr.
pub fn compile<'a>(
    metadata: &Metadata,
    packages: impl Iterator<Item = &'a Package>,
    build: &dyn Made,
    profile: &Profile,
    choice: Choice,
) -> Result<Compiled> {
    let packages: Vec<_> = packages.collect();
    let interfaces_in_place = GeneratedInterface::generate_all(metadata, packages.iter().copied(), choice)?;
    let mut command = build.command(&metadata.target_directory, profile);
    for interface in &interfaces_in_place {
        interface.configure(&mut command, build.rust_target()?)?;
    }
    command
        .arg("--message-format=json-render-diagnostics")
        .arg("--manifest-path")
        .arg(metadata.workspace_root.join("Cargo.toml"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    choice.configure(&mut command);
    for package in &packages {
        command.args(["--package", &package.name]);
    }
    let mut child = command.spawn().context("cannot run cargo; install Rust, or set CARGO to its path")?;
    let stdout = child.stdout.take().context("cargo has no output")?;
    let mut compiled = Compiled { libraries: BTreeMap::new(), generated: vec![], folders: BTreeMap::new() };
    for line in BufReader::new(stdout).lines() {
        match Message::read(&line.context("cannot read cargo's messages")?)? {
            Message::BuildScriptExecuted { out_dir } => compiled.generated.push(out_dir),
            Message::CompilerArtifact { package_id, manifest_path, target, filenames } => {
                if target.is_library() {
                    let suffix = Some(OsStr::new(build.suffix()));
                    let library = filenames.into_iter().find(|file| file.extension() == suffix);
                    if let Some(file) = library {
                        compiled.libraries.insert(target.name, file);
                    }
                }
                if let Some(package) = name_and_version(&package_id)
                    && let Some(folder) = manifest_path.parent()
                {
                    compiled.folders.insert(package, folder.into());
                }
            }
            Message::Other => {}
        }
    }
    if !child.wait().context("cargo did not finish")?.success() {
        bail!("cargo could not build the models for {}; see its messages above", build.name());
    }
    // After those of the build scripts that cargo has run.
    compiled.generated.extend(interfaces_in_place.into_iter().map(|interface| interface.folder));
    Ok(compiled)
}

/// Name and version in a package identifier: a URL with both after `#`, or only the version if the URL ends with the
/// name (the Cargo Book, "Package ID Specifications").
fn name_and_version(identifier: &str) -> Option<String> {
    let (url, fragment) = identifier.rsplit_once('#')?;
    let (name, version) = match fragment.split_once('@') {
        Some(both) => both,
        None => (url.split('?').next()?.rsplit('/').next()?, fragment),
    };
    Some(format!("{name} {version}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_tell_name_and_version() {
        let same = |identifier: &str| name_and_version(identifier).unwrap();
        let registry = "registry+https://github.com/rust-lang/crates.io-index#num-dual@0.15.1";
        assert_eq!(same(registry), "num-dual 0.15.1");
        assert_eq!(same("path+file:///home/models/lag#0.1.0"), "lag 0.1.0");
        assert_eq!(same("path+file:///home/models#lag@0.1.0"), "lag 0.1.0");
        assert_eq!(same("git+https://example.org/lag?branch=main#0.1.0"), "lag 0.1.0");
        assert_eq!(name_and_version("lag 0.1.0"), None);
    }
}
