//! `export`: compiles the models' libraries with cargo and packs each into an .fmu.
//!
//! A model is a workspace member whose library is a `cdylib` named after the model. Cargo's messages name the
//! description that the build wrote and compiled into the library; the FMU contains this file, so the two cannot
//! differ.
//!
//! The arguments here become a [`Plan`]; `plan` builds the libraries, and `packing` writes the files.

mod packing;
mod plan;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use fmu_io::terminal::{complain, program};
use fmu_package::Platform;
use fmu_terms::{Interface, Interfaces, Precision, Version};

pub use self::packing::say;
pub use self::plan::Plan;
use super::metadata::{Metadata, Package};
use super::sources;
use super::target::of_platform;
use super::target::{Build, Made, Profile, Target, WebAssembly};

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
    /// Precision of sampled models; see docs/ecu.md [default: the variable `FMU_PRECISION`, else double]
    #[arg(long, value_name = "PRECISION", value_parser = precisions())]
    precision: Option<Precision>,
    /// Cargo profile for the libraries; `dev` compiles faster and checks for overflow [default: fmu-library, or release if
    /// Cargo.toml has no such profile]
    #[arg(long, value_name = "PROFILE")]
    profile: Option<Profile>,
    /// A library built elsewhere from the same sources, with its platform
    #[arg(long = "binary", value_name = "PLATFORM=FILE", value_parser = of_platform::<PathBuf>)]
    binaries: Vec<(Platform, PathBuf)>,
    /// Write WebAssembly modules, MODEL.wasm, instead of FMUs; see docs/wasm.md
    #[arg(long, conflicts_with_all = ["targets", "profile", "binaries", "sources"])]
    wasm: bool,
    /// Include the models as C in the FMUs, for platforms without a library; see docs/sources.md
    #[arg(long)]
    sources: bool,
    /// Omit the descriptions of types from FMI 3.0, which FMPy below 0.3.24 cannot read
    #[arg(long)]
    no_type_descriptions: bool,
    /// The folder in cargo's target folder [default: fmu].
    #[arg(skip)]
    folder: Option<&'static str>,
}

/// Exports what is in the current folder for a trial, beside the FMUs that `export` writes, and returns the FMUs.
///
/// # Errors
/// When [`Export::plan`] or [`Plan::run`] fails.
pub fn trial(interface: Option<Interface>, version: Option<Version>) -> Result<Vec<PathBuf>> {
    let export = Export {
        versions: version.into_iter().collect(),
        interfaces: interface.map(Interfaces::from),
        profile: Some(Profile::trial()),
        folder: Some("fmu-trial"),
        ..Export::default()
    };
    let plan = export.plan()?;
    complain(&format!(
        "Trial export with cargo's profile dev, not optimized; for long runs: `{} export`, then simulate its FMU",
        program()
    ));
    plan.run(&[], &[])
}

impl Export {
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
        let folder = self.folder.unwrap_or("fmu");
        let out = self.out.unwrap_or_else(|| metadata.target_directory.join(folder));
        let Self { mut versions, interfaces, precision, profile, binaries, .. } = self;
        if interfaces == Some(Interfaces::ScheduledExecution) && versions.contains(&Version::Two) {
            bail!("--interfaces se needs FMI 3.0, but --fmi is 2");
        }
        versions.sort();
        versions.dedup();
        let versions =
            if versions.is_empty() { vec![None] } else { versions.into_iter().map(Some).collect() };
        let Self { wasm, sources, no_type_descriptions, .. } = self;
        let profile = profile.unwrap_or_default();
        let describes_types = !no_type_descriptions;
        Ok(Plan {
            metadata,
            builds,
            wasm,
            sources,
            describes_types,
            versions,
            interfaces,
            precision,
            profile,
            binaries,
            models,
            out,
        })
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
                bail!("nothing was built, because several things are missing:\n- {}", list.join("\n- "))
            }
        }
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

/// The values of `--precision`.
fn precisions() -> impl TypedValueParser<Value = Precision> {
    let values = Precision::ALL.map(|precision| {
        PossibleValue::new(precision.as_str()).help(match precision {
            Precision::Double => "`f64`",
            Precision::Single => "`f32`, as on an ECU without double precision",
        })
    });
    PossibleValuesParser::new(values).try_map(|text| text.parse::<Precision>())
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
