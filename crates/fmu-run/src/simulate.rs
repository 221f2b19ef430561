//! `simulate`: runs an experiment, and writes a summary, a record and a plot.

use std::path::PathBuf;
use std::time::Instant;

use super::experiment::{End, Experiment, TrialExport};
use super::plot_format::PlotFormat;
use super::summary::Summary;
use super::{finite, progress_bar, write_file};
use anyhow::{Error, Result, bail};
use clap::Args;
use fmu_io::terminal::{complain, number, print};
use fmu_io::writing;
use fmu_master::scenario::{self, Location, Scenario};
use fmu_master::{LoadedFmus, Master};
use fmu_plot::{Report, panels};
use fmu_record::{Record, TableFormat};

/// Steps between updates of the progress bar.
const STEPS_PER_LOOK: u32 = 256;

/// The most FMUs that a message names.
const MOST_NAMED: usize = 5;

/// Run an FMU, a system or a scenario, or the model of this folder
#[derive(Args, Debug)]
#[group(skip)]
pub struct Simulate {
    #[command(flatten)]
    experiment: Experiment,
    /// Override the stop time (s)
    #[arg(long, value_name = "SECONDS", value_parser = finite())]
    stop_time: Option<f64>,
    /// Override what is recorded, as in a scenario: variables, whole arrays, and patterns such as "T[3,*]"
    #[arg(long, value_name = "[FMU:]NAME,...", value_parser = names)]
    record: Option<Names>,
    /// The record to write, or its folder [default: none, but a summary]
    #[arg(long, value_name = "FILE.csv|parquet|DIR")]
    out: Option<PathBuf>,
    /// Omit the row of units from the record, which FMPy does not read
    #[arg(long)]
    no_units: bool,
    /// Run co-simulation of FMI 3.0 with Event Mode and early return, and so record its events
    #[arg(long)]
    event_mode: bool,
    /// Record communication points only, without the rows before and after each event
    #[arg(long)]
    no_events: bool,
    /// Plot the record in the scenario's panels
    #[arg(long, value_name = "FILE.svg|png|html")]
    plot: Option<PathBuf>,
}

impl Simulate {
    /// Runs the command.
    ///
    /// # Errors
    /// When it cannot be run, or a file cannot be read or written.
    pub fn run(&self, export: TrialExport<'_>) -> Result<()> {
        let subject = self.experiment.subject(export)?;
        let name = subject.file_stem().unwrap_or_default().to_string_lossy();
        let out = self.out.as_ref().map(|out| {
            let file = if out.is_dir() { out.join(format!("{name}.csv")) } else { out.clone() };
            Ok::<_, Error>((TableFormat::of(&file)?, file))
        });
        let out = out.transpose()?;
        let plot = self.plot.as_ref().map(|plot| Ok::<_, Error>((PlotFormat::of(plot)?, plot.clone())));
        let plot = plot.transpose()?;
        let outputs: Vec<_> =
            out.iter().map(|(_, file)| file).chain(plot.iter().map(|(_, file)| file)).cloned().collect();
        let end = End { time: self.stop_time, option: "stop-time" };
        let (scenario, recorded) = self.experiment.run(&subject, end, &outputs, |mut scenario, loaded| {
            if let Some(Names(names)) = &self.record {
                let location = Location::argument("--record");
                let recorded =
                    |name: &String| scenario::Recorded { name: name.clone(), location: location.clone() };
                scenario.record = Some(names.iter().map(recorded).collect());
                scenario.panels = None;
            }
            if self.event_mode {
                Location::argument("--event-mode").locate(return_early(&mut scenario, loaded))?;
            }
            let recorded = record(&scenario, loaded, self, !outputs.is_empty())?;
            Ok((scenario, recorded))
        })?;
        let Recorded { record, summary, sampling } = recorded;
        match &out {
            Some((format, path)) => {
                let table = record.table();
                let table = if self.no_units { table.without_units() } else { table };
                writing::write(path, |writer| table.write(*format, writer))?;
                print(&format!("{}  {} rows{sampling}\n", path.display(), record.time().len()))?;
            }
            None => print(&format!("{name}: {}", summary.unwrap_or_default()))?,
        }
        if let Some((format, path)) = &plot {
            let title = scenario.title.as_deref().unwrap_or(&name);
            let figure = panels::draw(&record, title, scenario.panel_names().as_deref());
            write_file(path, &format.drawn(&figure, title, &Report::default())?)?;
        }
        Ok(())
    }
}

/// Names from the command line.
#[derive(Clone, Debug)]
struct Names(Vec<String>);

/// Splits names at commas that are neither between brackets nor within quotes.
fn names(text: &str) -> Result<Names, String> {
    let (mut depth, mut is_quoted, mut is_escaped) = (0_u32, false, false);
    let is_between = |letter: char| {
        match letter {
            _ if is_escaped => {}
            '\'' => is_quoted = !is_quoted,
            '[' if !is_quoted => depth += 1,
            ']' if !is_quoted => depth = depth.saturating_sub(1),
            _ => {}
        }
        is_escaped = letter == '\\' && !is_escaped;
        letter == ',' && depth == 0 && !is_quoted
    };
    let names: Vec<_> = text.split(is_between).map(str::to_owned).collect();
    if names.iter().any(String::is_empty) { Err("expected names".to_owned()) } else { Ok(Names(names)) }
}

/// Has the FMUs return early for events that can.
fn return_early(scenario: &mut Scenario, loaded: &mut LoadedFmus) -> Result<()> {
    let mut refused = vec![];
    for member in &mut scenario.fmus {
        match loaded.get(member)?.refuse_no_event_mode() {
            Ok(()) => member.returns_early = true,
            Err(error) => refused.push(format!("{}: {error}", member.name)),
        }
    }
    if !scenario.fmus.iter().any(|member| member.returns_early) {
        bail!("{}", refused.join("; "));
    }
    Ok(())
}

/// A finished run.
struct Recorded {
    /// The record, if it is kept.
    record: Record,
    /// What ran, how long, and the course of each variable, if there is no file of the record.
    summary: Option<String>,
    /// Which FMUs told no events, though they are recorded.
    sampling: String,
}

/// Runs a scenario to its end; prints notes and warnings.
fn record(
    scenario: &Scenario,
    loaded: &mut LoadedFmus,
    options: &Simulate,
    is_kept: bool,
) -> Result<Recorded> {
    let mut master = Master::new(scenario, loaded)?;
    let mut sampling = String::new();
    if !options.no_events {
        master.record_events();
        let hint = |(name, has_them): (&str, bool)| {
            if has_them { format!("{name} (see --event-mode)") } else { name.to_owned() }
        };
        let silent: Vec<_> = master.without_events().map(hint).collect();
        if !silent.is_empty() {
            let others = silent.len().saturating_sub(MOST_NAMED);
            let others = if others > 0 { format!(" and {others} others") } else { String::new() };
            let named = silent[..silent.len().min(MOST_NAMED)].join(", ");
            sampling = format!("; sampled: no events from {named}{others}");
        }
    }
    for note in master.notes() {
        complain(&format!("note: {note}"));
    }
    let bar = progress_bar(u64::from(scenario.steps), "{percent} %")?;
    let mut summary = options.out.is_none().then(|| Summary::new(master.recorded()));
    let begin = Instant::now();
    let run = master.run(|step, record| {
        if step % STEPS_PER_LOOK == 0 {
            bar.set_position(u64::from(step));
            // A long run needs no more memory than a short one.
            if !is_kept {
                if let Some(summary) = &mut summary {
                    summary.add(record);
                }
                record.clear();
            }
        }
    });
    bar.finish_and_clear();
    let run = run?;
    let taken = begin.elapsed();
    if let Some(ended) = &run.ended {
        complain(&format!("note: {ended}"));
    }
    for (name, message) in &run.warnings {
        complain(&format!("warning: {}", message.of(name)));
    }
    let summary = summary.map(|mut summary| {
        summary.add(&run.record);
        format!(
            "{} steps of {} s to {} s, in {} ms{sampling}\n{}",
            scenario.steps,
            number(scenario.step),
            number(scenario.stop_time),
            taken.as_millis(),
            summary.text()
        )
    });
    Ok(Recorded { record: run.record, summary, sampling })
}
