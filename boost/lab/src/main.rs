//! `boost-lab`, the laboratory: drives FMUs through the experiments of boost control.
//!
//! - [`interface`] opens FMUs in the names and units of the interface.
//! - [`identify`] identifies the plant's actuator from measured data.
//! - [`study`] judges a controller on random plants, ambient conditions and manoeuvres.
//! - [`reproduce`] compares the results with the paper, figure by figure.
//! - [`tune`] tunes the controller to a plant.
//! - [`live`] writes a page that runs both FMUs in a browser.
//! - [`command`] is the command line.
//!
//! [`fmu_master`] runs the FMUs, [`fmu_plot`] draws their records, and [`fmu_run`] has what the commands share.
#![deny(unsafe_code)]

mod command;
mod identify;
mod interface;
mod live;
mod reproduce;
mod study;
mod tune;

use std::process::ExitCode;

fn main() -> ExitCode {
    fmu_run::fail_when_an_fmu_exits();
    fmu_io::exit::exit_with(command::run)
}
