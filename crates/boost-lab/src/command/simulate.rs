//! `simulate`: a scenario, a system or a single FMU, to a record and a plot.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::FmuArguments;
use crate::master::{LoadedFmus, Master};
use crate::page::page;
use crate::panels;
use crate::plot::{Figure, escaped};
use crate::scenario::{Assignment, Input, Location, Member, Recorded, Scenario, Signal};
use crate::system::{self, Times};
use crate::table::{Header, TableFormat};
use anyhow::{Context, Error, Result, bail};
use clap::Args;
use fmu_package::temporary::Folder;
use fmu_package::terminal::{complain, print};
use fmu_package::{FmuVariable, ParameterSet, Value, ValueType, like, writing};

/// Steps between updates of the progress bar.
const STEPS_PER_LOOK: u32 = 256;

#[derive(Args)]
pub struct Arguments {
    /// A scenario (see docs/laboratory.md), a system or a single FMU
    #[arg(value_name = "SCENARIO.toml|SYSTEM.ssp|FILE.fmu")]
    subject: PathBuf,
    #[command(flatten)]
    fmus: FmuArguments,
    /// Set a variable before initialization, or an input throughout, in its own or the given unit:
    /// tank.volume=0.002, plant:tank.volume=2e-3, "throttle=50 %"
    #[arg(long = "set", value_name = "[FMU:]NAME=VALUE", value_parser = super::name_and_value)]
    values: Vec<(String, String)>,
    /// Parameter set, for the FMU that has its parameters; may be given several times
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// Override the stop time (s)
    #[arg(long, value_name = "SECONDS", value_parser = super::finite())]
    stop_time: Option<f64>,
    /// Override the communication step of a system or single FMU (s)
    #[arg(long, value_name = "SECONDS", value_parser = super::positive())]
    step: Option<f64>,
    /// Override what is recorded, as in a scenario
    #[arg(long, value_name = "[FMU:]NAME,...", value_delimiter = ',')]
    record: Option<Vec<String>>,
    /// The file to write, or its folder [default: SCENARIO.csv]
    #[arg(long, value_name = "FILE.csv|parquet|DIR")]
    out: Option<PathBuf>,
    /// Write units in the CSV header: `name (unit)`. Parquet files always have them in their metadata
    #[arg(long)]
    units: bool,
    /// Plot the record in the scenario's panels
    #[arg(long, value_name = "FILE.svg|png|html")]
    plot: Option<PathBuf>,
}

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

/// What to run, and the temporary folder of a system's FMUs, which must outlive the run.
fn scenario(arguments: &Arguments) -> Result<(Scenario, Option<Folder>)> {
    let Arguments { subject, fmus, stop_time, step, .. } = arguments;
    let times = Times { start: None, stop: *stop_time, step: *step };
    let ending = subject.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
    let (mut scenario, folder) = match ending.to_str() {
        Some("fmu") => {
            fmus.refuse_files("single FMUs")?;
            (system::alone(subject, times)?, None)
        }
        Some("ssp") => {
            fmus.refuse_files("systems")?;
            fmus.refuse_maps("a system defines its own conversions")?;
            let (scenario, folder) = system::read(subject, times)?;
            (scenario, Some(folder))
        }
        _ => {
            if step.is_some() {
                bail!("--step is for a system or a single FMU; {} sets its own", subject.display());
            }
            let mut scenario = Scenario::read(subject, &fmus.folder)?;
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

/// Sets a variable before initialization, or an input's signal.
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
        // A system's inputs are named after its connectors.
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
        return Err(location.error(format!("ambiguous: use {}", names.collect::<Vec<_>>().join(" or "))));
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
    Ok(format!("no FMU has a settable variable {name}{like}"))
}

/// Parses a variable's value; a number may be followed by a space and a unit.
fn value(variable: &FmuVariable, text: &str) -> Result<Value> {
    let number = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
    Ok(match variable.value_type() {
        ValueType::Real => match text.split_once(' ') {
            Some((value, unit)) => {
                let value = number(value).context("expected a number and a unit")?;
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

/// The FMU that has most of a set's parameters.
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
        bail!(
            "{names} both have its parameters: assign it in a scenario, by the key parameters of one of them"
        );
    };
    Ok(&mut scenario.fmus[index])
}

/// A plot's file format.
#[derive(Clone, Copy)]
pub enum PlotFormat {
    Svg,
    Png,
    Html,
}

impl PlotFormat {
    /// The format of a file extension.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("html") => Ok(Self::Html),
            _ => bail!("{}: a plot file must end with .svg, .png or .html", path.display()),
        }
    }

    /// The file's content; a page adds further HTML below the figure.
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
