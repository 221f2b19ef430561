//! `study`: random plants, ambient conditions and manoeuvres, to results.csv and a report.

use std::path::PathBuf;

use super::{HTML, JOURNAL, JSON};
use crate::interface::open;
use crate::study::case::Rig;
use crate::study::draw::{Cases, known_plants};
use crate::study::situation::Situation;
use crate::study::{Study, StudyReport, csv};
use anyhow::Result;
use boost_interface::Role;
use clap::Args;
use fmu_io::reading::digest;
use fmu_io::terminal::{complain, print};
use fmu_io::writing;
use fmu_master::Fmu;
use fmu_package::{FmuVariable, ParameterSet, connection};
use fmu_run::journal::{Identity, Journal};
use fmu_run::workers::{self, Program, WorkerArguments, Workers};

const CSV: &str = "results.csv";

#[derive(Args)]
pub struct Arguments {
    /// The plant
    #[arg(long, value_name = "FILE.fmu", default_value = "target/fmu/BoostPlant.fmu")]
    plant: PathBuf,
    /// The controller
    #[arg(long, value_name = "FILE.fmu", default_value = "target/fmu/BoostController.fmu")]
    controller: PathBuf,
    /// Connections for FMUs with other names or units, written by `boost-fmu check --write-connections`; may be given
    /// several times
    #[arg(long, value_name = "FILE.toml")]
    connections: Vec<PathBuf>,
    /// Parameters of a plant: values are drawn between the FMU's and those of each set; may be given several times
    /// [default: those in this repository's parameters/]. A set of the controller's parameters applies to all cases
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// What the cases go through
    #[arg(long, value_name = "NAME", default_value = "ramps")]
    situation: Situation,
    /// The controller's strategy [default: its start value]
    #[arg(long, value_name = "NAME")]
    strategy: Option<String>,
    /// Another strategy to run on the same cases for comparison
    #[arg(long, value_name = "NAME")]
    beside: Option<String>,
    /// Number of cases
    #[arg(long, value_name = "NUMBER", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    cases: u32,
    /// Random seed; equal seeds draw equal cases
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    workers: WorkerArguments,
    /// The folder for results.csv, report.html and report.json, and for the journal from which an interrupted study
    /// resumes
    #[arg(long, value_name = "DIR", default_value = "target/study")]
    out: PathBuf,
}

/// Runs or resumes the study, in processes of a program. Returns whether all criteria are met.
pub fn run(arguments: &Arguments, program: &Program) -> Result<bool> {
    let out = &arguments.out;
    let outputs = [CSV, HTML, JSON, JOURNAL].map(|name| out.join(name));
    let inputs = [&arguments.plant, &arguments.controller].into_iter().chain(&arguments.connections);
    let inputs: Vec<_> = inputs.chain(&arguments.parameters).cloned().collect();
    super::refuse_overlap(out, &outputs, &inputs)?;
    let study = arguments.study()?;
    for note in &study.cases.notes {
        complain(&format!("note: {note}"));
    }
    let (workers, identity) = Workers::open(program, &arguments.workers)?;
    super::make_folder(out)?;
    let journal = Journal::open(&out.join(JOURNAL), &identity)?;
    let finished = journal.finished().len();
    if finished > 0 {
        print(&format!("{finished} of {} cases are in the journal\n", study.cases.len()))?;
    }
    let bar =
        super::progress_bar(study.cases.len() as u64, "{pos} of {len} cases")?.with_position(finished as u64);
    let outcomes = study.run(&journal, &workers, || bar.inc(1))?;
    bar.finish_and_clear();
    drop(workers);
    for outcome in &outcomes {
        if let Some(error) = &outcome.runs[0].error {
            complain(&format!("case {}: {error}", outcome.case));
        }
    }
    let threads = super::threads(arguments.workers.number, [&*study.rig.plant, &study.rig.controller]);
    let bar = super::progress_bar(study.outside(&outcomes).len() as u64, "{pos} of {len} cases explained")?;
    let explained = study.explain(&outcomes, threads, || bar.inc(1))?;
    bar.finish_and_clear();

    let report = StudyReport { study: &study, outcomes: &outcomes, explained: &explained };
    writing::write(&out.join(CSV), |writer| csv(&report, writer))?;
    print(&format!("{}\n", out.join(CSV).display()))?;
    super::write(out, [(HTML, report.html()), (JSON, report.json()?)])?;
    print(&report.text())?;
    Ok(report.passes())
}

/// Works for [`run`] in another process.
pub fn work(arguments: &Arguments) -> Result<()> {
    let prepare = || Ok((arguments.study()?, arguments.identity()?));
    workers::work(prepare, |study, number| Ok(study.run_one(number)), |_, outcome| Ok(outcome))
}

impl Arguments {
    fn study(&self) -> Result<Study> {
        let connections = connection::read_all(&self.connections)?;
        let plant = open(&self.plant, Role::Plant, &connections)?;
        let controller = open(&self.controller, Role::Controller, &connections)?;
        let (of_plant, of_controller) = self.sets(&plant, &controller)?;
        let sets = if of_plant.is_empty() { known_plants()? } else { of_plant };
        let mut rig = Rig::new(plant, controller, self.seed)?;
        rig.controller_sets = of_controller;
        let cases =
            Cases::draw(self.situation, rig.plant.description(), &sets, self.cases as usize, self.seed)?;
        let strategies = [self.strategy.clone()].into_iter().chain(self.beside.clone().map(Some));
        Ok(Study { rig, cases, strategies: strategies.collect() })
    }

    /// The parameter sets of the plant, and the files of those of the controller.
    fn sets(&self, plant: &Fmu, controller: &Fmu) -> Result<(Vec<ParameterSet>, Vec<PathBuf>)> {
        let (mut of_plant, mut of_controller) = (vec![], vec![]);
        for file in &self.parameters {
            let set = ParameterSet::read(file)?;
            let [is_plants, is_controllers] = [plant, controller].map(|fmu| {
                let is_known =
                    |name: &str| fmu.description().variable(name).is_some_and(FmuVariable::is_settable);
                set.parameters.iter().any(|parameter| is_known(&parameter.name))
            });
            if is_plants && is_controllers {
                anyhow::bail!(
                    "{}: has parameters of both plant and controller; plants are drawn, the controller's parameters \
                     apply to all cases: write two sets",
                    file.display()
                );
            }
            if is_controllers {
                // A case is the text of a scenario, which may be run from anywhere.
                of_controller.push(std::path::absolute(file)?);
            } else {
                of_plant.push(set);
            }
        }
        Ok((of_plant, of_controller))
    }

    /// Everything that the results depend on. Taken apart without `..`, so that a new argument does not compile until it is
    /// decided.
    fn identity(&self) -> Result<Identity> {
        let Self {
            plant,
            controller,
            connections,
            parameters,
            situation,
            strategy,
            beside,
            cases,
            seed,
            workers: _,
            out: _,
        } = self;
        let sets = super::plants(parameters)?;
        let sets = sets
            .iter()
            .enumerate()
            .map(|(index, set)| (format!("parameter set {}", index + 1), format!("{set:?}")));
        let others = [
            ("boost-lab's version", env!("CARGO_PKG_VERSION").to_owned()),
            ("SHA-256 of the plant's file", digest(plant)?),
            ("SHA-256 of the controller's file", digest(controller)?),
            ("connections", connection::in_line(&connection::read_all(connections)?)),
            ("situation", format!("{situation:?}")),
            ("strategy", format!("{strategy:?}")),
            ("strategy beside it", format!("{beside:?}")),
            ("cases", cases.to_string()),
            ("seed", seed.to_string()),
        ];
        Ok(sets.chain(others.map(|(name, value)| (name.to_owned(), value))).collect())
    }
}
