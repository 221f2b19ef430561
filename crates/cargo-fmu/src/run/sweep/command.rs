//! `sweep`: runs a parameter study, and writes report.html, results.csv and results.parquet.

use std::path::PathBuf;

use super::{JOURNAL, Study, report, results};
use crate::run::journal::Journal;
use crate::run::{FmuArguments, inputs, make_folder, progress_bar, refuse_overlap, threads, write};
use anyhow::Result;
use clap::Args;
use fmu_io::terminal::{complain, print};
use fmu_io::writing;
use fmu_record::TableFormat;

/// Run a scenario for many parameter values, on all cores; resumes if interrupted
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
    /// Number of runs in parallel [default: one per core]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl Sweep {
    /// Runs or resumes a parameter study.
    ///
    /// # Errors
    /// When it cannot be run, or a file cannot be read or written; a failed run is a row of the results.
    pub fn run(&self) -> Result<()> {
        let Self { study, fmus, out, threads: wanted } = self;
        let mut study = Study::read(study, &fmus.folder)?;
        fmus.give(&mut study.scenario)?;
        refuse_overlap(out, &study.outputs(out), &inputs(&study.scenario))?;
        let study = study.load()?;
        for note in &study.notes {
            complain(&format!("note: {note}"));
        }
        make_folder(out)?;
        let journal = Journal::open(&out.join(JOURNAL), &study.settings()?)?;
        let taken_up = journal.finished().len();
        if taken_up > 0 {
            print(&format!("{taken_up} of {} runs are in the journal\n", study.runs()))?;
        }
        let threads = threads(*wanted, study.fmus.iter())?;
        let bar = progress_bar(study.runs() as u64, "{pos} of {len} runs")?.with_position(taken_up as u64);
        let outcomes = study.run(out, &journal, &threads, |outcome| {
            if let Some(error) = &outcome.error {
                bar.suspend(|| complain(&format!("run {}: {error}", outcome.run)));
            }
            bar.inc(1);
        })?;
        bar.finish_and_clear();

        let table = results::table(&study, &outcomes);
        for (name, format) in [(results::CSV, TableFormat::Csv), (results::PARQUET, TableFormat::Parquet)] {
            let file = out.join(name);
            writing::write(&file, |writer| table.write(format, writer))?;
            print(&format!("{}\n", file.display()))?;
        }
        write(out, [(report::HTML, report::html(&study, &outcomes))])?;
        let failed = outcomes.iter().filter(|outcome| outcome.error.is_some()).count();
        Ok(print(&format!("{} runs, {failed} failed\n", outcomes.len()))?)
    }
}
