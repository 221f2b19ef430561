//! Command-line arguments, and a module for each command.

mod compare;
mod identify;
mod live;
mod reproduce;
mod show;
mod simulate;
mod study;
mod sweep;
mod tune;

use std::fs;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use crate::importer;
use crate::mapping;
use crate::scenario::Scenario;
use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use fmu_package::terminal::print;
use fmu_package::writing;
use indicatif::{ProgressBar, ProgressStyle};

/// Where `boost-fmu export` writes FMUs.
const FMUS: &str = "target/fmu";

const EXIT_STATUSES: &str = "\
Exit status:
  0    success; `reproduce`: all claims hold; `study`: all criteria hold
  1    `reproduce`: a claim fails; `study`: a criterion fails
  2    failure or wrong command line; see standard error
  130  interrupted

A failed run of a `sweep` is reported in its row of the results and does not change the exit status.";

/// Laboratory for boost control: runs experiments with FMUs
#[derive(Parser)]
#[command(name = "boost-lab", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scenario, a system or a single FMU
    Simulate(Box<simulate::Arguments>),
    /// Compare records: overlaid in one plot, with their differences in numbers
    Compare(compare::Arguments),
    /// Run scenarios and show them on one page
    Show {
        /// The scenarios (see docs/laboratory.md)
        #[arg(value_name = "SCENARIO.toml", required = true)]
        scenarios: Vec<PathBuf>,
        #[command(flatten)]
        fmus: FmuArguments,
        /// Page title
        #[arg(long, default_value = "Scenarios")]
        title: String,
        /// The page to write
        #[arg(long, value_name = "FILE.html", default_value = "target/scenarios.html")]
        out: PathBuf,
    },
    /// Reproduce the paper's figures and check its claims against the FMUs
    ///
    /// Exits with 0 if all claims hold, 1 if one fails, and 2 if an experiment cannot be run.
    Reproduce {
        /// Figure numbers [default: all]
        figures: Vec<u32>,
        /// The folder with `BoostPlant.fmu` and `BoostController.fmu`
        #[arg(long, value_name = "DIR", default_value = FMUS)]
        fmus: PathBuf,
        /// The folder for report.html and report.json
        #[arg(long, value_name = "DIR", default_value = "target/reproduction")]
        out: PathBuf,
    },
    /// Write a page that runs plant and controller live in a browser
    Live(live::Arguments),
    /// Tune the controller's gain schedule to a plant
    Tune(tune::Arguments),
    /// Run a scenario for many parameter values, on all cores; resumes if interrupted
    Sweep {
        /// The parameter study (see docs/laboratory.md)
        #[arg(value_name = "STUDY.toml")]
        study: PathBuf,
        #[command(flatten)]
        fmus: FmuArguments,
        /// The folder for report.html, results.csv, results.parquet, the journal and the records
        #[arg(long, value_name = "DIR", default_value = "target/sweep")]
        out: PathBuf,
        /// Write units in the header of results.csv: `name (unit)`
        #[arg(long)]
        units: bool,
        /// Number of runs in parallel [default: one per core]
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
        threads: Option<u16>,
    },
    /// Judge a controller on random plants, ambient conditions and manoeuvres; resumes if interrupted
    ///
    /// Exits with 0 if all criteria hold, and 1 if one fails.
    Study(study::Arguments),
    /// Identify plant parameters from measured data
    Identify {
        #[command(subcommand)]
        what: Identify,
    },
}

#[derive(Args)]
struct FmuArguments {
    /// The folder with the FMUs
    #[arg(long = "fmus", value_name = "DIR", default_value = FMUS)]
    folder: PathBuf,
    /// Replace an FMU of the scenario, by its name there, with another file
    #[arg(long = "fmu", value_name = "NAME=FILE.fmu", value_parser = name_and_path)]
    files: Vec<(String, PathBuf)>,
    /// Map for an FMU with other names and units, written by `boost-fmu check --write-map`
    #[arg(long = "map", value_name = "FILE.json")]
    maps: Vec<PathBuf>,
}

impl FmuArguments {
    /// Replaces a scenario's FMUs with the given files, by name, and adds the maps.
    fn give(&self, scenario: &mut Scenario) -> Result<()> {
        for (index, (name, file)) in self.files.iter().enumerate() {
            if self.files[..index].iter().any(|(other, _)| other == name) {
                bail!("duplicate FMU: --fmu names {name} twice");
            }
            let Some(member) = scenario.fmus.iter_mut().find(|member| member.name == *name) else {
                let names: Vec<_> = scenario.fmus.iter().map(|member| member.name.as_str()).collect();
                bail!("the scenario has no FMU {name}: there are {}", names.join(", "));
            };
            member.file.clone_from(file);
            scenario.has_replaced_fmus = true;
        }
        for member in &scenario.fmus {
            if !member.file.exists() {
                return Err(member.location.error(format!(
                    "{} does not exist: {}; or name another folder with --fmus DIR or another file with --fmu \
                     {}=FILE.fmu",
                    member.file.display(),
                    importer::remedy(&member.file),
                    member.name
                )));
            }
        }
        mapping::give(scenario, &self.maps)
    }

    fn refuse_files(&self, subject: &str) -> Result<()> {
        match self.files.first() {
            Some((name, file)) => bail!("--fmu {name}={}: only for scenarios, not {subject}", file.display()),
            None => Ok(()),
        }
    }

    fn refuse_maps(&self, reason: &str) -> Result<()> {
        match self.maps.first() {
            Some(map) => bail!("--map {}: {reason}", map.display()),
            None => Ok(()),
        }
    }

    /// All files that a run of the scenario depends on.
    fn inputs(&self, scenario: &Scenario) -> Vec<PathBuf> {
        let members = scenario.fmus.iter().map(|member| member.file.clone());
        members.chain(scenario.files.clone()).chain(self.maps.clone()).collect()
    }
}

#[derive(Subcommand)]
enum Identify {
    /// The wastegate actuator with its valve and tank, as in section 4.2 of the paper
    Actuator(identify::Arguments),
}

/// Runs the command. Returns false if a claim of `reproduce` or a criterion of `study` fails.
pub fn run() -> Result<bool> {
    match Arguments::parse().command {
        Command::Simulate(arguments) => simulate::run(&arguments).map(|()| true),
        Command::Compare(arguments) => compare::run(&arguments).map(|()| true),
        Command::Show { scenarios, fmus, title, out } => {
            show::run(&scenarios, &fmus, &title, &out).map(|()| true)
        }
        Command::Reproduce { figures, fmus, out } => reproduce::run(&fmus, &out, &figures),
        Command::Live(arguments) => live::run(&arguments).map(|()| true),
        Command::Tune(arguments) => tune::run(&arguments).map(|()| true),
        Command::Study(arguments) => study::run(&arguments),
        Command::Identify { what: Identify::Actuator(arguments) } => identify::run(arguments).map(|()| true),
        Command::Sweep { study, fmus, out, units, threads } => {
            sweep::run(&study, &fmus, &out, units, threads.map(usize::from)).map(|()| true)
        }
    }
}

/// Creates a folder for results.
fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))
}

/// Refuses results that would overwrite an input. A folder that does not exist yet holds none.
fn refuse_overlap(folder: &Path, results: &[PathBuf], inputs: &[PathBuf]) -> Result<()> {
    if folder.is_dir() {
        writing::refuse_overlap(results, inputs)?;
    }
    Ok(())
}

/// A progress bar, drawn only if standard error is a terminal.
fn progress_bar(length: u64, progress: &str) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template(&format!("{{wide_bar}} {progress}  {{eta}} left"));
    Ok(ProgressBar::new(length).with_style(style.context("no progress bar")?))
}

/// Writes texts into a folder by name, and prints their paths.
fn write<'a>(folder: &Path, texts: impl IntoIterator<Item = (&'a str, String)>) -> Result<()> {
    for (name, text) in texts {
        let path = folder.join(name);
        writing::write(&path, |writer| writer.write_all(text.as_bytes()))?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}

/// Parses a number in a finite range.
fn number_in(
    range: RangeInclusive<f64>,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected {expected}"))
    }
}

/// Parses a finite number.
fn finite() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    number_in(f64::MIN..=f64::MAX, "a finite number")
}

/// Parses a finite number above 0.
fn positive() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    number_in(f64::MIN_POSITIVE..=f64::MAX, "a finite number above 0")
}

fn name_and_value(text: &str) -> Result<(String, String)> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.to_owned(), value.to_owned()))
        }
        _ => bail!("expected NAME=VALUE"),
    }
}

fn name_and_path(text: &str) -> Result<(String, PathBuf)> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && !path.is_empty() => Ok((name.to_owned(), path.into())),
        _ => bail!("expected NAME=FILE.fmu"),
    }
}
