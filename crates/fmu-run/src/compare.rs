//! `compare`: overlays records, and prints their differences.

use std::path::PathBuf;

use super::comparison::Comparison;
use super::plot_format::PlotFormat;
use super::write_file;
use anyhow::{Error, Result};
use clap::Args;
use fmu_io::terminal::{complain, print};
use fmu_io::writing;
use fmu_record::Record;

/// Compare records: their differences in numbers, and overlaid in a plot
#[derive(Args, Debug)]
#[group(skip)]
pub struct Compare {
    /// The records; the first is the reference
    #[arg(value_name = "RECORD.csv|parquet", num_args = 2.., required = true)]
    records: Vec<PathBuf>,
    /// The variables to compare [default: all common ones]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    variables: Option<Vec<String>>,
    /// Plot of the overlaid records and their differences; an HTML page includes the numbers
    #[arg(long, value_name = "FILE.svg|png|html")]
    plot: Option<PathBuf>,
}

impl Compare {
    /// Compares.
    ///
    /// # Errors
    /// When records cannot be compared, or a file cannot be read or written.
    pub fn run(&self) -> Result<()> {
        let Self { records: files, variables, plot } = self;
        let plot = plot.as_ref().map(|plot| Ok::<_, Error>((plot, PlotFormat::of(plot)?))).transpose()?;
        writing::refuse_overlap(&plot.iter().map(|(plot, _)| (*plot).clone()).collect::<Vec<_>>(), files)?;
        let names = short(files);
        let records: Vec<_> = names
            .into_iter()
            .zip(files)
            .map(|(name, file)| Ok((name, Record::read(file)?)))
            .collect::<Result<_>>()?;
        let comparison = Comparison::new(&records, variables.as_deref())?;
        for note in &comparison.notes {
            complain(&format!("note: {note}"));
        }
        print(&comparison.text())?;
        if let Some((plot, format)) = plot {
            let drawn = format.drawn(&comparison.draw(), "Records compared", &comparison.report())?;
            write_file(plot, &drawn)?;
        }
        Ok(())
    }
}

/// File names, or paths if two names are equal.
fn short(files: &[PathBuf]) -> Vec<String> {
    let of = |file: &PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_unique = files.iter().all(|file| files.iter().filter(|other| of(file) == of(other)).count() == 1);
    files.iter().map(|file| if is_unique { of(file) } else { file.display().to_string() }).collect()
}
