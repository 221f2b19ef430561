//! The command line's arguments, and the module that runs each command.

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

use crate::mapping;
use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use fmu_master::scenario::Scenario;
use fmu_package::terminal::print;
use fmu_package::writing;
use indicatif::{ProgressBar, ProgressStyle};

/// Where `boost-fmu export` writes FMUs.
const FMUS: &str = "target/fmu";

/// What the process ends with.
const EXIT_STATUSES: &str = "\
Exit status:
  0    it is done; `reproduce`: all statements hold; `study`: all criteria hold
  1    `reproduce`: a statement does not hold; `study`: a criterion does not hold
  2    it could not be done, or the command line is wrong; standard error says why
  130  it was interrupted

A run of a `sweep` that fails is a row of the results, and does not change the exit status.";

/// The laboratory: drives FMUs through experiments of boost control.
#[derive(Parser)]
#[command(name = "boost-lab", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scenario, a system, or one FMU
    Simulate(Box<simulate::Arguments>),
    /// Compare records: over each other in one plot, and their differences as numbers
    Compare(compare::Arguments),
    /// Run scenarios, and show them on one page
    Show {
        /// The scenarios, which docs/laboratory.md describes
        #[arg(value_name = "SCENARIO.toml", required = true)]
        scenarios: Vec<PathBuf>,
        #[command(flatten)]
        fmus: FmuArguments,
        /// The page's title
        #[arg(long, default_value = "Scenarios")]
        title: String,
        /// The page to write
        #[arg(long, value_name = "FILE.html", default_value = "target/scenarios.html")]
        out: PathBuf,
    },
    /// Reproduce the paper's figures, and hold its statements against what the FMUs do
    ///
    /// Exits with 0 when all statements hold, with 1 when one does not and with 2 when an experiment cannot be
    /// run.
    Reproduce {
        /// The figures' numbers; all when none is named
        figures: Vec<u32>,
        /// The folder of `BoostPlant.fmu` and `BoostController.fmu`
        #[arg(long, value_name = "DIR", default_value = FMUS)]
        fmus: PathBuf,
        /// The folder to write report.html and report.json to
        #[arg(long, value_name = "DIR", default_value = "target/reproduction")]
        out: PathBuf,
    },
    /// Write a page that runs plant and controller live in a browser
    Live(live::Arguments),
    /// Tune the controller's gain schedule to a plant
    Tune(tune::Arguments),
    /// Run a scenario for many values of parameters, on all cores; goes on where it was interrupted
    Sweep {
        /// The study, which docs/laboratory.md describes
        #[arg(value_name = "STUDY.toml")]
        study: PathBuf,
        #[command(flatten)]
        fmus: FmuArguments,
        /// The folder for report.html, results.csv, results.parquet, the journal and the records
        #[arg(long, value_name = "DIR", default_value = "target/sweep")]
        out: PathBuf,
        /// Write units to the header of results.csv: `name (unit)`
        #[arg(long)]
        units: bool,
        /// How many runs there are at once [default: one on each core]
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
        threads: Option<u16>,
    },
    /// Judge a controller on random plants, days and manoeuvres; goes on where it was interrupted
    ///
    /// Exits with 0 when all criteria hold, and with 1 when one does not.
    Study(study::Arguments),
    /// Identify parameters of the plant from measured data
    Identify {
        #[command(subcommand)]
        what: Identify,
    },
}

/// Which FMUs a scenario runs.
#[derive(Args)]
struct FmuArguments {
    /// The folder of the FMUs
    #[arg(long = "fmus", value_name = "DIR", default_value = FMUS)]
    folder: PathBuf,
    /// Another file for an FMU of the scenario, by its name there
    #[arg(long = "fmu", value_name = "NAME=FILE.fmu", value_parser = name_and_path)]
    files: Vec<(String, PathBuf)>,
    /// Maps for FMUs with other names and units, as `boost-fmu check --write-map` writes them
    #[arg(long = "map", value_name = "FILE.json")]
    maps: Vec<PathBuf>,
}

impl FmuArguments {
    /// Puts the files in the places of a scenario's FMUs, by their names there, and gives it the maps.
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
                    "there is no {}: {}, --fmus DIR names another folder and --fmu {}=FILE.fmu another file",
                    member.file.display(),
                    fmu_master::remedy(&member.file),
                    member.name
                )));
            }
        }
        mapping::give(scenario, &self.maps)
    }

    /// Refuses other files for FMUs.
    fn refuse_files(&self, subject: &str) -> Result<()> {
        match self.files.first() {
            Some((name, file)) => bail!("--fmu {name}={}: {subject} has its own", file.display()),
            None => Ok(()),
        }
    }

    /// Refuses maps.
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
    /// The wastegate's actuator with its valve and its tank, as section 4.2 of the paper does
    Actuator(identify::Arguments),
}

/// Runs the command. Returns false when the statements of `reproduce` or the criteria of `study` do not all hold.
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

/// Makes a folder for results.
fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))
}

/// Refuses results that would destroy an input. A folder that is yet to be made holds none.
fn refuse_overlap(folder: &Path, results: &[PathBuf], inputs: &[PathBuf]) -> Result<()> {
    if folder.is_dir() {
        writing::refuse_overlap(results, inputs)?;
    }
    Ok(())
}

/// A progress bar, which is drawn only if standard error is a terminal.
fn progress_bar(length: u64, progress: &str) -> Result<ProgressBar> {
    let style = ProgressStyle::with_template(&format!("{{wide_bar}} {progress}  {{eta}} left"));
    Ok(ProgressBar::new(length).with_style(style.context("no progress bar")?))
}

/// Writes texts into a folder by their names, and says where.
fn write<'a>(folder: &Path, texts: impl IntoIterator<Item = (&'a str, String)>) -> Result<()> {
    for (name, text) in texts {
        let path = folder.join(name);
        writing::write(&path, |writer| writer.write_all(text.as_bytes()))?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}

/// Reads a number in a range, whose ends are finite.
fn number_in(
    range: RangeInclusive<f64>,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected {expected}"))
    }
}

/// Reads a finite number.
fn finite() -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    number_in(f64::MIN..=f64::MAX, "a finite number")
}

/// Reads a finite number above 0.
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
