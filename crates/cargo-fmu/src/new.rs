//! `new`: creates a package that exports immediately, as a template to edit.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use fmu_io::terminal::{print, program};
use fmu_terms::{is_identifier, is_reserved_by_windows};

use super::metadata::{Metadata, cargo};

/// The settings of a workspace with which `cargo test` takes the dependencies that a trial export has compiled.
const PROFILE: &str = "[profile.dev.package.\"*\"]\ndebug = false\n";

/// The settings with which a new package's library is compiled. Cargo's sixteen units repeat more work, and inline less
/// between them.
const LIBRARY_PROFILE: &str = "[profile.release]\ncodegen-units = 2\n";

/// The build script of new packages, and the declaration from which it generates.
pub const BUILD_SCRIPT: &str = include_str!("../templates/build.rs");
pub const DECLARATION: &str = "model.json";

/// Create a package with a model that exports immediately
#[derive(Args, Debug)]
pub struct New {
    /// The folder to create; its name is the package's
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The package's name [default: the folder's]
    #[arg(long)]
    name: Option<String>,
    /// The model to start from
    #[arg(long, value_enum, default_value_t = Template::Dahlquist)]
    template: Template,
    /// Version control, as for `cargo new`
    #[arg(long)]
    vcs: Option<String>,
}

/// The templates: the ladder of `docs/ladder.md` in the repository, and a controller.
#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Template {
    /// One equation
    Dahlquist,
    /// Two equations, in forty lines
    VanDerPol,
    /// State events with state jumps
    BouncingBall,
    /// Modes, in an enum, and events between them
    StickSlip,
    /// Time events, and termination by the model
    Stair,
    /// Inputs and outputs of each type
    Feedthrough,
    /// Inputs and outputs of each FMI 3.0 type, for FMI 3.0
    #[value(name = "feedthrough_3")]
    Feedthrough3,
    /// A linear system with arrays sized by structural parameters, for FMI 3.0
    StateSpace,
    /// Heat conduction in a rod: an array of states that read their neighbors, for FMI 3.0
    Diffusion,
    /// Two rates: a fast actuator that drives a slow thermal mass
    Furnace,
    /// Clocks of each kind, for FMI 3.0
    Clocks,
    /// Data from a resource file
    Resource,
    /// A layer of a neural network, with weights from a resource file
    NeuralLayer,
    /// A battery of cells: a measured characteristic, and a trip
    Battery,
    /// A pack of cells that heat each other: an array of components
    Pack,
    /// A vehicle that follows a drive cycle: a table over time, whose points are events
    DriveCycle,
    /// A sampled PI controller
    Sampled,
    /// The same as firmware, too, on a Cortex-M7
    Ecu,
    /// Two sampled controllers, each with a clock of its own
    Cascade,
    /// A queue that another simulation steps, for co-simulation
    Checkout,
}

/// The files of a template.
struct Files {
    declaration: &'static str,
    source: &'static str,
    /// Other files by name.
    others: &'static [(&'static str, &'static str)],
}

/// The files in a template's folder: all, or others than declaration and source alone.
macro_rules! files {
    (others: $folder:literal $(, $other:literal)*) => {
        &[$(($other, include_str!(concat!("../templates/", $folder, "/", $other)))),*]
    };
    ($folder:literal $(, $other:literal)*) => {
        Files {
            declaration: include_str!(concat!("../templates/", $folder, "/model.json")),
            source: include_str!(concat!("../templates/", $folder, "/lib.rs")),
            others: files!(others: $folder $(, $other)*),
        }
    };
}

impl Template {
    fn files(self) -> Files {
        match self {
            Self::Dahlquist => files!("dahlquist"),
            Self::VanDerPol => files!("van_der_pol"),
            Self::BouncingBall => files!("bouncing_ball"),
            Self::StickSlip => files!("stick_slip"),
            Self::Stair => files!("stair"),
            Self::Feedthrough => files!("feedthrough"),
            Self::Feedthrough3 => files!("feedthrough_3"),
            Self::StateSpace => files!("state_space"),
            Self::Diffusion => files!("diffusion"),
            Self::Furnace => files!("furnace"),
            Self::Clocks => files!("clocks"),
            Self::Resource => files!("resource", "resources/y.txt"),
            Self::NeuralLayer => files!("neural_layer", "resources/weights.csv"),
            Self::Battery => files!("battery", "resources/voltage.csv"),
            Self::Pack => files!("pack"),
            Self::DriveCycle => files!("drive_cycle", "resources/cycle.csv"),
            Self::Sampled => files!("sampled"),
            Self::Ecu => Files {
                source: concat!("#![no_std]\n", include_str!("../templates/sampled/lib.rs")),
                others: files!(
                    others: "ecu",
                    "firmware/.cargo/config.toml",
                    "firmware/manifest.toml",
                    "firmware/build.rs",
                    "firmware/memory.x",
                    "firmware/src/main.rs"
                ),
                ..Self::Sampled.files()
            },
            Self::Cascade => files!("cascade"),
            Self::Checkout => files!("checkout", "src/queue.rs"),
        }
    }
}

impl New {
    /// Lets cargo create the package, with its names, editions and workspaces, and fills it in.
    ///
    /// # Errors
    /// When cargo rejects it, or a file cannot be written.
    pub fn run(&self) -> Result<()> {
        let path = self.path.display();
        if self.path.exists() {
            bail!(
                "{path} already exists; choose another folder (the README of fmu-export tells how to turn an existing \
                 crate into an FMU)"
            );
        }
        let name = match &self.name {
            Some(name) => name.as_str(),
            None => self
                .path
                .file_name()
                .and_then(|name| name.to_str())
                .context("the folder's name is not text")?,
        };
        let identifier = name.replace('-', "_");
        if !is_identifier(&identifier) {
            bail!(
                "'{identifier}' is not a valid FMU name: it may have letters a to z and A to Z, digits and underscores, but \
                 no digit at the start; choose another with --name"
            );
        }
        if is_reserved_by_windows(&identifier) {
            bail!(
                "'{identifier}' names a device of Windows, so that it cannot name a library; choose another with --name"
            );
        }
        let mut command = cargo();
        command.args(["new", "--lib", "--quiet"]);
        if let Some(name) = &self.name {
            command.args(["--name", name]);
        }
        if let Some(vcs) = &self.vcs {
            command.args(["--vcs", vcs]);
        }
        let status =
            command.arg(&self.path).status().context("cannot run cargo; install Rust, or set CARGO")?;
        if !status.success() {
            bail!("cargo could not create the package; see its message above");
        }
        let root = self.workspace_of_others();
        self.fill_in(name, &identifier, root.is_none())?;
        print(&format!(
            "Created `{path}`. Declare variables in model.json and write the equations in src/lib.rs, then run \
             `{} export`.\n",
            program()
        ))?;
        if let Some(root) = root
            && !fs::read_to_string(&root).is_ok_and(|manifest| manifest.contains("[profile.dev"))
        {
            print(&format!(
                "Add these lines to {}, so that `cargo test` takes the dependencies that `{} simulate` compiles:\n\n{PROFILE}",
                root.display(),
                program()
            ))?;
        }
        Ok(())
    }

    /// The manifest of the workspace that the new package is a member of, if cargo finds one other than the package's.
    fn workspace_of_others(&self) -> Option<PathBuf> {
        let root = Metadata::of(Some(&self.path.join("Cargo.toml"))).ok()?.workspace_root;
        let is_own = root.canonicalize().ok()? == self.path.canonicalize().ok()?;
        (!is_own).then(|| root.join("Cargo.toml"))
    }

    fn fill_in(&self, name: &str, identifier: &str, is_root: bool) -> Result<()> {
        let files = self.template.files();
        let write = |file: &str, content: &str| {
            let path = self.path.join(file);
            fs::write(&path, content).with_context(|| format!("cannot write {}", path.display()))
        };
        let manifest_file = self.path.join("Cargo.toml");
        let manifest = fs::read_to_string(&manifest_file)
            .with_context(|| format!("cannot read {}", manifest_file.display()))?;
        let profile = if is_root { format!("\n{LIBRARY_PROFILE}\n{PROFILE}") } else { String::new() };
        let types = match self.template {
            // Firmware takes the model as a crate of Rust.
            Template::Ecu => r#""cdylib", "rlib""#,
            _ => r#""cdylib""#,
        };
        let manifest = manifest_of(&manifest, identifier, types, &self.path);
        write("Cargo.toml", &(manifest + &profile))?;
        write("build.rs", BUILD_SCRIPT)?;
        write(DECLARATION, files.declaration)?;
        write("model.schema.json", fmu_export_build::SCHEMA)?;
        let of_model = |content: &str| {
            let content = content.replace("{Type}", &type_name(name)).replace("{name}", name);
            content.replace("{fmu-export}", &source_of("fmu-export", &self.path.join("firmware")))
        };
        write("src/lib.rs", &of_model(files.source))?;
        for (file, content) in files.others {
            // The package of this command leaves out folders with a Cargo.toml.
            let file = &file.replace("manifest.toml", "Cargo.toml");
            let folder = Path::new(file).parent().map(|folder| self.path.join(folder));
            if let Some(folder) = folder {
                fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
            }
            write(file, &of_model(content))?;
        }
        let readme = include_str!("../templates/README.md")
            .replace("{name}", name)
            .replace("{identifier}", identifier);
        write("README.md", &readme)
    }
}

/// Cargo's manifest, with the library's types and the dependencies.
fn manifest_of(manifest: &str, identifier: &str, types: &str, folder: &Path) -> String {
    let package = manifest.split("[dependencies]").next().unwrap_or_default().trim_end();
    let (runtime, build) = (source_of("fmu-export", folder), source_of("fmu-export-build", folder));
    format!(
        "{package}\n\
         links = \"fmu-{identifier}\" # so that `cargo fmu` can generate in place of build.rs, which takes long to compile\n\n\
         [lib]\n\
         crate-type = [{types}]\n\n\
         [dependencies]\n\
         fmu-export = {{ {runtime} }}\n\n\
         [build-dependencies]\n\
         fmu-export-build = {{ {build} }}\n"
    )
}

/// Where a package in a folder finds one of the exporter's crates.
fn source_of(name: &str, folder: &Path) -> String {
    match checkout() {
        Some(crates) => format!("path = {:?}", relative(crates, folder).join(name).display().to_string()),
        None => format!("version = {:?}", env!("CARGO_PKG_VERSION")),
    }
}

/// The folder of the exporter's crates, if this command was built from a checkout that still exists; new packages then
/// depend on these crates.
pub fn checkout() -> Option<&'static Path> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    crates.join("fmu-export/Cargo.toml").is_file().then_some(crates)
}

/// The folder of the exporter's crates: relative for a package in or next to the checkout, so that both can be moved
/// together; otherwise absolute.
fn relative(crates: &Path, package: &Path) -> PathBuf {
    let beside = crates.ancestors().nth(2).filter(|beside| beside.parent().is_some());
    let (Some(beside), Ok(package)) = (beside, package.canonicalize()) else { return crates.to_owned() };
    let Ok(below) = package.strip_prefix(beside) else { return crates.to_owned() };
    let common =
        crates.components().zip(package.components()).take_while(|(one, other)| one == other).count();
    let up = beside.components().count() + below.components().count() - common;
    let up = std::iter::repeat_n(Path::new(".."), up);
    up.chain(crates.components().skip(common).map(|part| Path::new(part.as_os_str()))).collect()
}

/// Types used by the templates, after which no model can be named.
const USED_TYPES: [&str; 20] = [
    "Context",
    "Equations",
    "Error",
    "Event",
    "Inputs",
    "Locals",
    "Mode",
    "Number",
    "Option",
    "Outputs",
    "Parameters",
    "Persistent",
    "Queue",
    "Sample",
    "Sampled",
    "Simulation",
    "States",
    "Step",
    "Stepper",
    "Variables",
];

/// The name of the model's type: the package's, in upper camel case.
fn type_name(package: &str) -> String {
    let words = package.split(['-', '_']);
    let name: String = words
        .map(|word| word.get(..1).unwrap_or_default().to_uppercase() + word.get(1..).unwrap_or_default())
        .collect();
    if USED_TYPES.contains(&name.as_str()) { name + "Fmu" } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_are_found_from_packages_in_the_checkout_and_beside_it() {
        let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let seen = |package: &Path| relative(crates, package);
        assert_eq!(seen(crates), Path::new(""));
        assert_eq!(seen(&crates.join("cargo-fmu")), Path::new(".."));
        assert_eq!(seen(&crates.join("../docs")), Path::new("../crates"));
        let beside = crates.ancestors().nth(2).unwrap();
        let checkout = crates.parent().unwrap().file_name().unwrap();
        if beside.parent().is_some() {
            assert_eq!(seen(beside), Path::new(checkout).join("crates"));
        }
        assert_eq!(seen(Path::new("/")), crates);
    }

    #[test]
    fn types_are_named_after_packages() {
        assert_eq!(type_name("lag"), "Lag");
        assert_eq!(type_name("two_stage-lag"), "TwoStageLag");
        assert_eq!(type_name("sampled"), "SampledFmu");
    }
}
