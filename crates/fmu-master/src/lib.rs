//! Loads FMUs of any maker for co-simulation, FMI 2.0 and 3.0, steps one or a coupled system, and records.
//!
//! An [`Fmu`] is loaded once and creates [`Instance`]s, whose variables are read and set by name:
//!
//! ```no_run
//! use std::path::Path;
//!
//! use fmu_master::Fmu;
//! use fmu_package::Value;
//!
//! # fn main() -> anyhow::Result<()> {
//! let fmu = Fmu::open(Path::new("ball.fmu"))?;
//! let mut ball = fmu.instantiate("ball")?;
//! ball.set_up(0.0, Some(3.0))?;
//! ball.set_value("h", &Value::Real(2.0, Some("m".to_owned())))?;
//! ball.enter_initialization()?;
//! ball.exit_initialization()?;
//! for step in 0..300 {
//!     ball.step(0.01 * f64::from(step), 0.01)?;
//!     println!("{}", ball.number("h")?);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A [`Master`] runs a [`Scenario`](scenario::Scenario), which couples FMUs by the names of their variables, converts
//! units, drives inputs with signals and returns a [`Record`](fmu_record::Record). Scenarios are TOML files; [`system`]
//! creates them for one FMU or an SSP package.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use fmu_master::system::{self, Times};
//! use fmu_master::{LoadedFmus, Master};
//!
//! # fn main() -> anyhow::Result<()> {
//! let times = Times { stop: Some(3.0), step: Some(0.01), ..Times::default() };
//! let scenario = system::alone(Path::new("ball.fmu"), times)?;
//! let run = Master::new(&scenario, &mut LoadedFmus::default())?.run(|_| ())?;
//! let highest = run.record.get("h")?.iter().copied().fold(f64::MIN, f64::max);
//! # Ok(())
//! # }
//! ```
//!
//! Errors are [`anyhow::Error`]s whose messages name the file, the line or the variable. Where an FMU failed, the error
//! is a [`CallFailed`]: the C function, the time, the status and the FMU's own messages. It downcasts to that, except
//! where a scenario's [`Location`](scenario::Location) precedes it.
//!
//! FMUs are native code in this process: one that crashes ends it.

mod importer;
mod master;
pub mod measure;
mod name_map;
pub mod scenario;
pub mod system;

pub use importer::*;
pub use master::{LoadedFmus, Master, Run};
pub use name_map::{NameMap, ReadMap};
