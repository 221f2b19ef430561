//! An importer that breaks the rules: it calls the C functions of an exported FMU's library in any order, with any
//! arguments. The exporter's table for each version of FMI has the functions and their arguments; the states that they are
//! allowed in are [listed](functions) here, from the standards' text, independent of the exporter.
//!
//! It alone tries every function in every state, with each argument wrong in turn, and calls at random: it finds that one is
//! allowed where it must not be, that an error changes something, or that a saved state goes on differently. It does not know
//! what a model computes. Tests of that, and of what needs FMPy, callbacks, threads or another process, are in Python
//! (tests/fmu/exporter).
//!
//! `bash tests/run` exports the test models and tests them; `FMUS` is the folder of others, such as those with compiled
//! sources:
//!
//! ```sh
//! FMUS=target/compiled cargo test --package fmu-importer -- --ignored
//! ```

#![allow(
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    reason = "it is a test, which panics at what is wrong"
)]

pub mod arguments;
pub mod functions;
pub mod instance;

pub use arguments::{Argument, Whim};
pub use functions::{Function, Kind};
pub use instance::{Fmu, Instance, State, Status};
