//! Generates models' interfaces in place of their build scripts.
//!
//! What a build script depends on takes more than half of the first build of a model, and is in this command already. Cargo
//! leaves out the script of a package with the key `links` if its configuration states what the script would print (the
//! Cargo Book, "Overriding Build Scripts"). Cargo without this command runs the script.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use anyhow::{Error, Result, bail};
use fmu_export_build::{Fmi, IDENTIFIER_VARIABLE, chosen_precision, generate_into};
use fmu_io::terminal::complain;
use fmu_terms::{INTERFACES_VARIABLE, Interfaces, PRECISION_VARIABLE, Precision, VERSION_VARIABLE, Version};

use super::metadata::{Metadata, Package};
use super::new::{BUILD_SCRIPT, DECLARATION, checkout};

/// The crate that generates.
const GENERATOR: &str = "fmu-export-build";

/// What an export chooses; the rest is the environment's.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    pub version: Option<Version>,
    pub interfaces: Option<Interfaces>,
    pub precision: Option<Precision>,
}

impl Choice {
    /// Tells the build scripts of a command of cargo.
    pub fn configure(self, command: &mut Command) {
        let Self { version, interfaces, precision } = self;
        let chosen = [
            (VERSION_VARIABLE, version.map(Version::as_str)),
            (INTERFACES_VARIABLE, interfaces.map(Interfaces::as_str)),
            (PRECISION_VARIABLE, precision.map(Precision::as_str)),
        ];
        command.envs(chosen.into_iter().filter_map(|(variable, text)| Some((variable, text?))));
    }
}

/// A model's interface that was generated in place of a build script.
pub struct GeneratedInterface {
    /// The key `links` of the package.
    links: String,
    /// The environment variable for the compiler: its name and value.
    variable: (String, String),
    /// The folder in which each model has its folder, as in that of a build script.
    pub folder: PathBuf,
}

impl GeneratedInterface {
    /// Generates those of the packages whose build scripts would do just that.
    ///
    /// # Errors
    /// When a declaration is rejected, which is then told, or a file cannot be written.
    pub fn generate_all<'a>(
        metadata: &Metadata,
        packages: impl Iterator<Item = &'a Package>,
        choice: Choice,
    ) -> Result<Vec<Self>> {
        let mut packages = packages.filter(|package| has_build_script_of_new(package)).peekable();
        if packages.peek().is_none() || !is_their_generator(metadata) {
            return Ok(vec![]);
        }
        let generated = packages.map(|package| Self::generate(metadata, package, choice));
        Ok(generated.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
    }

    /// Generates that of a package; none if its build script has to tell that the library has another name.
    fn generate(metadata: &Metadata, package: &Package, choice: Choice) -> Result<Option<Self>> {
        let Some(links) = package.links.clone() else { return Ok(None) };
        let root = shown(package.folder());
        let declaration = root.join(DECLARATION);
        let fmi = Fmi::chosen(&declaration, choice.version, choice.interfaces).map_err(Error::msg)?;
        let precision = chosen_precision(choice.precision).map_err(Error::msg)?;
        let folder = format!("fmu-generated/{}-{}-{precision}", fmi.version, fmi.interfaces);
        let folder = metadata.target_directory.join(folder);
        let name = format!("{}@{}", package.name, package.version);
        let generated = generate_into(&declaration, &folder, &package.of_declaration(precision), fmi)
            .and_then(|generated| generated.used_in(&root, &declaration));
        let generated = match generated {
            Ok(generated) => generated,
            Err(error) => {
                for finding in error.findings() {
                    complain(&format!("error: {name}: {}", finding.in_one_line()));
                }
                bail!("the declaration of {} is rejected; see the messages above", package.name);
            }
        };
        if !package.libraries().any(|library| library.name == generated.identifier()) {
            return Ok(None);
        }
        if let Some(warning) = generated.warning(&declaration) {
            complain(&format!("warning: {name}: {warning}"));
        }
        Ok(Some(Self { links, variable: generated.compiler_variable(), folder }))
    }

    /// Tells cargo what the build script would print, in a build for a Rust target.
    pub fn configure(&self, command: &mut Command, target: &str) -> Result<()> {
        let (variable, file) = &self.variable;
        // A JSON string is one of TOML.
        let [links, file] = [&self.links, file].map(serde_json::to_string);
        let setting = format!("target.{target}.{}.rustc-env.{variable}={}", links?, file?);
        command.arg("--config").arg(setting);
        // Cargo hashes several variables in any order, and would compile again. The value is for a message that is not
        // needed here.
        command.env(IDENTIFIER_VARIABLE, "");
        Ok(())
    }
}

/// Whether a package's build script is as `cargo fmu new` writes it, and can be left out.
fn has_build_script_of_new(package: &Package) -> bool {
    let script = fs::read_to_string(package.folder().join("build.rs"));
    package.links.is_some()
        && script.is_ok_and(|script| script.split_whitespace().eq(BUILD_SCRIPT.split_whitespace()))
}

/// Whether this command contains the generator of a workspace: the same version from a registry, or that of the checkout that
/// this command was built from, unchanged since.
fn is_their_generator(metadata: &Metadata) -> bool {
    // If cargo cannot tell, its build will say why.
    let Ok(resolved) = metadata.with_dependencies() else { return false };
    let mut generators = resolved.packages.iter().filter(|package| package.name == GENERATOR).peekable();
    generators.peek().is_some()
        && generators.all(|package| match (&package.source, checkout()) {
            (Some(_), _) => package.version == env!("CARGO_PKG_VERSION"),
            (None, Some(crates)) => {
                let is_there =
                    package.folder().canonicalize().ok() == crates.join(GENERATOR).canonicalize().ok();
                is_there && is_newer_than(&resolved.folders_of(package))
            }
            (None, None) => false,
        })
}

/// The folders of a package that are no part of its library.
const BESIDE_THE_LIBRARY: [&str; 3] = ["benches", "examples", "tests"];

/// Whether this command is newer than the libraries of some packages' folders.
fn is_newer_than(folders: &[&Path]) -> bool {
    let modified = |file: &Path| fs::metadata(file)?.modified();
    let built = env::current_exe().and_then(|command| modified(&command));
    let newest = |folder: &Path| newest(folder, &BESIDE_THE_LIBRARY);
    built.is_ok_and(|built| folders.iter().all(|folder| newest(folder).is_some_and(|source| source < built)))
}

/// When a file in a folder was last modified, but for those in some folders there.
fn newest(folder: &Path, but: &[&str]) -> Option<SystemTime> {
    let entries = fs::read_dir(folder).ok()?;
    let is_meant = |entry: &fs::DirEntry| !but.iter().any(|other| entry.file_name() == **other);
    let times = entries.filter(|entry| entry.as_ref().map_or(true, is_meant)).map(|entry| {
        let entry = entry.ok()?;
        let metadata = entry.metadata().ok()?;
        if metadata.is_dir() { newest(&entry.path(), &[]) } else { metadata.modified().ok() }
    });
    times.collect::<Option<Vec<_>>>()?.into_iter().max()
}

/// A folder as seen from the current one.
fn shown(folder: &Path) -> PathBuf {
    let here = env::current_dir().unwrap_or_default();
    folder.strip_prefix(here).unwrap_or(folder).to_owned()
}

#[cfg(test)]
mod tests {
    use core::time::Duration;

    use super::*;

    #[test]
    fn what_tests_use_is_no_part_of_a_library() {
        let package = tempfile::tempdir().unwrap();
        let since = |file: &str, seconds| {
            let path = package.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let time = SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
            fs::File::create(path).unwrap().set_modified(time).unwrap();
            newest(package.path(), &BESIDE_THE_LIBRARY)
                .unwrap()
                .duration_since(SystemTime::UNIX_EPOCH)
                .unwrap()
                .as_secs()
        };
        assert_eq!(since("Cargo.toml", 1), 1);
        assert_eq!(since("src/check/units.rs", 2), 2);
        for folder in BESIDE_THE_LIBRARY {
            assert_eq!(since(&format!("{folder}/main.rs"), 3), 2, "{folder}");
        }
        assert_eq!(since("src/tests/networks.rs", 4), 4);
    }
}
