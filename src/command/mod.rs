//! The command line: what it takes, and which module does it.

mod check;
mod coupling;
mod export;
mod ssp;

use std::path::PathBuf;

use anyhow::Result;
use boost_interface::Role;
use cargo_fmu::{Info, Merge, Parameters};
use clap::{Parser, Subcommand};

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
        #[command(flatten)]
        export: cargo_fmu::Export,
        /// Parameter sets that Boost.ssp binds to the FMU that has their parameters
        #[arg(long, value_name = "FILE.ssv")]
        parameters: Vec<PathBuf>,
    },
    Merge(Merge),
    Info(Info),
    Parameters(Parameters),
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
        Command::Export { export, parameters } => export::run(export, &parameters).map(|()| true),
        Command::Merge(merge) => merge.run().map(|()| true),
        Command::Info(info) => info.run().map(|()| true),
        Command::Parameters(parameters) => parameters.run().map(|()| true),
        Command::Check { file, role, map, write_map } => {
            check::run(&file, role, map.as_deref(), write_map.as_deref())
        }
        Command::Ssp { plant, controller, map, parameters, out } => {
            ssp::run(&plant, &controller, &map, &parameters, out.as_deref()).map(|()| true)
        }
    }
}
