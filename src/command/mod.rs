//! The command line: what it takes, and which room does the work.

mod check;
mod coupling;
mod export;
mod fmu;
mod info;
mod parameters;
mod ssp;

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};

use self::coupling::Role;

/// Exports the plant and the controller of the boost control as FMI 2.0 co-simulation FMUs, and couples them
/// with FMUs of other makers.
#[derive(Parser)]
#[command(name = "boost-fmu", version, arg_required_else_help = true)]
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
    /// Exits with 0 when it can, with 1 when it cannot and with 2 when there is no telling.
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
        Command::Export { models, out, parameters } => export::run(&models, out, &parameters).map(|()| true),
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

/// Prints a text. Whoever reads it may stop before its end, as `head` does.
fn print(text: &str) -> Result<()> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot print"),
    }
}

/// Writes a file that its user will edit: one that is there is kept.
fn write_new(path: &Path, content: &[u8]) -> Result<()> {
    let shown = path.display();
    let mut file = match OpenOptions::new().write(true).create_new(true).open(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            bail!("{shown} is there already; remove it, or name another file")
        }
        other => other.with_context(|| format!("cannot write {shown}"))?,
    };
    file.write_all(content).with_context(|| format!("cannot write {shown}"))
}
