//! The command line: what it takes, and which room does the work.

mod export;
mod info;

use std::path::PathBuf;

use anyhow::Result;
use clap::{Parser, Subcommand};

/// Exports the plant and the controller of the boost control as FMI 2.0 co-simulation FMUs.
#[derive(Parser)]
#[command(name = "boost-fmu", version, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compile the models and write their .fmu files
    Export {
        /// The models to export, `BoostPlant` or `BoostController`; all when none is named
        models: Vec<String>,
        /// The folder to write to [default: fmu in cargo's target folder]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Show what an FMU is and which variables it has
    Info {
        /// An FMU of any maker
        #[arg(value_name = "FILE.fmu")]
        file: PathBuf,
    },
}

/// Does what the command line asks for.
pub fn run() -> Result<()> {
    match Arguments::parse().command {
        Command::Export { models, out } => export::run(&models, out),
        Command::Info { file } => info::run(&file),
    }
}
