#![doc = include_str!("../README.md")]
//!
//! Each command is a type whose fields clap fills from the command line. Those that run FMUs in other processes take the
//! program for these, which works instead if its arguments say so.

mod command;
mod compare;
mod comparison;
mod experiment;
pub mod journal;
mod linearize;
mod plot_format;
mod simulate;
mod summary;
mod sweep;
pub mod workers;

use std::fs;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_master::Fmu;
use fmu_master::scenario::Scenario;
use fmu_package::connection;
use fmu_terms::like;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Arc;

pub use command::{Command, fail_when_an_fmu_exits};
pub use experiment::TrialExport;
pub use sweep::design::{Range, latin_fractions};

/// Where `export` writes FMUs in a workspace.
pub const FMUS: &str = "target/fmu";

/// Opens an FMU for the command line.
///
/// # Errors
/// When the FMU cannot be opened, as for [`Fmu::open`]; for a missing file, with what to do about it.
pub fn open(path: &Path) -> Result<Arc<Fmu>> {
    refuse_missing(path)?;
    Fmu::open(path)
}

/// Refuses an FMU that is not there.
///
/// # Errors
/// When it is not, with what to do about it.
pub fn refuse_missing(fmu: &Path) -> Result<()> {
    if fmu.exists() {
        return Ok(());
    }
    bail!("cannot import {}: there is no such file; {}", fmu.display(), remedy(fmu))
}

/// Advice about a missing FMU: where `export` writes FMUs, and the nearest file name in its folder.
fn remedy(path: &Path) -> String {
    let others = path.parent().and_then(|folder| folder.read_dir().ok()).into_iter().flatten().flatten();
    let others =
        others.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|end| end == "fmu"));
    let mut others: Vec<_> =
        others.map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
    others.sort();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let like = like(&name, others.iter().map(String::as_str));
    format!("`export` writes FMUs to {FMUS}{like}")
}

/// Which FMUs a scenario runs, and how they are connected.
#[derive(Args, Debug)]
#[group(skip)]
pub struct FmuArguments {
    /// The folder with the FMUs
    #[arg(long = "fmus", value_name = "DIR", default_value = FMUS)]
    pub folder: PathBuf,
    /// Replace an FMU of the scenario, by its name there, with another file
    #[arg(long = "fmu", value_name = "NAME=FILE.fmu", value_parser = name_and_value::<PathBuf>("NAME=FILE.fmu"))]
    pub files: Vec<(String, PathBuf)>,
    /// Replace the scenario's connections, for FMUs with other names or units
    #[arg(long, value_name = "FILE.toml")]
    pub connections: Option<PathBuf>,
}

impl FmuArguments {
    /// Replaces a scenario's FMUs with the given files, by name, and its connections.
    ///
    /// # Errors
    /// When the scenario has no such FMU, there is no file, or the connections cannot be read.
    pub fn give(&self, scenario: &mut Scenario) -> Result<()> {
        for (index, (name, file)) in self.files.iter().enumerate() {
            if self.files[..index].iter().any(|(other, _)| other == name) {
                bail!("duplicate FMU: --fmu names {name} twice");
            }
            let Some(member) = scenario.fmus.iter_mut().find(|member| member.name == *name) else {
                let names: Vec<_> = scenario.fmus.iter().map(|member| member.name.as_str()).collect();
                bail!("the scenario has no FMU {name}; it has {}", names.join(", "));
            };
            member.file.clone_from(file);
            scenario.has_replaced_fmus = true;
        }
        for member in &scenario.fmus {
            if !member.file.exists() {
                return Err(member.location.error(format!(
                    "{} does not exist; name another folder with --fmus DIR or another file with --fmu {}=FILE.fmu: {}",
                    member.file.display(),
                    member.name,
                    remedy(&member.file),
                )));
            }
        }
        if let Some(file) = &self.connections {
            scenario.connections = Some(connection::read(file)?);
            scenario.files.push(file.clone());
        }
        Ok(())
    }

    /// Refuses what replaces parts of a scenario.
    fn refuse(&self, subject: &str) -> Result<()> {
        let option = match (self.files.first(), &self.connections) {
            (Some((name, file)), _) => format!("--fmu {name}={}", file.display()),
            (None, Some(file)) => format!("--connections {}", file.display()),
            (None, None) => return Ok(()),
        };
        bail!("{option}: only for scenarios, not {subject}")
    }
}

/// All files that a run of the scenario depends on.
#[must_use]
pub fn inputs(scenario: &Scenario) -> Vec<PathBuf> {
    let members = scenario.fmus.iter().map(|member| member.file.clone());
    members.chain(scenario.files.clone()).collect()
}

/// Creates a folder for results.
///
/// # Errors
/// When it cannot be made.
pub fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))
}

/// A progress bar, drawn only if standard error is a terminal.
///
/// # Errors
/// When the template of the progress is wrong.
pub fn progress_bar(length: u64, progress: &str) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template(&format!("{{wide_bar}} {progress}  {{eta}} left"));
    Ok(ProgressBar::new(length).with_style(style.context("no progress bar")?))
}

/// Parses a number in a finite range.
pub fn number_in(
    range: RangeInclusive<f64>,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected {expected}"))
    }
}

/// Parses a finite number.
pub fn finite() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    number_in(f64::MIN..=f64::MAX, "a finite number")
}

/// Parses a finite number above 0.
pub fn positive() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    number_in(f64::MIN_POSITIVE..=f64::MAX, "a finite number above 0")
}

/// Parses a name, an equals sign and a value, both not empty.
pub fn name_and_value<V: From<String>>(
    expected: &'static str,
) -> impl Fn(&str) -> Result<(String, V), String> + Clone + Send + Sync {
    move |text| match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.to_owned(), V::from(value.to_owned())))
        }
        _ => Err(format!("expected {expected}")),
    }
}

/// Refuses results that would overwrite an input. A folder that does not exist yet holds none.
///
/// # Errors
/// When one would.
pub fn refuse_overlap(folder: &Path, results: &[PathBuf], inputs: &[PathBuf]) -> Result<()> {
    if folder.is_dir() {
        writing::refuse_overlap(results, inputs)?;
    }
    Ok(())
}

/// Writes texts into a folder by name, and prints their paths.
///
/// # Errors
/// When one cannot be written.
pub fn write<'a>(folder: &Path, texts: impl IntoIterator<Item = (&'a str, String)>) -> Result<()> {
    texts.into_iter().try_for_each(|(name, text)| write_file(&folder.join(name), text.as_bytes()))
}

/// Writes a file, and prints its path.
///
/// # Errors
/// When it cannot be written.
pub fn write_file(path: &Path, content: &[u8]) -> Result<()> {
    writing::write(path, |writer| writer.write_all(content))?;
    Ok(print(&format!("{}\n", path.display()))?)
}
