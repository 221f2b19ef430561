//! `cargo fmu`: creates, exports and inspects FMUs.

use std::process::ExitCode;

fn main() -> ExitCode {
    cargo_fmu::main()
}
