//! Compiles models with cargo, and finds what it made.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context, Result, bail};
use cargo_metadata::{CrateType, Message, Metadata, Package};
use fmi2_export::package::reading;

use super::target::Build;

/// What cargo built.
pub struct Compiled {
    /// The library of each model.
    libraries: BTreeMap<String, PathBuf>,
    /// The output folders of all build scripts.
    generated: Vec<PathBuf>,
}

impl Compiled {
    /// The library of a model.
    pub fn library(&self, model: &str) -> Result<&Path> {
        let library = self.libraries.get(model).map(PathBuf::as_path);
        library.with_context(|| format!("cargo built no library of {model}"))
    }

    /// The folder of what the build generated for a model.
    pub fn generated(&self, model: &str) -> Result<PathBuf> {
        self.generated
            .iter()
            .map(|folder| folder.join(model))
            .find(|folder| folder.join("modelDescription.xml").is_file())
            .with_context(|| {
                format!("the build made no modelDescription.xml for {model}; does build.rs call fmi2_export::build::generate?")
            })
    }

    /// The description that the build generated for a model.
    pub fn description(&self, model: &str) -> Result<String> {
        Ok(reading::text(&self.generated(model)?.join("modelDescription.xml"))?)
    }
}

/// Compiles packages of a workspace; cargo's progress shows on stderr.
pub fn compile<'a>(
    metadata: &Metadata,
    packages: impl Iterator<Item = &'a Package>,
    build: &Build,
) -> Result<Compiled> {
    let mut command = build.command();
    command
        .arg("--message-format=json-render-diagnostics")
        .arg("--manifest-path")
        .arg(metadata.workspace_root.join("Cargo.toml"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped());
    for package in packages {
        command.args(["--package", &package.name]);
    }
    let mut child = command.spawn().context("cannot run cargo; install Rust, or set CARGO to where it is")?;
    let stdout = child.stdout.take().context("cargo has no output")?;
    let mut compiled = Compiled { libraries: BTreeMap::new(), generated: vec![] };
    for message in Message::parse_stream(BufReader::new(stdout)) {
        match message.context("cannot read cargo's messages")? {
            Message::BuildScriptExecuted(script) => compiled.generated.push(script.out_dir.into()),
            Message::CompilerArtifact(artifact)
                if artifact.target.crate_types.contains(&CrateType::CDyLib) =>
            {
                let suffix = build.platform.format().suffix();
                if let Some(file) = artifact.filenames.iter().find(|file| file.extension() == Some(suffix)) {
                    compiled.libraries.insert(artifact.target.name, file.clone().into());
                }
            }
            _ => {}
        }
    }
    if !child.wait().context("cargo did not end")?.success() {
        bail!("cargo could not build the models for {}; its messages stand above", build.name());
    }
    Ok(compiled)
}
