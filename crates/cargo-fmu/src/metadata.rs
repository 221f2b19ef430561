//! Cargo's JSON output about a workspace and a build (the Cargo Book, "cargo metadata" and "External tools").

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use fmu_terms::Precision;
use serde::Deserialize;

/// A workspace.
#[derive(Debug, Deserialize)]
pub struct Metadata {
    /// The workspace's members.
    pub packages: Vec<Package>,
    /// The folder of the workspace's Cargo.toml.
    pub workspace_root: PathBuf,
    /// Where cargo builds.
    pub target_directory: PathBuf,
}

/// A package.
#[derive(Clone, Debug, Deserialize)]
pub struct Package {
    pub name: String,
    pub version: String,
    /// Where the package is from, unless it is a folder.
    pub source: Option<String>,
    pub manifest_path: PathBuf,
    /// A native library that the package links, or the name by which cargo's configuration replaces its build script.
    pub links: Option<String>,
    targets: Vec<Target>,
    dependencies: Vec<Dependency>,
    authors: Vec<String>,
    description: Option<String>,
    license: Option<String>,
}

/// A package that another one depends on.
#[derive(Clone, Debug, Deserialize)]
struct Dependency {
    /// The package's folder, unless it is from a registry.
    path: Option<PathBuf>,
    /// `build` or `dev`, unless the library depends on it.
    kind: Option<String>,
}

/// What cargo makes of a package.
#[derive(Clone, Debug, Deserialize)]
pub struct Target {
    pub name: String,
    crate_types: Vec<String>,
}

/// A message of a build.
#[derive(Debug, Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
pub enum Message {
    BuildScriptExecuted {
        out_dir: PathBuf,
    },
    CompilerArtifact {
        package_id: String,
        manifest_path: PathBuf,
        target: Target,
        filenames: Vec<PathBuf>,
    },
    #[serde(other)]
    Other,
}

impl Metadata {
    /// The workspace of a Cargo.toml, or of this folder.
    pub fn of(manifest: Option<&Path>) -> Result<Self> {
        // Dependencies are left out: otherwise cargo would fetch those of members that are not exported.
        Self::read(manifest, &["--no-deps"])
    }

    /// The workspace with all packages that its members depend on.
    pub fn with_dependencies(&self) -> Result<Self> {
        Self::read(Some(&self.workspace_root.join("Cargo.toml")), &[])
    }

    /// The folders of a package and of those in folders that it is made of.
    pub fn folders_of<'a>(&'a self, package: &'a Package) -> Vec<&'a Path> {
        let used = package.dependencies.iter().filter(|used| used.kind.is_none());
        let used = used.filter_map(|used| used.path.as_deref());
        let used = used.filter_map(|path| self.packages.iter().find(|package| package.folder() == path));
        used.flat_map(|package| self.folders_of(package)).chain([package.folder()]).collect()
    }

    fn read(manifest: Option<&Path>, arguments: &[&str]) -> Result<Self> {
        let mut command = cargo();
        command.args(["metadata", "--format-version", "1"]).args(arguments);
        if let Some(file) = manifest {
            command.arg("--manifest-path").arg(file);
        }
        let output = command.output().context("cannot run cargo; install Rust, or set CARGO to its path")?;
        if !output.status.success() {
            bail!("{}", String::from_utf8_lossy(&output.stderr).trim());
        }
        serde_json::from_slice(&output.stdout).context("cannot read cargo's output")
    }
}

impl Package {
    /// The package's folder.
    pub fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(&self.manifest_path)
    }

    /// What a model's declaration need not repeat of the package, as cargo tells it to build scripts.
    pub fn of_declaration(&self, precision: Precision) -> fmu_export_build::Package {
        fmu_export_build::Package {
            is_bare_metal: false,
            precision,
            name: self.name.clone(),
            version: self.version.clone(),
            description: self.description.clone().unwrap_or_default(),
            authors: self.authors.join(":"),
            license: self.license.clone().unwrap_or_default(),
        }
    }

    /// The package's libraries for other languages.
    pub fn libraries(&self) -> impl Iterator<Item = &Target> {
        self.targets.iter().filter(|target| target.is_library())
    }
}

impl Target {
    /// Whether the target is a library for other languages.
    pub fn is_library(&self) -> bool {
        self.crate_types.iter().any(|kind| kind == "cdylib")
    }
}

impl Message {
    /// Reads one of the lines that cargo prints.
    pub fn read(line: &str) -> Result<Self> {
        serde_json::from_str(line).context("cannot read cargo's messages")
    }
}

/// The cargo that runs this command, or the one on the path.
pub fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}
