//! The end of a process.

use std::process::ExitCode;

use anyhow::Result;

use crate::{temporary, terminal};

/// The exit status on failure, as in clap.
pub const FAILED: u8 = 2;

/// Runs a command and returns the process's exit status: 0 and 1 for yes and no, 2 for an error, which is printed.
/// Removes temporary files when the process is interrupted.
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
