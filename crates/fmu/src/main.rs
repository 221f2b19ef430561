//! `fmu`: the commands of `cargo fmu`, in a package for Python.

use std::process::ExitCode;

fn main() -> ExitCode {
    cargo_fmu::main()
}
