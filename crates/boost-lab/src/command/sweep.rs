//! `sweep`: a parameter study, to report.html, results.csv and results.parquet.

use std::path::Path;

use crate::sweep::journal::StudyJournal;
use crate::sweep::{Study, report, results};
use crate::table::{Header, TableFormat};
use anyhow::Result;
use fmu_package::terminal::{complain, print};
use fmu_package::writing;

/// Runs or resumes a parameter study.
pub fn run(
    path: &Path,
    fmus: &super::FmuArguments,
    out: &Path,
    units: bool,
    threads: Option<usize>,
) -> Result<()> {
    let mut study = Study::read(path, &fmus.folder)?;
    fmus.give(&mut study.scenario)?;
    super::refuse_overlap(out, &study.outputs(out), &fmus.inputs(&study.scenario))?;
    let study = study.load()?;
    for note in &study.notes {
        complain(&format!("note: {note}"));
    }
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

    let table = results::table(&study, &outcomes);
    let header = if units { Header::NamesAndUnits } else { Header::Names };
    for (name, format) in [(results::CSV, TableFormat::Csv), (results::PARQUET, TableFormat::Parquet)] {
        let file = out.join(name);
        writing::write(&file, |writer| table.write(format, header, writer))?;
        print(&format!("{}\n", file.display()))?;
    }
    super::write(out, [(report::HTML, report::html(&study, &outcomes))])?;
    let failed = outcomes.iter().filter(|outcome| outcome.error.is_some()).count();
    Ok(print(&format!("{} runs, {failed} failed\n", outcomes.len()))?)
}
