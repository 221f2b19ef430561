//! `sweep`: runs a parameter study, and writes report.html, results.csv and results.parquet.

use std::path::{self, PathBuf};

use super::outcome::Outcome;
use super::{JOURNAL, Opening, RECORDS, Study, discard, keep, report, results};
use crate::journal::Journal;
use crate::workers::{Program, WorkerArguments, Workers, work};
use crate::{FmuArguments, inputs, make_folder, progress_bar, refuse_overlap, write};
use anyhow::Result;
use clap::Args;
use fmu_io::temporary::remove_unfinished;
use fmu_io::terminal::{complain, print};
use fmu_io::writing;
use fmu_record::TableFormat;

/// Run a scenario for many parameter values, on all cores; resumes if interrupted
///
/// Exits with 0 if all runs succeed, and 1 if not.
#[derive(Args, Debug)]
#[group(skip)]
pub struct Sweep {
    /// The parameter study (see docs/simulate.md)
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    #[command(flatten)]
    fmus: FmuArguments,
    /// The folder for report.html, results.csv, results.parquet, the journal and the records
    #[arg(long, value_name = "DIR", default_value = "target/sweep")]
    out: PathBuf,
    /// Record communication points only, without the rows before and after each event
    #[arg(long)]
    no_events: bool,
    #[command(flatten)]
    workers: WorkerArguments,
}

impl Sweep {
    /// Runs or resumes a parameter study, in processes of a program that calls [`Sweep::work`]. Returns whether all runs
    /// succeeded; a failed one is a row of the results.
    ///
    /// # Errors
    /// When it cannot be run, or a file cannot be read or written.
    pub fn run(&self, program: &Program) -> Result<bool> {
        let out = &self.out;
        let study = self.read()?;
        refuse_overlap(out, &study.outputs(out), &inputs(&study.scenario))?;
        let (workers, opening) = Workers::open::<Opening>(program, &self.workers)?;
        for note in &opening.notes {
            complain(&format!("note: {note}"));
        }
        make_folder(out)?;
        let journal = Journal::open(&out.join(JOURNAL), &opening.identity)?;
        let records = out.join(RECORDS);
        if study.keeps_records {
            // The journal's lock keeps others from writing there.
            make_folder(&records)?;
            remove_unfinished(&records)?;
        }
        for outcome in journal.finished().iter().filter(|outcome| study.lacks_record(outcome, &records)) {
            complain(&format!("note: the record of run {0} is gone: run {0} is repeated", outcome.run));
            journal.forget(&outcome.run);
        }
        let taken_up = journal.finished().len();
        let runs = study.points.len();
        if taken_up > 0 {
            print(&format!("{taken_up} of {runs} runs are in the journal\n"))?;
        }
        let bar = progress_bar(runs as u64, "{pos} of {len} runs")?.with_position(taken_up as u64);
        let jobs: Vec<_> = (0..runs).map(|run| (run, run)).collect();
        let failed = |run: &usize, reason| {
            let outcome = Outcome { error: Some(reason), ..Outcome::new(*run, study.measures.len()) };
            discard(&outcome, &records)?;
            Ok(outcome)
        };
        let outcomes = workers.finish(&journal, &jobs, failed, |outcome| {
            if let Some(error) = &outcome.error {
                bar.suspend(|| complain(&format!("run {}: {error}", outcome.run)));
            }
            bar.inc(1);
        })?;
        bar.finish_and_clear();
        drop(workers);
        if study.keeps_records {
            remove_unfinished(&records)?;
        }

        let table = results::table(&study, &opening, &outcomes);
        for (name, format) in [(results::CSV, TableFormat::Csv), (results::PARQUET, TableFormat::Parquet)] {
            let file = out.join(name);
            writing::write(&file, |writer| table.write(format, writer))?;
            print(&format!("{}\n", file.display()))?;
        }
        write(out, [(report::HTML, report::html((&study, &opening), &outcomes))])?;
        let failed = outcomes.iter().filter(|outcome| outcome.error.is_some()).count();
        print(&format!("{} runs, {failed} failed\n", outcomes.len()))?;
        Ok(failed == 0)
    }

    /// Works for [`Sweep::run`] in another process.
    ///
    /// # Errors
    /// When the other process cannot be answered.
    pub fn work(&self) -> Result<()> {
        work(
            || {
                // FMUs may change the working folder.
                let records = path::absolute(self.out.join(RECORDS))?;
                let study = self.read()?;
                let (fmus, opening) = study.open()?;
                Ok(((study, fmus, records), opening))
            },
            |(study, fmus, _), run| study.run_one(fmus, run),
            |(_, _, records), run| keep(run, records),
        )
    }

    fn read(&self) -> Result<Study> {
        let mut study = Study::read(&self.study, &self.fmus.folder)?;
        self.fmus.give(&mut study.scenario)?;
        study.records_events &= !self.no_events;
        Ok(study)
    }
}
