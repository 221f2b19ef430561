//! `cargo fmu`: creates, exports and looks into FMUs.

use std::process::ExitCode;

fn main() -> ExitCode {
    cargo_fmu::main()
}
