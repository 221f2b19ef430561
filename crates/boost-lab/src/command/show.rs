//! `show`: scenarios on one page.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use fmu_io::writing;
use fmu_master::measure::{greatest, least};
use fmu_master::scenario::Scenario;
use fmu_master::{LoadedFmus, Master, Run};
use fmu_plot::{Report, escaped, panels};
use fmu_record::Record;
use fmu_record::numbers::quantity;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

/// Runs scenarios and writes the page.
pub fn run(paths: &[PathBuf], fmus: &super::FmuArguments, title: &str, out: &Path) -> Result<()> {
    let mut scenarios = vec![];
    for path in paths {
        let mut scenario = Scenario::read(path, &fmus.own.folder, crate::mapping::read)?;
        fmus.give(&mut scenario).with_context(|| path.display().to_string())?;
        writing::refuse_overlap(&[out.to_path_buf()], &fmus.inputs(&scenario))?;
        scenarios.push((path, scenario));
    }
    // Each FMU is loaded once.
    let mut loaded = LoadedFmus::default();
    for member in scenarios.iter().flat_map(|(_, scenario)| &scenario.fmus) {
        loaded.get(member)?;
    }
    let bar = super::progress_bar(scenarios.len() as u64, "{pos} of {len} scenarios")?;
    let section = |(path, scenario): &(&PathBuf, Scenario)| {
        let section = section(path, scenario, &mut loaded.clone());
        bar.inc(1);
        section.with_context(|| path.display().to_string())
    };
    let sections = scenarios.par_iter().map(section).collect::<Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let mut page = Report::new(title);
    for section in &sections {
        page.append(section);
    }
    super::write_file(out, page.page("").as_bytes())
}

fn section(path: &Path, scenario: &Scenario, fmus: &mut LoadedFmus) -> Result<Report> {
    let run = Master::new(scenario, fmus)?.run(|_| ())?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let title = scenario.title.as_deref().unwrap_or(&name);
    let figure = panels::draw(&run.record, title, scenario.panel_names().as_deref());
    let mut section = Report::default();
    section.section_of(&name, title);
    section.paragraph(scenario.description.as_deref().unwrap_or_default());
    section.html(&facts(&run));
    section.figure(&figure, "");
    section.details(&format!("The scenario {name}"), &fmu_io::reading::text(path)?);
    Ok(section)
}

/// Boost error, shaft speed and warnings of the FMUs, as far as recorded.
fn facts(run: &Run) -> String {
    let mut facts = vec![];
    if let (Ok(reference), Ok(boost)) = (run.record.get("boost_reference"), run.record.get("boost_pressure"))
    {
        let distances = || boost.iter().zip(reference).map(|(boost, reference)| 1e-3 * (boost - reference));
        facts.push(format!(
            "Measured boost pressure stays within {} above and {} below its reference, including reference steps.",
            quantity(greatest(distances()).max(0.0), "kPa"),
            quantity((-least(distances())).max(0.0), "kPa")
        ));
    }
    if let Ok(speeds) = run.record.get("hp_turbo_speed") {
        let speed = quantity(1e-3 * greatest(speeds.iter().copied()), "krpm");
        facts.push(format!("The high-pressure shaft reaches {speed}."));
    }
    if let Some(alarm) = alarm(&run.record) {
        facts.push(alarm);
    }
    facts.extend(
        run.warnings.iter().map(|(name, message)| format!("{}: {}", escaped(name), escaped(&message.text))),
    );
    format!("<ul><li>{}</li></ul>\n", facts.join("</li><li>"))
}

/// When the diagnosis first finds something.
fn alarm(record: &Record) -> Option<String> {
    let codes = record.get("fault_code").ok()?;
    Some(match codes.iter().position(|code| *code != 0.0) {
        Some(row) => format!("fault_code is {} from {}.", codes[row], quantity(record.time()[row], "s")),
        None => "fault_code is 0: no alarm.".to_owned(),
    })
}
