//! Loads FMUs from any tool (FMI 2.0 and 3.0, Co-Simulation or Model Exchange), steps one of them or a coupled system,
//! and records the results.
//!
//! An [`Fmu`] is loaded once and creates [`Instance`]s, whose variables are read and set by name:
//!
//! ```standalone_crate
//! use fmu_master::Fmu;
//!
//! # mod careless { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/careless/mod.rs")); }
//! # const BALL: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/careless/exchange.xml"));
//! # fn main() -> anyhow::Result<()> {
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # careless::write("ball.fmu".as_ref(), BALL, &careless::compiled("exchange.c"));
//! let fmu = Fmu::open("ball.fmu")?;
//! let mut ball = fmu.instantiate("ball")?;
//! ball.set("e", 0.7)?;
//! ball.initialize(0.0, Some(1.0))?;
//! for step in 0..100 {
//!     ball.step(0.01 * f64::from(step), 0.01)?;
//!     println!("{}", ball.get("h")?);
//! }
//! # assert!(ball.get("h")?.abs() < 1.0);
//! # Ok(())
//! # }
//! ```
//!
//! A [`Master`] runs a [`Scenario`](scenario::Scenario), which couples FMUs by connections or by the names of their
//! variables, converts units, drives inputs with signals and returns a [`Record`](fmu_record::Record). Scenarios are TOML files; [`system`]
//! creates them for one FMU or an SSP package.
//!
//! ```standalone_crate
//! use fmu_master::system::{self, Times};
//! use fmu_master::{LoadedFmus, Master};
//!
//! # mod careless { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/careless/mod.rs")); }
//! # const BALL: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/careless/exchange.xml"));
//! # fn main() -> anyhow::Result<()> {
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # careless::write("ball.fmu".as_ref(), BALL, &careless::compiled("exchange.c"));
//! let times = Times { stop: Some(1.0), step: Some(0.01), ..Times::default() };
//! let mut fmus = LoadedFmus::default();
//! let scenario = system::alone("ball.fmu".as_ref(), times, &mut fmus)?;
//! let run = Master::new(&scenario, &mut fmus)?.run(|_, _| ())?;
//! let highest = run.record.get("h")?.iter().copied().fold(f64::MIN, f64::max);
//! assert_eq!(highest, 1.0);
//! # Ok(())
//! # }
//! ```
//!
//! Errors are [`anyhow::Error`]s whose messages name the file, the line or the variable. Where an FMU failed, the error
//! is a [`CallFailed`]: the C function, the time, the status and the FMU's own messages. It downcasts to that, except
//! where a scenario's [`Location`](scenario::Location) precedes it.
//!
//! FMUs are native code in this process, so an FMU that crashes ends the process. [`when_an_fmu_exits`] reports a call
//! of `exit` by an FMU; [`process`] has what a program needs that runs FMUs in processes of their own.

#[cfg(test)]
#[path = "../tests/careless/mod.rs"]
mod careless;
mod columns;
mod coupling;
mod importer;
mod links;
mod master;
pub mod measure;
mod noise;
mod recorder;
pub mod scenario;
pub mod system;

pub use columns::column_of;
pub use importer::*;
pub use links::{Link, links};
pub use master::{LoadedFmus, Master, Run};
