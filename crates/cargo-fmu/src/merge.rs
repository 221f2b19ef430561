//! `merge`: joins FMUs of one model, built on several machines, into one for all platforms.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_io::reading::{self, LARGEST_CONTENT};
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_package::{Merged, Part, Platform, archive};

use super::target::of_platform;

/// Merge FMUs of one model, built for different platforms, into one
#[derive(Args, Debug)]
pub struct Merge {
    /// The FMUs
    #[arg(value_name = "FILE.fmu", required = true)]
    fmus: Vec<PathBuf>,
    /// Where a platform's library was run, for the FMU's documentation
    #[arg(long = "ran", value_name = "PLATFORM=WHERE", value_parser = of_platform::<String>)]
    runs: Vec<(Platform, String)>,
    /// The file to write
    #[arg(long, short, value_name = "FILE.fmu")]
    out: PathBuf,
}

impl Merge {
    /// Writes the merged FMU, and lists its libraries.
    ///
    /// # Errors
    /// When an FMU cannot be read, they are not of one model, or the file cannot be written.
    pub fn run(&self) -> Result<()> {
        merge(&self.fmus, &self.runs, &self.out)
    }
}

fn merge(fmus: &[PathBuf], runs: &[(Platform, String)], out: &Path) -> Result<()> {
    writing::refuse_overlap(&[out.to_owned()], fmus)?;
    // All are held in memory at once, and become one.
    let mut left = LARGEST_CONTENT;
    let parts = fmus.iter().map(|path| read(path, &mut left)).collect::<Result<Vec<_>>>()?;
    let mut known = BTreeMap::new();
    for (platform, run) in runs {
        if known.insert(*platform, run.clone()).is_some() {
            bail!("--ran is given twice for {}", platform.folder());
        }
    }
    let merged = Merged::new(&parts, &known).context("the FMUs cannot be merged")?;
    writing::write(out, |writer| merged.write(writer))?;
    Ok(print(&merged.platforms.to_string())?)
}

fn read(path: &Path, left: &mut u64) -> Result<Part> {
    let shown = path.display();
    let file = reading::open(path)?;
    let files =
        archive::open(BufReader::new(file)).and_then(|mut archive| archive::read_files(&mut archive, left));
    Ok(Part { name: shown.to_string(), files: files.with_context(|| format!("{shown} is not an FMU"))? })
}
