//! `simulate`: a scenario, a system or one FMU, to a record and a plot.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::FmuArguments;
use crate::mapping;
use anyhow::{Context, Error, Result, bail};
use clap::Args;
use fmu_master::scenario::{Assignment, Input, Location, Member, Recorded, Scenario, Signal};
use fmu_master::system::{self, Times};
use fmu_master::{LoadedFmus, Master};
use fmu_package::temporary::Folder;
use fmu_package::terminal::{complain, print};
use fmu_package::{FmuVariable, ParameterSet, Value, ValueType, like, writing};
use fmu_plot::page;
use fmu_plot::panels;
use fmu_plot::{Figure, escaped};
use fmu_record::{Header, TableFormat};

/// Steps between two updates of the progress bar.
const STEPS_PER_LOOK: u32 = 256;

/// What `simulate` takes.
#[derive(Args)]
pub struct Arguments {
    /// A scenario, which docs/laboratory.md describes; a system; or an FMU alone
    #[arg(value_name = "SCENARIO.toml|SYSTEM.ssp|FILE.fmu")]
    subject: PathBuf,
    #[command(flatten)]
    fmus: FmuArguments,
    /// A value of a variable before initialization, or of an input all the time, in its unit or with another one:
    /// tank.volume=0.002, plant:tank.volume=2e-3, "throttle=50 %"
    #[arg(long = "set", value_name = "[FMU:]NAME=VALUE", value_parser = super::name_and_value)]
    values: Vec<(String, String)>,
    /// A parameter set, for the FMU that has its parameters; may be given several times
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// Another end (s)
    #[arg(long, value_name = "SECONDS", value_parser = super::finite())]
    stop_time: Option<f64>,
    /// Another communication step of a system or an FMU alone (s)
    #[arg(long, value_name = "SECONDS", value_parser = super::positive())]
    step: Option<f64>,
    /// What to record instead, as in a scenario
    #[arg(long, value_name = "[FMU:]NAME,...", value_delimiter = ',')]
    record: Option<Vec<String>>,
    /// The file to write, or a folder to write it to [default: SCENARIO.csv]
    #[arg(long, value_name = "FILE.csv|parquet|DIR")]
    out: Option<PathBuf>,
    /// Write units to the header of a CSV file: `name (unit)`. A Parquet file always has them in its metadata
    #[arg(long)]
    units: bool,
    /// Draw what is recorded, in the panels of the scenario
    #[arg(long, value_name = "FILE.svg|png|html")]
    plot: Option<PathBuf>,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<()> {
    let (scenario, folder) = scenario(arguments)?;
    simulate(arguments, scenario).map_err(|error| match &folder {
        Some(folder) => system::named(&error, &arguments.subject, folder),
        None => error,
    })
}

fn simulate(arguments: &Arguments, mut scenario: Scenario) -> Result<()> {
    let Arguments { subject, fmus, plot, .. } = arguments;
    let name = subject.file_stem().unwrap_or_default().to_string_lossy();
    let table = format!("{name}.csv");
    let out = match &arguments.out {
        Some(out) if out.is_dir() => out.join(table),
        Some(out) => out.clone(),
        None => table.into(),
    };
    let format = TableFormat::of(&out)?;
    let plot = plot.as_ref().map(|plot| Ok::<_, Error>((plot, PlotFormat::of(plot)?))).transpose()?;
    let outputs: Vec<_> = [&out].into_iter().chain(plot.map(|(plot, _)| plot)).cloned().collect();
    let inputs = [fmus.inputs(&scenario), arguments.parameters.clone()].concat();
    writing::refuse_overlap(&outputs, &inputs)?;
    let mut loaded = LoadedFmus::default();
    for (name, value) in &arguments.values {
        let location = Location::argument(&format!("--set {name}={value}"));
        set(&mut scenario, &mut loaded, name, value, &location)?;
    }
    for path in &arguments.parameters {
        let location = Location::argument(&format!("--parameters {}", path.display()));
        let set = ParameterSet::read(path)?;
        let member = location.locate(owner(&mut scenario, &mut loaded, &set))?;
        member.parameters.push((set, location));
    }
    let master = Master::new(&scenario, &mut loaded)?;
    for note in master.notes() {
        complain(&format!("note: {note}"));
    }
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

    let header = if arguments.units { Header::NamesAndUnits } else { Header::Names };
    writing::write(&out, |writer| run.record.table().write(format, header, writer))?;
    print(&format!("{}  {} rows\n", out.display(), run.record.time().len()))?;
    if let Some((path, format)) = plot {
        let title = scenario.title.as_deref().unwrap_or(&name);
        let figure = panels::draw(&run.record, title, scenario.panel_names().as_deref());
        let drawn = format.drawn(&figure, title, "")?;
        writing::write(path, |writer| writer.write_all(&drawn))?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}

/// What is to be run, and the folder of a system's FMUs, which lasts until the run ends.
fn scenario(arguments: &Arguments) -> Result<(Scenario, Option<Folder>)> {
    let Arguments { subject, fmus, stop_time, step, .. } = arguments;
    let times = Times { start: None, stop: *stop_time, step: *step };
    let ending = subject.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
    let (mut scenario, folder) = match ending.to_str() {
        Some("fmu") => {
            fmus.refuse_files("an FMU alone")?;
            (system::alone(subject, times)?, None)
        }
        Some("ssp") => {
            fmus.refuse_files("a system")?;
            fmus.refuse_maps("a system has its own conversions")?;
            let (scenario, folder) = system::read(subject, times)?;
            (scenario, Some(folder))
        }
        _ => {
            if step.is_some() {
                bail!("--step is for a system or an FMU alone; {} has its own", subject.display());
            }
            let mut scenario = Scenario::read(subject, &fmus.folder, mapping::read)?;
            if let Some(stop_time) = stop_time {
                let end = scenario.end_at(*stop_time);
                Location::argument(&format!("--stop-time {stop_time}")).locate(end)?;
            }
            fmus.give(&mut scenario)?;
            (scenario, None)
        }
    };
    if ending == "fmu" {
        fmus.give(&mut scenario)?;
    }
    if let Some(names) = &arguments.record {
        let location = Location::argument("--record");
        let recorded = |name: &String| Recorded { name: name.clone(), location: location.clone() };
        scenario.record = Some(names.iter().map(recorded).collect());
        scenario.panels = None;
    }
    Ok((scenario, folder))
}

/// Gives a variable another value before initialization, or an input another signal.
fn set(
    scenario: &mut Scenario,
    loaded: &mut LoadedFmus,
    name: &str,
    text: &str,
    location: &Location,
) -> Result<()> {
    let mut found = vec![];
    for (index, member) in scenario.fmus.iter().enumerate() {
        let fmu = loaded.get(member)?;
        let own = name.strip_prefix(&format!("{}:", member.name));
        // Of a system the inputs have the names of its connectors.
        let driven = scenario.inputs_of(member, &fmu, name).into_iter().next().filter(|_| own.is_none());
        let wanted = own.or(driven.map(|(input, _)| input)).unwrap_or(name);
        let Some(variable) = fmu.description().variable(wanted).filter(|variable| variable.is_settable())
        else {
            continue;
        };
        let value = location.locate(value(variable, text).and_then(|value| {
            let fitted = value.fit(variable, &[], fmu.description())?;
            fitted.check_range(variable)?;
            Ok(fitted)
        }))?;
        found.push((index, variable.clone(), value, driven.map(|(_, conversion)| conversion)));
    }
    let [(index, variable, value, conversion), others @ ..] = &found[..] else {
        return Err(location.error(not_found(scenario, loaded, name)?));
    };
    let number = match value {
        Value::Real(number, _) => Some(*number),
        Value::Integer(number) => Some(f64::from(*number)),
        Value::Boolean(value) => Some(f64::from(u8::from(*value))),
        Value::String(_) | Value::Enumeration(_) => None,
    };
    if let (Some(conversion), Some(number)) = (conversion, number) {
        // A plain number is in the signal's own unit.
        let signal = Signal::Constant(text.parse().unwrap_or_else(|_| conversion.inverse().apply(number)));
        let input = Input { name: name.to_owned(), signal, location: location.clone() };
        for member in &mut scenario.fmus {
            member.inputs.retain(|input| input.name != name);
        }
        scenario.inputs.retain(|input| input.name != name);
        scenario.inputs.push(input);
        return Ok(());
    }
    if !others.is_empty() {
        let names = found.iter().map(|(index, ..)| format!("{}:{name}", scenario.fmus[*index].name));
        return Err(location.error(format!("which one? {}", names.collect::<Vec<_>>().join(" or "))));
    }
    let member = &mut scenario.fmus[*index];
    if let (true, Some(number)) = (variable.causality == "input", number) {
        member.inputs.retain(|input| input.name != variable.name);
        let signal = Signal::Constant(number);
        member.inputs.push(Input { name: variable.name.clone(), signal, location: location.clone() });
        return Ok(());
    }
    let mut in_run_in = member.run_in.iter().flat_map(|run_in| run_in.during.iter().chain(&run_in.after));
    if in_run_in.any(|assignment| assignment.name == variable.name) {
        return Err(
            location.error(format!("the scenario sets {} in the run_in of {}", variable.name, member.name))
        );
    }
    member.values.retain(|assignment| assignment.name != variable.name);
    let (name, value) = (variable.name.clone(), value.clone());
    member.values.push(Assignment { name, value, location: location.clone() });
    Ok(())
}

fn not_found(scenario: &Scenario, loaded: &mut LoadedFmus, name: &str) -> Result<String> {
    let mut known = vec![];
    for member in &scenario.fmus {
        let fmu = loaded.get(member)?;
        let settable = fmu.description().variables.iter().filter(|variable| variable.is_settable());
        for variable in settable {
            known.push(variable.name.clone());
            known.push(format!("{}:{}", member.name, variable.name));
        }
    }
    let like = like(name, known.iter().map(String::as_str));
    Ok(format!("no FMU has a variable {name} that can be set{like}"))
}

/// The value of a text for a variable: a number may have a unit after a space.
fn value(variable: &FmuVariable, text: &str) -> Result<Value> {
    let number = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
    Ok(match variable.value_type() {
        ValueType::Real => match text.split_once(' ') {
            Some((value, unit)) => {
                let value = number(value).context("expected a number and its unit")?;
                Value::Real(value, Some(unit.trim().to_owned()))
            }
            None => Value::Real(number(text).context("expected a number")?, None),
        },
        ValueType::Integer => Value::Integer(text.parse().ok().context("expected a whole number")?),
        ValueType::Boolean => match text {
            "true" | "1" => Value::Boolean(true),
            "false" | "0" => Value::Boolean(false),
            _ => bail!("expected true or false"),
        },
        ValueType::Enumeration => {
            text.parse().map_or_else(|_| Value::Enumeration(text.to_owned()), Value::Integer)
        }
        _ => Value::String(text.to_owned()),
    })
}

/// The FMU that a parameter set is for: the one that has its parameters.
fn owner<'a>(
    scenario: &'a mut Scenario,
    loaded: &mut LoadedFmus,
    set: &ParameterSet,
) -> Result<&'a mut Member> {
    let mut counts = vec![];
    for member in &scenario.fmus {
        let fmu = loaded.get(member)?;
        let has = |name: &str| fmu.description().variable(name).is_some();
        counts.push(set.parameters.iter().filter(|parameter| has(&parameter.name)).count());
    }
    let most = counts.iter().copied().max().filter(|most| *most > 0);
    let most = most.with_context(|| format!("no FMU has a parameter of the set {}", set.name))?;
    let owners: Vec<_> = counts.iter().enumerate().filter(|(_, count)| **count == most).collect();
    let [(index, _)] = owners[..] else {
        let names = owners.iter().map(|(index, _)| scenario.fmus[*index].name.as_str());
        let names = names.collect::<Vec<_>>().join(" and ");
        bail!("{names} have its parameters: give it to one of them in a scenario, by the key parameters");
    };
    Ok(&mut scenario.fmus[index])
}

/// What a plot is written as.
#[derive(Clone, Copy)]
pub enum PlotFormat {
    Svg,
    Png,
    Html,
}

impl PlotFormat {
    /// By the ending of a file's name.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("html") => Ok(Self::Html),
            _ => bail!("{}: a plot is written to a file that ends with .svg, .png or .html", path.display()),
        }
    }

    /// The file's content; a page has further HTML below the figure.
    pub fn drawn(self, figure: &Figure, title: &str, below: &str) -> Result<Vec<u8>> {
        match self {
            Self::Svg => Ok(figure.svg()?.into_bytes()),
            Self::Png => figure.png(),
            Self::Html => {
                let heading = escaped(title);
                let body = format!("<h1>{heading}</h1>\n<figure>\n{}</figure>\n{below}", figure.html());
                Ok(page(title, "", &body).into_bytes())
            }
        }
    }
}
