//! `boost-fmu`: exports the FMUs, and couples them with FMUs from other tools.

mod command;

use std::process::ExitCode;

fn main() -> ExitCode {
    fmu_io::exit::exit_with(command::run)
}
