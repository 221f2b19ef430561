//! `cargo fmu`: exports the models of a workspace, and looks into FMUs of any maker.
//!
//! # As a library
//!
//! The commands of `cargo fmu` are here for other commands that offer them too: each is a type whose fields
//! clap fills from the command line.

mod compile;
mod export;
mod info;
mod licenses;
mod merge;
mod parameters;
mod target;
mod validate;

use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use fmu_package::{Platform, temporary, terminal};

pub use export::{Export, Plan};
pub use info::Info;
pub use merge::Merge;
pub use parameters::Parameters;
pub use validate::Validate;

/// What the process ends with when it could not do what it was asked for; clap does so, too.
const FAILED: u8 = 2;

/// The arguments of `cargo fmu`, with the `fmu` that cargo passes on.
#[derive(Parser)]
#[command(name = "cargo", bin_name = "cargo")]
enum Cargo {
    #[command(name = "fmu", version, about, arg_required_else_help = true, subcommand)]
    Fmu(Command),
}

#[derive(Subcommand)]
enum Command {
    /// Compile the models of this workspace and write their .fmu files
    Export(Export),
    Merge(Merge),
    Info(Info),
    Validate(Validate),
    Parameters(Parameters),
}

/// Runs `cargo fmu` with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    exit_with(|| {
        let Cargo::Fmu(command) = Cargo::parse();
        match command {
            Command::Export(export) => export.plan()?.run(&[], &[]),
            Command::Merge(merge) => merge.run(),
            Command::Info(info) => info.run(),
            Command::Validate(validate) => return validate.run(),
            Command::Parameters(parameters) => parameters.run(),
        }
        .map(|()| true)
    })
}

/// Runs a command and gives the process's exit status: 0 and 1 for yes and no, 2 for an error, which is printed.
/// Temporary files are removed when the process is interrupted.
pub fn exit_with(command: impl FnOnce() -> Result<bool>) -> ExitCode {
    temporary::remove_when_interrupted();
    match command() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            terminal::complain(&format!("error: {error:#}"));
            FAILED.into()
        }
    }
}

/// Reads an argument for a platform: its folder, `=`, and the value.
fn of_platform<Value: From<String>>(text: &str) -> Result<(Platform, Value)> {
    let (folder, value) = text.split_once('=').context("there is no '=' in it")?;
    Ok((folder.parse()?, value.to_owned().into()))
}
