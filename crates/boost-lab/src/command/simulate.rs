//! `simulate`: a scenario, to a CSV file and a plot.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::master::{LoadedFmus, Master};
use crate::plot::{Figure, Line, Panel, color};
use crate::record::Record;
use crate::scenario::Scenario;
use anyhow::Result;
use fmu_package::terminal::{complain, print};
use fmu_package::writing;

/// Steps between two updates of the progress bar.
const STEPS_PER_LOOK: u32 = 256;

/// Runs a scenario.
pub fn run(path: &Path, fmus: &super::FmuArguments, out: Option<PathBuf>, plot: Option<&Path>) -> Result<()> {
    let mut scenario = Scenario::read(path, fmus.folder.as_deref())?;
    fmus.give(&mut scenario)?;
    let name = format!("{}.csv", path.file_stem().unwrap_or_default().to_string_lossy());
    let out = match out {
        Some(out) if out.is_dir() => out.join(name),
        Some(out) => out,
        None => name.into(),
    };
    let outputs: Vec<_> = [out.clone()].into_iter().chain(plot.map(Path::to_path_buf)).collect();
    writing::refuse_overlap(&outputs, &fmus.inputs(&scenario))?;
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
    if let Some(plot) = plot {
        writing::write(plot, |writer| writer.write_all(draw(&run.record).svg().as_bytes()))?;
        print(&format!("{}\n", plot.display()))?;
    }
    Ok(())
}

/// A panel for each unit, over time.
fn draw(record: &Record) -> Figure {
    let mut units: Vec<&str> = vec![];
    for column in record.columns() {
        if !units.contains(&column.unit.as_str()) {
            units.push(&column.unit);
        }
    }
    let panel = |unit: &&str| {
        let of_unit: Vec<_> = record.columns().iter().filter(|column| column.unit == **unit).collect();
        let (shown, factor) = shown(unit);
        let height = 110.0_f64.max(20.0 * of_unit.len() as f64);
        let mut panel = Panel::new("time (s)", &shown).height(height);
        for (column, color) in of_unit.iter().zip(color::CYCLE.iter().cycle()) {
            let values = column.values.iter().map(|value| factor * value);
            panel = panel.line(Line::new(record.time(), values).label(&column.name).color(color));
        }
        [panel]
    };
    units.iter().map(panel).fold(Figure::new(), Figure::row).shared_x()
}

/// The unit of the plot, and the factor to it.
fn shown(unit: &str) -> (String, f64) {
    match unit {
        "" | "1" => (String::new(), 1.0),
        "Pa" => ("kPa".to_owned(), 1e-3),
        "rpm" => ("1000 rpm".to_owned(), 1e-3),
        other => (other.to_owned(), 1.0),
    }
}
