//! `sweep`: a parameter study, to results.csv and results.parquet.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use anyhow::{Context, Result};
use boost_lab::sweep::Study;
use boost_lab::sweep::journal::Journal;
use boost_lab::sweep::results::Table;
use indicatif::{ProgressBar, ProgressStyle};

/// Runs a study, or what is left of it.
pub fn run(path: &Path, fmus: &super::Fmus, out: &Path, threads: Option<usize>) -> Result<()> {
    let mut study = Study::read(path, fmus.folder.as_deref())?;
    fmus.give(&mut study.scenario)?;
    let study = study.load()?;
    let journal = Journal::open(out, &study.settings()?)?;
    let taken_up = journal.len();
    if taken_up > 0 {
        println!("{taken_up} of {} runs are in the journal", study.runs());
    }
    let available = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = threads.unwrap_or(available);
    // It draws nothing where standard error is no terminal.
    let bar = ProgressBar::new(study.runs() as u64).with_position(taken_up as u64);
    bar.set_style(
        ProgressStyle::with_template("{wide_bar} {pos} of {len} runs  {eta} left")
            .context("no progress bar")?,
    );
    let outcomes = study.run(journal, threads, |outcome| {
        if let Some(error) = &outcome.error {
            bar.suspend(|| eprintln!("run {}: {error}", outcome.run));
        }
        bar.inc(1);
    });
    bar.finish_and_clear();
    let outcomes = outcomes?;

    let table = Table::new(&study, &outcomes);
    for (name, write) in [
        ("results.csv", Table::write_csv as fn(&Table, BufWriter<File>) -> Result<()>),
        ("results.parquet", Table::write_parquet),
    ] {
        let path = out.join(name);
        let write = || write(&table, BufWriter::new(File::create(&path)?));
        write().with_context(|| format!("cannot write {}", path.display()))?;
        println!("{}", path.display());
    }
    let failed = outcomes.iter().filter(|outcome| outcome.error.is_some()).count();
    println!("{} runs, {failed} of them failed", outcomes.len());
    Ok(())
}
