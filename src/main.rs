//! `boost-fmu`: exports the FMUs, inspects any FMU and couples it.

mod command;

use std::process::ExitCode;

fn main() -> ExitCode {
    cargo_fmu::exit_with(command::run)
}
