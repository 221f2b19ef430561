//! `boost-lab`: the laboratory's command.

mod command;

use std::process::ExitCode;

use fmu_package::{temporary, terminal};

/// What the process ends with when it could not do what it was asked for; clap does so, too.
const FAILED: u8 = 2;

fn main() -> ExitCode {
    temporary::remove_when_interrupted();
    match command::run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            terminal::complain(&format!("error: {error:#}"));
            FAILED.into()
        }
    }
}
