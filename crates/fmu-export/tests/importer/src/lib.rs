//! An importer that breaks the rules: it calls the C functions of an exported FMU's library in any order, with any
//! arguments. The exporter's table for each version of FMI has the functions and their arguments; the states that they are
//! allowed in are [listed](functions) here, from the standards' text, independent of the exporter.
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
