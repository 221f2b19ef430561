//! The program that works, and how many of its processes there are.

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use crate::number_in;

/// The hidden subcommand, which no help or completion shows.
const WORKER: &str = "worker";

/// The program that works: this one, or that of a library's caller.
#[derive(Clone, Debug)]
pub struct Program {
    /// The program.
    pub path: PathBuf,
    /// The arguments with which the program works, instead of running the command.
    pub arguments: Vec<OsString>,
}

impl Program {
    /// This program, told to work by arguments that [`told_to_work`] recognizes; `arguments` begin with its name.
    ///
    /// # Errors
    /// When the system does not tell which program this is.
    pub fn this(arguments: &[OsString]) -> Result<Self> {
        let path = env::current_exe().context("cannot find this program")?;
        let arguments = [&[WORKER.into()], arguments.get(1..).unwrap_or_default()].concat();
        Ok(Self { path, arguments })
    }
}

/// Whether the arguments of a program, which begin with its name, tell it to work; and those that say what.
#[must_use]
pub fn told_to_work(mut arguments: Vec<OsString>) -> (bool, Vec<OsString>) {
    let is_told = arguments.get(1).is_some_and(|word| word == WORKER);
    if is_told {
        arguments.remove(1);
    }
    (is_told, arguments)
}

/// How many workers there are, and how long they may take.
#[derive(Args, Debug)]
#[group(skip)]
pub struct WorkerArguments {
    /// Number of processes that run FMUs [default: one per core]
    #[arg(long = "workers", value_name = "NUMBER", alias = "threads", value_parser = clap::value_parser!(u16).range(1..))]
    pub number: Option<u16>,
    /// Longest time of a run on the clock (s); one that takes longer has failed
    #[arg(long, value_name = "SECONDS", default_value_t = 3600.0, value_parser = number_in(1e-3..=1e9, "a time from 0.001 to 1e9 s"))]
    pub time_limit: f64,
}
