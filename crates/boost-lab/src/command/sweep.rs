//! `sweep`: a parameter study, to results.csv and results.parquet.

use std::path::Path;

use crate::sweep::Study;
use crate::sweep::journal::StudyJournal;
use crate::sweep::results::{self, Table};
use anyhow::Result;
use fmu_package::terminal::{complain, print};
use fmu_package::writing;

/// Runs a study, or what is left of it.
pub fn run(path: &Path, fmus: &super::FmuArguments, out: &Path, threads: Option<usize>) -> Result<()> {
    let mut study = Study::read(path, fmus.folder.as_deref())?;
    fmus.give(&mut study.scenario)?;
    super::refuse_overlap(out, &study.outputs(out), &fmus.inputs(&study.scenario))?;
    let study = study.load()?;
    let journal = StudyJournal::open(out, &study.settings()?)?;
    let taken_up = journal.len();
    if taken_up > 0 {
        print(&format!("{taken_up} of {} runs are in the journal\n", study.runs()))?;
    }
    let available = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = threads.unwrap_or(available);
    let bar = super::progress_bar(study.runs() as u64, "{pos} of {len} runs")?.with_position(taken_up as u64);
    let outcomes = study.run(journal, threads, |outcome| {
        if let Some(error) = &outcome.error {
            bar.suspend(|| complain(&format!("run {}: {error}", outcome.run)));
        }
        bar.inc(1);
    });
    bar.finish_and_clear();
    let outcomes = outcomes?;

    let table = Table::new(&study, &outcomes);
    writing::write(&out.join(results::CSV), |writer| table.write_csv(writer))?;
    writing::write(&out.join(results::PARQUET), |writer| table.write_parquet(writer))?;
    for name in [results::CSV, results::PARQUET] {
        print(&format!("{}\n", out.join(name).display()))?;
    }
    let failed = outcomes.iter().filter(|outcome| outcome.error.is_some()).count();
    Ok(print(&format!("{} runs, {failed} of them failed\n", outcomes.len()))?)
}
