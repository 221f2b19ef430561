//! `boost-lab`: the laboratory's command.

mod command;

use std::process::ExitCode;

/// What the process ends with when it could not do what it was asked for; clap does so, too.
const FAILED: u8 = 2;

fn main() -> ExitCode {
    match command::run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            FAILED.into()
        }
    }
}
