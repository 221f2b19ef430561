//! The laboratory: drives FMUs through the experiments of boost control.
//!
//! - [`importer`] drives FMUs of any maker; nothing else knows how they are called.
//! - [`scenario`] reads experiments from TOML files.
//! - [`mapping`] gives FMUs the names and units of the interface.
//! - [`master`] couples FMUs by equal names and steps them through a scenario.
//! - [`record`] is what comes of it.
//! - [`plot`] draws it as SVG.
//! - [`journal`] keeps what a long task has finished.
//! - [`identify`] finds parameters of the plant's actuator in measured data.
//! - [`sweep`] runs a scenario for many values of parameters.
//! - [`reproduce`] holds the paper against it, figure by figure.
//! - [`tune`] tunes the controller to a plant.
#![deny(unsafe_code)]

pub mod identify;
pub mod importer;
pub mod journal;
pub mod mapping;
pub mod master;
mod measure;
mod page;
pub mod plot;
pub mod record;
pub mod reproduce;
pub mod scenario;
pub mod sweep;
pub mod tune;
