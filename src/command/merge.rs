//! `merge`: joins FMUs of one model, built on several machines, into one for all platforms.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use fmi2_export::package::reading::LARGEST_CONTENT;
use fmi2_export::package::terminal::print;
use fmi2_export::package::{Merged, Part, Platform, archive, writing};

/// Merges FMUs; `runs` says where libraries were run.
pub fn run(fmus: &[PathBuf], runs: &[(Platform, String)], out: &Path) -> Result<()> {
    writing::refuse_overlap(&[out.to_owned()], fmus)?;
    // All are held at once, and become one.
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
    let file = File::open(path).with_context(|| format!("cannot open {shown}"))?;
    let files =
        archive::open(BufReader::new(file)).and_then(|mut archive| archive::read_files(&mut archive, left));
    Ok(Part { name: shown.to_string(), files: files.with_context(|| format!("{shown} is not an FMU"))? })
}
