//! Command-line arguments, and a module for each command.

mod check;
mod coupling;
mod export;
mod ssp;

use std::path::PathBuf;

use anyhow::Result;
use boost_interface::{Interface, Role};
use clap::{Parser, Subcommand};

/// The exit statuses, for the help.
const EXIT_STATUSES: &str = "\
Exit status:
  0    success; `check`: the FMU fits
  1    `check`: the FMU does not fit
  2    failure or wrong command line; see standard error
  130  interrupted";

/// Exports the boost control plant and controller as FMI 2.0 co-simulation FMUs, and couples them with FMUs from other
/// tools.
#[derive(Parser)]
#[command(name = "boost-fmu", version, arg_required_else_help = true, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compile the models and write their .fmu files, and Boost.ssp, the co-simulation system of both
    Export {
        #[command(flatten)]
        export: cargo_fmu::Export,
        /// Parameter sets, each bound in Boost.ssp to the FMU that has its parameters
        #[arg(long, value_name = "FILE.ssv", conflicts_with = "wasm")]
        parameters: Vec<PathBuf>,
    },
    /// Check whether an FMU can replace the plant or the controller
    ///
    /// Exits with 0 if it can, 1 if it cannot, and 2 on an error
    Check {
        /// An FMU from any tool
        #[arg(value_name = "FILE.fmu")]
        file: PathBuf,
        /// The role to check
        #[arg(long = "as", value_name = "PLACE")]
        role: Role,
        /// Connections of the system, for an FMU with other names or units; may be given several times
        #[arg(long, value_name = "FILE.toml")]
        connections: Vec<PathBuf>,
        /// Write all connections to edit, with suggested names
        #[arg(long, alias = "write-map", value_name = "FILE.toml")]
        write_connections: Option<PathBuf>,
    },
    /// Write the coupled system of any plant and any controller
    Ssp(ssp::Arguments),
}

/// Runs the command. Returns false when `check` finds that an FMU does not fit.
pub fn run() -> Result<bool> {
    let arguments = Arguments::parse();
    let [plant, controller] = boost_fmu::DESCRIPTIONS;
    let interface = &Interface::new(plant, controller)?;
    match arguments.command {
        Command::Export { export, parameters } => export::run(interface, export, &parameters).map(|()| true),
        Command::Check { file, role, connections, write_connections } => {
            check::run(interface, &file, role, &connections, write_connections.as_deref())
        }
        Command::Ssp(arguments) => ssp::run(interface, &arguments).map(|()| true),
    }
}
