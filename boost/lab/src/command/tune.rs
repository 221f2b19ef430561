//! `tune`: tunes the controller's gain schedule to a plant; writes a parameter set and a report.

use std::path::PathBuf;
use std::sync::Arc;

use super::{HTML, JOURNAL, JSON};
use crate::interface::open;
use crate::study::case::Rig;
use crate::tune::comparison::{self, Compared};
use crate::tune::{Procedure, Schedule, Strategy, Task, TuningJournal, TuningPart, dcm, html, json, rest};
use anyhow::{Context, Result};
use boost_interface::Role;
use clap::Args;
use fmu_io::reading::digest;
use fmu_io::terminal::{complain, print};
use fmu_package::connection;
use fmu_run::workers::{self, Program, WorkerArguments, Workers};

/// The name of the parameter set.
const SET: &str = "schedule";
/// The files in the folder of results.
const SET_FILE: &str = "schedule.ssv";
const DCM_FILE: &str = "schedule.dcm";

#[derive(Args)]
pub struct Arguments {
    /// The plant
    #[arg(long, value_name = "FILE.fmu")]
    plant: PathBuf,
    /// Connections for a plant with other names or units, written by `boost-fmu check --write-connections`; may be given
    /// several times
    #[arg(long, value_name = "FILE.toml")]
    connections: Vec<PathBuf>,
    /// Plant parameters; may be given several times
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// The controller; its start values give grid and nominal voltage [default: this repository's], and runs with it the
    /// feedback's lambda of `split_range`, and a comparison of the loop before and after
    #[arg(long, value_name = "FILE.fmu")]
    controller: Option<PathBuf>,
    /// The strategy whose schedule is tuned
    #[arg(long, value_enum, default_value_t = Strategy::SplitRange)]
    strategy: Strategy,
    /// Engine speeds of the grid columns (rpm), ascending [default: the controller's]
    #[arg(long, value_name = "RPM,...", value_delimiter = ',', value_parser = super::positive())]
    engine_speeds: Option<Vec<f64>>,
    /// Boost references of the grid rows (Pa), ascending [default: the controller's]
    #[arg(long, value_name = "PA,...", value_delimiter = ',', value_parser = super::positive())]
    boost_references: Option<Vec<f64>>,
    /// Desired closed-loop time constant (s) [default: found with --controller, else the controller's]
    #[arg(long, value_name = "SECONDS", value_parser = super::positive())]
    lambda: Option<f64>,
    #[command(flatten)]
    workers: WorkerArguments,
    /// The folder for schedule.ssv, schedule.dcm, report.html and report.json, and for the journal from which an interrupted
    /// tuning resumes
    #[arg(long, value_name = "DIR", default_value = "target/tuning")]
    out: PathBuf,
}

/// Tunes, in processes of a program.
pub fn run(arguments: &Arguments, program: &Program) -> Result<()> {
    let out = &arguments.out;
    let outputs = [SET_FILE, DCM_FILE, HTML, JSON, JOURNAL].map(|name| out.join(name));
    let inputs = [&arguments.plant].into_iter().chain(&arguments.connections).chain(&arguments.controller);
    let inputs: Vec<_> = inputs.chain(&arguments.parameters).cloned().collect();
    super::refuse_overlap(out, &outputs, &inputs)?;
    let task = arguments.task()?;
    let (workers, identity) = Workers::open(program, &arguments.workers)?;
    super::make_folder(out)?;
    let journal = TuningJournal::open(&out.join(JOURNAL), &identity)?;
    let finished = journal.finished();
    let sweeps = finished.iter().filter(|part| matches!(part, TuningPart::Sweep(_))).count();
    let points = finished.len() - sweeps;
    if sweeps + points > 0 {
        print(&format!("resuming with {sweeps} sweeps and {points} points from the journal\n"))?;
    }

    let bar = super::progress_bar(whole(task.duration()), "{percent} %")?;
    let mut tuning = task.run(&journal, &workers, &|duration| bar.inc(whole(duration)))?;
    bar.finish_and_clear();
    drop(workers);
    let mut loop_to_run = None;
    if let Some(controller) = &arguments.controller {
        let rig = Rig::new(Arc::clone(&tuning.task.plant), fmu_run::open(controller)?, 0)?;
        let threads = super::threads(arguments.workers.number, [&*rig.plant, &*rig.controller]);
        if arguments.lambda.is_none() && arguments.strategy == Strategy::SplitRange {
            match rest::shortest_lambda(&rig, &tuning, threads)? {
                Some(lambda) => tuning.task.schedule.find_lambda(lambda),
                None => tuning.notes.push(
                    "no feedback_lambda was found with which a vacuum pump sustains noise at rest".to_owned(),
                ),
            }
        }
        loop_to_run = Some((rig, threads));
    }
    let set = tuning.parameter_set(SET);
    super::write(out, [(SET_FILE, set.to_xml()), (DCM_FILE, dcm(&set, &tuning.task.schedule))])?;
    if let Some((rig, threads)) = loop_to_run {
        match comparison::compare(&rig, &tuning, &out.join(SET_FILE), threads) {
            Ok(compared) => tuning.comparison = compared,
            Err(error) => tuning.notes.push(format!("the loop was not run before and after: {error:#}")),
        }
    }
    for note in &tuning.notes {
        complain(&format!("note: {note}"));
    }
    super::write(out, [(HTML, html(&tuning)), (JSON, json(&tuning)?)])?;
    for Compared { experiment, measure, unit, before, after } in &tuning.comparison {
        print(&format!("{experiment}: {measure} {before:.2} {unit} before, {after:.2} {unit} after\n"))?;
    }
    let [identified, others] = tuning.counts();
    Ok(print(&format!("{identified} of {} points identified; {others}\n", tuning.cells.len()))?)
}

/// Works for [`run()`] in another process.
pub fn work(arguments: &Arguments) -> Result<()> {
    let prepare = || {
        let task = arguments.task()?;
        let identity = task.identity(digest(&arguments.plant)?);
        Ok((task, identity))
    };
    workers::work(prepare, Task::work, |_, part| Ok(part))
}

impl Arguments {
    fn task(&self) -> Result<Task> {
        let schedule = match &self.controller {
            Some(path) => Schedule::read(fmu_run::open(path)?.description(), self.strategy)
                .with_context(|| format!("{} cannot be tuned", path.display()))?,
            None => Schedule::built_in(self.strategy)?,
        };
        let connections = connection::read_all(&self.connections)?;
        let procedure = schedule.allocation.as_ref().map_or_else(Procedure::default, |allocation| {
            Procedure::split_range(allocation.parameters.low_pressure_open())
        });
        Ok(Task {
            plant_parameters: super::parameter_sets(&self.parameters)?,
            schedule: schedule.with(
                self.engine_speeds.clone(),
                self.boost_references.clone(),
                self.lambda,
            )?,
            plant: open(&self.plant, Role::Plant, &connections)?,
            connections,
            procedure,
        })
    }
}

/// Whole seconds.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // durations are positive and short
fn whole(seconds: f64) -> u64 {
    seconds.round() as u64
}
