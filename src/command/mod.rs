//! The command line: what it takes, and which room does the work.

mod check;
mod compile;
mod coupling;
mod export;
mod info;
mod licenses;
mod merge;
mod parameters;
mod ssp;
mod target;

use std::path::PathBuf;

use anyhow::{Context, Result};
use boost_interface::Role;
use clap::{Parser, Subcommand};
use fmi2_export::package::Platform;

use self::target::Target;

/// What the process ends with.
const EXIT_STATUSES: &str = "\
Exit status:
  0    it is done; `check`: the FMU can take the place
  1    `check`: the FMU cannot take the place
  2    it could not be done, or the command line is wrong; standard error says why
  130  it was interrupted";

/// Exports the plant and the controller of the boost control as FMI 2.0 co-simulation FMUs, and couples them
/// with FMUs of other makers.
#[derive(Parser)]
#[command(name = "boost-fmu", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compile the models and write their .fmu files, and Boost.ssp, the system of both
    Export {
        /// The models to export, `BoostPlant` or `BoostController`; all when none is named
        models: Vec<String>,
        /// The folder to write to [default: fmu in cargo's target folder]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Parameter sets that Boost.ssp binds to the FMU that has their parameters
        #[arg(long, value_name = "FILE.ssv")]
        parameters: Vec<PathBuf>,
        /// What to build for: a folder's name of FMI (linux64, win64, darwin64, aarch64-linux ...) or a target's
        /// of Rust, which may end in the oldest glibc, as x86_64-unknown-linux-gnu.2.17 [default: this platform]
        #[arg(long = "target", value_name = "TARGET")]
        targets: Vec<Target>,
        /// A library that was built elsewhere from the same sources, and its platform
        #[arg(long = "binary", value_name = "PLATFORM=FILE", value_parser = of_platform::<PathBuf>)]
        binaries: Vec<(Platform, PathBuf)>,
    },
    /// Join FMUs of one model, each with libraries for other platforms, into one with all of them
    Merge {
        /// The FMUs
        #[arg(value_name = "FILE.fmu", required = true)]
        fmus: Vec<PathBuf>,
        /// Where the library for a platform was run, for the FMU's documentation
        #[arg(long = "ran", value_name = "PLATFORM=WHERE", value_parser = of_platform::<String>)]
        runs: Vec<(Platform, String)>,
        /// The file to write
        #[arg(long, short, value_name = "FILE.fmu")]
        out: PathBuf,
    },
    /// Show what an FMU is and which variables it has
    Info {
        /// An FMU of any maker
        #[arg(value_name = "FILE.fmu")]
        file: PathBuf,
    },
    /// Write an FMU's parameters, as they are by default, to a parameter set to be edited
    Parameters {
        /// An FMU of any maker
        #[arg(value_name = "FILE.fmu")]
        file: PathBuf,
        /// The file to write [default: <model identifier>.ssv]
        #[arg(long, value_name = "FILE.ssv")]
        out: Option<PathBuf>,
    },
    /// Tell whether an FMU can take the plant's or the controller's place
    ///
    /// Exits with 0 when it can, with 1 when it cannot and with 2 on an error
    Check {
        /// An FMU of any maker
        #[arg(value_name = "FILE.fmu")]
        file: PathBuf,
        /// The place
        #[arg(long = "as", value_name = "PLACE")]
        role: Role,
        /// Which of its variables are those of the interface, and their units
        #[arg(long, value_name = "FILE.json")]
        map: Option<PathBuf>,
        /// Write a map to be edited, with the names that may be meant
        #[arg(long, value_name = "FILE.json")]
        write_map: Option<PathBuf>,
    },
    /// Write the coupled system of any plant and any controller
    Ssp {
        /// The plant
        #[arg(long, value_name = "FILE.fmu")]
        plant: PathBuf,
        /// The controller
        #[arg(long, value_name = "FILE.fmu")]
        controller: PathBuf,
        /// Maps for FMUs with other names and units, as `check --write-map` writes them
        #[arg(long, value_name = "FILE.json")]
        map: Vec<PathBuf>,
        /// Parameter sets that are bound to the FMU that has their parameters
        #[arg(long, value_name = "FILE.ssv")]
        parameters: Vec<PathBuf>,
        /// The file to write [default: Boost.ssp]
        #[arg(long, value_name = "FILE.ssp")]
        out: Option<PathBuf>,
    },
}

/// Does what the command line asks for. Whether the answer is yes, where it is a question.
pub fn run() -> Result<bool> {
    match Arguments::parse().command {
        Command::Export { models, out, parameters, targets, binaries } => {
            export::run(&models, out, &parameters, &targets, &binaries).map(|()| true)
        }
        Command::Merge { fmus, runs, out } => merge::run(&fmus, &runs, &out).map(|()| true),
        Command::Info { file } => info::run(&file).map(|()| true),
        Command::Parameters { file, out } => parameters::run(&file, out.as_deref()).map(|()| true),
        Command::Check { file, role, map, write_map } => {
            check::run(&file, role, map.as_deref(), write_map.as_deref())
        }
        Command::Ssp { plant, controller, map, parameters, out } => {
            ssp::run(&plant, &controller, &map, &parameters, out.as_deref()).map(|()| true)
        }
    }
}

/// Reads an argument for a platform: its folder, `=`, and the value.
fn of_platform<Value: From<String>>(text: &str) -> Result<(Platform, Value)> {
    let (folder, value) = text.split_once('=').context("there is no '=' in it")?;
    Ok((folder.parse()?, value.to_owned().into()))
}
