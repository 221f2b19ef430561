//! `simulate`: a scenario, to a CSV file and a plot.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::master::{LoadedFmus, Master};
use crate::page::page;
use crate::panels;
use crate::plot::escaped;
use crate::record::Record;
use crate::scenario::Scenario;
use anyhow::{Error, Result, bail};
use fmu_package::terminal::{complain, print};
use fmu_package::writing;

/// Steps between two updates of the progress bar.
const STEPS_PER_LOOK: u32 = 256;

/// Runs a scenario.
pub fn run(path: &Path, fmus: &super::FmuArguments, out: Option<PathBuf>, plot: Option<&Path>) -> Result<()> {
    let mut scenario = Scenario::read(path, fmus.folder.as_deref())?;
    fmus.give(&mut scenario)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let table = format!("{name}.csv");
    let out = match out {
        Some(out) if out.is_dir() => out.join(table),
        Some(out) => out,
        None => table.into(),
    };
    let outputs: Vec<_> = [out.clone()].into_iter().chain(plot.map(Path::to_path_buf)).collect();
    writing::refuse_overlap(&outputs, &fmus.inputs(&scenario))?;
    let plot = plot.map(|plot| Ok::<_, Error>((plot, Format::of(plot)?))).transpose()?;
    let master = Master::new(&scenario, &mut LoadedFmus::default())?;
    let bar = super::progress_bar(u64::from(scenario.steps), "{percent} %")?;
    let run = master.run(|step| {
        if step % STEPS_PER_LOOK == 0 {
            bar.set_position(u64::from(step));
        }
    });
    bar.finish_and_clear();
    let run = run?;
    for (name, message) in &run.warnings {
        complain(&format!("warning: {name}: {}", message.text));
    }

    writing::write(&out, |writer| run.record.write_csv(writer))?;
    print(&format!("{}  {} rows\n", out.display(), run.record.time().len()))?;
    if let Some((plot, format)) = plot {
        let drawn = drawn(&scenario, &name, &run.record, format)?;
        writing::write(plot, |writer| writer.write_all(&drawn))?;
        print(&format!("{}\n", plot.display()))?;
    }
    Ok(())
}

/// What a plot is written as.
#[derive(Clone, Copy)]
enum Format {
    Svg,
    Png,
    Html,
}

impl Format {
    /// By the ending of a file's name.
    fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("html") => Ok(Self::Html),
            _ => bail!("{}: a plot is written to a file that ends with .svg, .png or .html", path.display()),
        }
    }
}

fn drawn(scenario: &Scenario, name: &str, record: &Record, format: Format) -> Result<Vec<u8>> {
    let title = scenario.title.as_deref().unwrap_or(name);
    let figure = panels::draw(record, title, scenario.panel_names().as_deref());
    match format {
        Format::Svg => Ok(figure.svg()?.into_bytes()),
        Format::Png => figure.png(),
        Format::Html => {
            let heading = escaped(title);
            let body = format!("<h1>{heading}</h1>\n<figure>\n{}</figure>\n", figure.html());
            Ok(page(title, "", &body).into_bytes())
        }
    }
}
