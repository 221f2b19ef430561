//! `boost-lab`, the laboratory: drives FMUs through the experiments of boost control.
//!
//! - [`importer`] alone calls FMUs, from any maker.
//! - [`scenario`] reads experiments from TOML files.
//! - [`mapping`] gives FMUs the names and units of the interface.
//! - [`master`] couples FMUs by equal names and steps them through a scenario.
//! - [`record`] holds the results, [`table`] writes them.
//! - [`system`] reads an .ssp or a single FMU as a scenario.
//! - [`plot`] draws figures, [`panels`] selects what they show.
//! - [`numbers`] formats numbers for readers.
//! - [`journal`] keeps the finished parts of a long task.
//! - [`identify`] identifies the plant's actuator from measured data.
//! - [`compare`] compares records.
//! - [`study`] judges a controller on random plants, ambient conditions and manoeuvres.
//! - [`sweep`] runs a scenario for many parameter values.
//! - [`reproduce`] compares the results with the paper, figure by figure.
//! - [`tune`] tunes the controller to a plant.
//! - [`live`] writes a page that runs both FMUs in a browser.
//! - [`command`] is the command line.
#![deny(unsafe_code)]

mod command;
mod identify;
mod live;
mod mapping;
mod reproduce;
mod study;
mod tune;

use std::process::ExitCode;

use fmu_package::{temporary, terminal};

/// The exit status of a failed command, the same as clap's.
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
