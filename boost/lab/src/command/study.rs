//! `study`: random plants, ambient conditions and manoeuvres, to results.csv and a report.

use std::path::PathBuf;

use super::{HTML, JOURNAL, JSON};
use crate::interface::open;
use crate::study::case::Rig;
use crate::study::draw::Cases;
use crate::study::{Study, StudyReport, csv, outside};
use anyhow::Result;
use boost_interface::Role;
use cargo_fmu::run::journal::{Journal, Settings, digest};
use cargo_fmu::run::workers::{self, Program, WorkerArguments, Workers};
use clap::Args;
use fmu_io::terminal::{complain, print};
use fmu_io::writing;
use fmu_master::Fmu;
use fmu_package::{FmuVariable, ParameterSet, connection};

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
    let (study, _) = arguments.study()?;
    for note in &study.cases.notes {
        complain(&format!("note: {note}"));
    }
    let (workers, settings) = Workers::open(program, &arguments.workers)?;
    super::make_folder(out)?;
    let journal = Journal::open(&out.join(JOURNAL), &settings)?;
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
    let threads = super::threads(arguments.workers.number, [&*study.rig.plant, &study.rig.controller])?;
    let bar = super::progress_bar(outside(&outcomes).len() as u64, "{pos} of {len} cases explained")?;
    let explained = study.explain(&outcomes, &threads, || bar.inc(1))?;
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
    workers::work(|| arguments.study(), |study, number| Ok(study.run_one(number)))
}

impl Arguments {
    /// The study, and everything its results depend on.
    fn study(&self) -> Result<(Study, Settings)> {
        let connections = connection::read_all(&self.connections)?;
        let plant = open(&self.plant, Role::Plant, &connections)?;
        let controller = open(&self.controller, Role::Controller, &connections)?;
        let (mut of_plant, mut of_controller) = (vec![], vec![]);
        for file in &self.parameters {
            let set = ParameterSet::read(file)?;
            let belongs_to = |fmu: &Fmu| {
                let is_known =
                    |name: &str| fmu.description().variable(name).is_some_and(FmuVariable::is_settable);
                set.parameters.iter().any(|parameter| is_known(&parameter.name))
            };
            match (belongs_to(&plant), belongs_to(&controller)) {
                (false, true) => of_controller.push(file.clone()),
                (true, true) => anyhow::bail!(
                    "{}: has parameters of both plant and controller; a set is drawn for the plant or applied to the controller, so write two",
                    file.display()
                ),
                (_, false) => of_plant.push(file.clone()),
            }
        }
        let sets = super::plants(&of_plant)?;

        let mut settings = Settings::new();
        for (name, file) in [("plant", &self.plant), ("controller", &self.controller)] {
            settings.insert(format!("SHA-256 of the {name}'s file"), digest(file)?);
        }
        settings.insert("connections".into(), connection::in_line(&connections));
        for (index, set) in sets.iter().enumerate() {
            settings.insert(format!("parameter set {}", index + 1), format!("{set:?}"));
        }
        for (index, file) in of_controller.iter().enumerate() {
            settings.insert(
                format!("the controller's parameter set {}", index + 1),
                format!("{:?}", ParameterSet::read(file)?),
            );
        }
        settings.insert("cases".into(), self.cases.to_string());
        settings.insert("seed".into(), self.seed.to_string());
        settings.insert("strategies".into(), format!("{:?}, {:?}", self.strategy, self.beside));

        let mut rig = Rig::new(plant, controller, self.seed)?;
        rig.controller_sets = of_controller;
        let cases = Cases::draw(rig.plant.description(), &sets, self.cases as usize, self.seed)?;
        let strategies = [self.strategy.clone()].into_iter().chain(self.beside.clone().map(Some));
        Ok((Study { rig, cases, strategies: strategies.collect() }, settings))
    }
}
