//! The commands, of which each that runs FMUs does so in another process, as an FMU may end its own.

use std::ffi::OsString;

use anyhow::Result;
use clap::Subcommand;
use fmu_io::exit::FAILED;
use fmu_io::terminal::complain;

use crate::compare::Compare;
use crate::experiment::TrialExport;
use crate::linearize::Linearize;
use crate::simulate::Simulate;
use crate::sweep::Sweep;
use crate::workers::{Program, supervised, work_once};

/// A command that runs FMUs, or compares their records.
#[derive(Subcommand, Debug)]
#[expect(missing_docs, reason = "those of a variant would replace those of its type in the help")]
pub enum Command {
    #[command(after_help = "\
Examples:
  cargo fmu simulate --plot ball.html                   # exports the model of this folder, and runs it
  cargo fmu simulate decay.fmu --set k=2 --out decay.csv
  cargo fmu simulate motor.fmu --input voltage.csv --stop-time 1 --plot motor.svg")]
    Simulate(Box<Simulate>),
    #[command(after_help = "\
Example:
  cargo fmu compare decay.csv reference.csv --plot decay.html")]
    Compare(Compare),
    #[command(after_help = "\
Examples:
  cargo fmu linearize motor.fmu --path voltage,speed --plot motor.html
  cargo fmu linearize loop.toml --at 20 --loop controller:speed --plot loop.html --out loop.json")]
    Linearize(Box<Linearize>),
    #[command(after_help = "\
Example:
  cargo fmu sweep study.toml --out target/study")]
    Sweep(Sweep),
}

impl Command {
    /// Runs it. `arguments` are those of the process, which works for another one if it [was told
    /// to](crate::workers::told_to_work). Returns whether no run failed.
    ///
    /// # Errors
    /// When it cannot be run.
    pub fn run(self, is_worker: bool, arguments: &[OsString], export: TrialExport<'_>) -> Result<bool> {
        let worker = || Program::this(arguments);
        let in_worker = |run: &dyn Fn() -> Result<()>| {
            if is_worker { work_once(run) } else { supervised(&worker()?) }
        };
        match self {
            Self::Sweep(sweep) if is_worker => sweep.work(),
            Self::Sweep(sweep) => return sweep.run(&worker()?),
            Self::Simulate(simulate) => in_worker(&|| simulate.run(export)),
            Self::Linearize(linearize) => in_worker(&|| linearize.run(export)),
            Self::Compare(compare) => compare.run(),
        }
        .map(|()| true)
    }
}

/// If an FMU ends the process, the exit status is an error, and the FMU is named.
pub fn fail_when_an_fmu_exits() {
    fmu_master::when_an_fmu_exits(|culprit| {
        complain(&format!("error: {culprit}"));
        FAILED.into()
    });
}
