//! The command line's arguments, and the module that runs each command.

mod identify;
mod live;
mod reproduce;
mod show;
mod study;
mod tune;

use std::path::PathBuf;

use crate::mapping;
use anyhow::Result;
use cargo_fmu::run::{self, Maps, make_folder, number_in, positive, progress_bar, refuse_overlap, write};
use clap::{Args, Parser, Subcommand};
use fmu_master::scenario::Scenario;

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
    Simulate(Simulate),
    /// Compare records: over each other in one plot, and their differences as numbers
    Compare(run::Compare),
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
    Sweep(Sweep),
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

/// `simulate` with maps of names.
#[derive(Args)]
struct Simulate {
    #[command(flatten)]
    simulate: Box<run::Simulate>,
    #[command(flatten)]
    maps: MapArguments,
}

/// `sweep` with maps of names.
#[derive(Args)]
struct Sweep {
    #[command(flatten)]
    sweep: run::Sweep,
    #[command(flatten)]
    maps: MapArguments,
}

/// Which FMUs a scenario runs, and under which names.
#[derive(Args)]
struct FmuArguments {
    #[command(flatten)]
    fmus: run::FmuArguments,
    #[command(flatten)]
    maps: MapArguments,
}

/// Maps of names.
#[derive(Args)]
struct MapArguments {
    /// Maps for FMUs with other names and units, as `boost-fmu check --write-map` writes them
    #[arg(long = "map", value_name = "FILE.json")]
    maps: Vec<PathBuf>,
}

impl MapArguments {
    fn maps(&self) -> Maps<'_> {
        Maps { read: mapping::read, files: &self.maps, give: mapping::give }
    }
}

impl FmuArguments {
    fn give(&self, scenario: &mut Scenario) -> Result<()> {
        self.fmus.give(scenario, &self.maps.maps())
    }

    fn inputs(&self, scenario: &Scenario) -> Vec<PathBuf> {
        run::inputs(scenario, &self.maps.maps())
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
        Command::Simulate(Simulate { simulate, maps }) => {
            let out = |name: &str| format!("{name}.csv").into();
            simulate.run(&maps.maps(), Some(&out)).map(|()| true)
        }
        Command::Compare(compare) => compare.run().map(|()| true),
        Command::Show { scenarios, fmus, title, out } => {
            show::run(&scenarios, &fmus, &title, &out).map(|()| true)
        }
        Command::Reproduce { figures, fmus, out } => reproduce::run(&fmus, &out, &figures),
        Command::Live(arguments) => live::run(&arguments).map(|()| true),
        Command::Tune(arguments) => tune::run(&arguments).map(|()| true),
        Command::Study(arguments) => study::run(&arguments),
        Command::Identify { what: Identify::Actuator(arguments) } => identify::run(arguments).map(|()| true),
        Command::Sweep(Sweep { sweep, maps }) => sweep.run(&maps.maps()).map(|()| true),
    }
}
