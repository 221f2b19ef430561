//! Command-line arguments, and a module for each command.

mod identify;
mod live;
mod reproduce;
mod study;
mod tune;

use std::env;
use std::path::PathBuf;

use crate::study::draw::known_plants;
use anyhow::Result;
use clap::{Parser, Subcommand};
use fmu_master::{Fmu, ONLY_ONCE};
use fmu_package::ParameterSet;
use fmu_run::workers::{Program, told_to_work};
use fmu_run::{FMUS, make_folder, number_in, positive, progress_bar, refuse_overlap, write, write_file};

/// The files in a folder of results.
const HTML: &str = "report.html";
const JSON: &str = "report.json";
const JOURNAL: &str = "journal.jsonl";

const EXIT_STATUSES: &str = "\
Exit status:
  0    success; `reproduce`: no claim fails except known differences; `study`: all criteria are met
  1    `reproduce`: a claim fails; `study`: a criterion is not met
  2    failure or wrong command line; see standard error
  130  interrupted";

/// Laboratory for boost control: runs experiments with FMUs
#[derive(Parser)]
#[command(name = "boost-lab", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Reproduce the paper's figures and check its claims against the FMUs
    ///
    /// Exits with 0 if no claim fails except known differences, 1 if one does, and 2 if an experiment cannot be run.
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
    /// Judge a controller on random plants, ambient conditions and manoeuvres; resumes if interrupted
    ///
    /// Exits with 0 if all criteria are met, and 1 if not.
    Study(study::Arguments),
    /// Identify plant parameters from measured data
    Identify {
        #[command(subcommand)]
        what: Identify,
    },
}

fn parameter_sets(files: &[PathBuf]) -> Result<Vec<ParameterSet>> {
    Ok(files.iter().map(|file| ParameterSet::read(file)).collect::<Result<_, _>>()?)
}

/// The plants of the files, or this repository's without any.
fn plants(files: &[PathBuf]) -> Result<Vec<ParameterSet>> {
    if files.is_empty() { known_plants() } else { parameter_sets(files) }
}

/// How many threads run FMUs: the number wanted or one per core, but one if an FMU allows only one instance per process.
fn threads<'a>(wanted: Option<u16>, fmus: impl IntoIterator<Item = &'a Fmu>) -> usize {
    let is_single = fmus.into_iter().any(|fmu| fmu.has_capability(ONLY_ONCE));
    if is_single { 1 } else { fmu_io::threads::number(wanted) }
}

#[derive(Subcommand)]
enum Identify {
    /// The wastegate actuator with its valve and tank, as in section 4.2 of the paper
    Actuator(identify::Arguments),
}

/// Runs the command. Returns false if a claim of `reproduce` fails or a criterion of `study` is not met.
pub fn run() -> Result<bool> {
    let (is_worker, arguments) = told_to_work(env::args_os().collect());
    let worker = || Program::this(&arguments);
    match Arguments::parse_from(&arguments).command {
        Command::Study(arguments) if is_worker => study::work(&arguments),
        Command::Tune(arguments) if is_worker => tune::work(&arguments),
        Command::Reproduce { figures, fmus, out } => return reproduce::run(&fmus, &out, &figures),
        Command::Study(arguments) => return study::run(&arguments, &worker()?),
        Command::Live(arguments) => live::run(&arguments),
        Command::Tune(arguments) => tune::run(&arguments, &worker()?),
        Command::Identify { what: Identify::Actuator(arguments) } => identify::run(arguments),
    }
    .map(|()| true)
}
