//! Command-line arguments, and a module for each command.

mod identify;
mod live;
mod reproduce;
mod study;
mod tune;

use std::path::PathBuf;

use crate::mapping;
use crate::study::draw::known_plants;
use anyhow::Result;
use cargo_fmu::run::{
    self, FMUS, Maps, make_folder, number_in, positive, progress_bar, refuse_overlap, threads, write,
    write_file,
};
use clap::{Args, Parser, Subcommand};
use fmu_package::ParameterSet;

/// The files in a folder of results.
const HTML: &str = "report.html";
const JSON: &str = "report.json";
const JOURNAL: &str = "journal.jsonl";

const EXIT_STATUSES: &str = "\
Exit status:
  0    success; `reproduce`: no claim fails, known differences aside; `study`: all criteria hold
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
    Simulate(WithMaps<Box<run::Simulate>>),
    /// Compare records: their differences in numbers, and overlaid in a plot
    Compare(run::Compare),
    /// Linearize FMUs at an operating point: matrices, poles, frequency response, and a loop's margins
    Linearize(WithMaps<Box<run::Linearize>>),
    /// Reproduce the paper's figures and check its claims against the FMUs
    ///
    /// Exits with 0 if no claim fails, known differences aside, 1 if one fails, and 2 if an experiment cannot be run.
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
    Sweep(WithMaps<run::Sweep>),
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

/// The arguments of a command that runs FMUs, with maps of names.
#[derive(Args)]
struct WithMaps<T: Args> {
    #[command(flatten)]
    own: T,
    #[command(flatten)]
    maps: MapArguments,
}

/// Maps of names.
#[derive(Args)]
struct MapArguments {
    /// Map for an FMU with other names and units, written by `boost-fmu check --write-map`
    #[arg(long = "map", value_name = "FILE.json")]
    maps: Vec<PathBuf>,
}

impl MapArguments {
    fn maps(&self) -> Maps<'_> {
        Maps { read: mapping::read, files: &self.maps, give: mapping::give }
    }
}

fn parameter_sets(files: &[PathBuf]) -> Result<Vec<ParameterSet>> {
    Ok(files.iter().map(|file| ParameterSet::read(file)).collect::<Result<_, _>>()?)
}

/// The plants of the files, or this repository's without any.
fn plants(files: &[PathBuf]) -> Result<Vec<ParameterSet>> {
    if files.is_empty() { known_plants() } else { parameter_sets(files) }
}

#[derive(Subcommand)]
enum Identify {
    /// The wastegate actuator with its valve and tank, as in section 4.2 of the paper
    Actuator(identify::Arguments),
}

/// Runs the command. Returns false if a claim of `reproduce` or a criterion of `study` fails.
pub fn run() -> Result<bool> {
    match Arguments::parse().command {
        Command::Reproduce { figures, fmus, out } => return reproduce::run(&fmus, &out, &figures),
        Command::Study(arguments) => return study::run(&arguments),
        Command::Simulate(WithMaps { own, maps }) => own.run(&maps.maps()),
        Command::Compare(compare) => compare.run(),
        Command::Linearize(WithMaps { own, maps }) => own.run(&maps.maps()),
        Command::Live(arguments) => live::run(&arguments),
        Command::Tune(arguments) => tune::run(&arguments),
        Command::Identify { what: Identify::Actuator(arguments) } => identify::run(arguments),
        Command::Sweep(WithMaps { own, maps }) => own.run(&maps.maps()),
    }
    .map(|()| true)
}
