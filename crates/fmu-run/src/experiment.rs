//! What a command runs: the model of this folder, an FMU, a system or a scenario, with the values of the command line.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{FmuArguments, finite, inputs, name_and_value, positive};
use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use fmu_io::terminal::complain;
use fmu_io::writing;
use fmu_master::process::contained;
use fmu_master::scenario::{
    Assignment, Course, Input, Location, Measured, Member, Scenario, Signal, Tolerance,
};
use fmu_master::system::{self, Times, Unpacked};
use fmu_master::{Fmu, Interface, Link, LoadedFmus, links};
use fmu_package::{FmuDescription, FmuVariable, ParameterSet, Value, ValueType};
use fmu_record::Data;
use fmu_terms::{Causality, Version, like};

/// What runs, and with which values.
#[derive(Args, Debug)]
#[group(skip)]
pub struct Experiment {
    /// An FMU, a system, or a scenario, which docs/simulate.md describes [default: the model of this folder, exported
    /// for a trial]
    #[arg(value_name = "FILE.fmu|SYSTEM.ssp|SYSTEM.ssd|SCENARIO.toml")]
    subject: Option<PathBuf>,
    #[command(flatten)]
    fmus: FmuArguments,
    /// Set a variable before initialization, or an input throughout, in its own or the given unit:
    /// tank.volume=0.002, plant:tank.volume=2e-3, "level=50 %"
    #[arg(long = "set", value_name = "[FMU:]NAME=VALUE", value_parser = name_and_value::<String>("NAME=VALUE"))]
    values: Vec<(String, String)>,
    /// Parameter set, for the FMU that has its parameters; may be given several times
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    /// Override the start time (s)
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = finite())]
    start_time: Option<f64>,
    /// Override the communication step of a system or single FMU (s)
    #[arg(long, value_name = "SECONDS", value_parser = positive())]
    step: Option<f64>,
    /// Relative tolerance of the FMUs' integrators, or none [default: that of their default experiment; without one, 1e-6
    /// in Model Exchange]
    #[arg(long, value_name = "none|NUMBER", value_parser = tolerance)]
    tolerance: Option<Tolerance>,
    /// FMI version of the trial export of this folder's model
    #[arg(long, value_name = "2|3", hide_possible_values = true, value_parser = version())]
    fmi: Option<Version>,
    /// How the FMUs run: co-simulation, or Model Exchange by the exporter's integrator [default: co-simulation where an
    /// FMU offers it]
    #[arg(long, value_name = "cs|me", hide_possible_values = true, value_parser = interface())]
    interface: Option<Interface>,
    /// Measured inputs over time, CSV or Parquet: the time, then a column per input, headed by its name
    #[arg(long, value_name = "FILE.csv")]
    input: Option<PathBuf>,
}

/// Exports what is in the current folder for a trial, and returns the FMUs.
pub type TrialExport<'a> = &'a dyn Fn(Option<Interface>, Option<Version>) -> Result<Vec<PathBuf>>;

/// The end of an experiment, if the command line gives one, and the option that does.
#[derive(Clone, Copy)]
pub struct End {
    /// The time of the end (s).
    pub time: Option<f64>,
    /// The option's name without hyphens.
    pub option: &'static str,
}

impl Experiment {
    /// The file to run; a model of this folder is exported now.
    ///
    /// # Errors
    /// When there is none.
    pub fn subject(&self, export: TrialExport<'_>) -> Result<PathBuf> {
        match (&self.subject, self.fmi) {
            (Some(subject), Some(version)) => {
                bail!("--fmi {version}: only for the model of this folder, not for {}", subject.display())
            }
            (Some(subject), None) => Ok(subject.clone()),
            (None, version) => model_of_this_folder(export, self.interface, version),
        }
    }

    /// Runs a function with the subject's scenario and FMUs. `outputs` are the files that are written when it has returned:
    /// the FMUs are then unloaded, so that none can fail any more, and what they have changed of the process is undone.
    ///
    /// # Errors
    /// When the scenario cannot be read, a value does not fit, an output would overwrite an input, or the function fails.
    pub fn run<T>(
        &self,
        subject: &Path,
        end: End,
        outputs: &[PathBuf],
        run: impl FnOnce(Scenario, &mut LoadedFmus) -> Result<T>,
    ) -> Result<T> {
        let mut loaded = LoadedFmus::default();
        let (scenario, unpacked) = self.scenario(subject, end, &mut loaded)?;
        let with_values = || {
            let own = self.parameters.iter().chain(&self.input).cloned();
            let files: Vec<_> = inputs(&scenario).into_iter().chain(own).collect();
            writing::refuse_overlap(outputs, &files)?;
            let scenario = self.with_values(scenario, &mut loaded)?;
            run(scenario, &mut loaded)
        };
        contained(with_values).0.map_err(|error| match unpacked {
            Some(unpacked) => unpacked.named(&error),
            None => error,
        })
    }

    /// The scenario with the values of the command line.
    fn with_values(&self, mut scenario: Scenario, loaded: &mut LoadedFmus) -> Result<Scenario> {
        scenario.tolerance = self.tolerance.unwrap_or_default();
        let fmus = scenario.fmus.iter().map(|member| loaded.get(member)).collect::<Result<Vec<_>>>()?;
        let links = links(&scenario, &fmus)?;
        if let Some(path) = &self.input {
            take_inputs(&mut scenario, &links, path)?;
        }
        for (name, value) in &self.values {
            let text = format!("{name}={value}");
            let location = Location::argument(&format!("--set {text}"));
            // A name may have an equals sign, too.
            let mut splits = text.match_indices('=').map(|(place, _)| (&text[..place], &text[place + 1..]));
            let found = splits.find(|(name, _)| is_settable(&scenario, &fmus, &links, name));
            let (name, value) = found.unwrap_or((name, value));
            set(&mut scenario, &fmus, &links, name, value, &location)?;
        }
        for path in &self.parameters {
            let location = Location::argument(&format!("--parameters {}", path.display()));
            let set = ParameterSet::read(path)?;
            if set.parameters.is_empty() {
                complain(&format!("note: --parameters {}: it sets no parameters", path.display()));
                continue;
            }
            let member = location.locate(owner(&mut scenario, loaded, &set))?;
            member.parameters.push((set, location));
        }
        Ok(scenario)
    }

    /// What to run, and the temporary folders of a system's FMUs, which must outlive the run.
    fn scenario(
        &self,
        subject: &Path,
        end: End,
        loaded: &mut LoadedFmus,
    ) -> Result<(Scenario, Option<Unpacked>)> {
        let Self { fmus, step, start_time, .. } = self;
        let times = Times { start: *start_time, stop: end.time, step: *step };
        let ending = subject.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
        let (mut scenario, unpacked) = match ending.to_str() {
            Some("fmu") => {
                fmus.refuse("single FMUs")?;
                let mut scenario = system::alone(subject, times, loaded)?;
                fmus.give(&mut scenario)?;
                (scenario, None)
            }
            Some("ssp" | "ssd") => {
                fmus.refuse("systems")?;
                let (scenario, unpacked) = system::read(subject, times, loaded)?;
                (scenario, Some(unpacked))
            }
            _ => {
                if step.is_some() {
                    bail!("--step is for a system or a single FMU; {} sets its own", subject.display());
                }
                let mut scenario = Scenario::read(subject, &fmus.folder)?;
                let given =
                    [start_time.map(|time| ("start-time", time)), end.time.map(|time| (end.option, time))];
                let given: Vec<_> =
                    given.iter().flatten().map(|(option, time)| format!("--{option} {time}")).collect();
                if !given.is_empty() {
                    let start = start_time.unwrap_or(scenario.start_time);
                    let stop = end.time.unwrap_or(scenario.stop_time);
                    let location = Location::argument(&given.join(" "));
                    location.locate(scenario.run_between(start, stop))?;
                }
                fmus.give(&mut scenario)?;
                (scenario, None)
            }
        };
        if self.interface.is_some() {
            scenario.fmus.iter_mut().for_each(|member| member.interface = self.interface);
        }
        Ok((scenario, unpacked))
    }
}

/// The values of `--interface`.
fn interface() -> impl TypedValueParser<Value = Interface> {
    PossibleValuesParser::new(["cs", "me"]).try_map(|text| text.parse::<Interface>())
}

/// The values of `--fmi`.
fn version() -> impl TypedValueParser<Value = Version> {
    PossibleValuesParser::new(["2", "3"]).try_map(|text| text.parse::<Version>())
}

/// The FMU of the model in this folder, which is exported for a trial, with the interface by which it runs.
fn model_of_this_folder(
    export: TrialExport<'_>,
    interface: Option<Interface>,
    version: Option<Version>,
) -> Result<PathBuf> {
    let mut fmus = export(interface, version)?;
    if fmus.len() == 1 {
        return Ok(fmus.remove(0));
    }
    let names: Vec<_> = fmus.iter().map(|fmu| fmu.display().to_string()).collect();
    bail!("this folder has several models; name one: {}", names.join(", "))
}

/// Drives inputs by the columns of measured data.
fn take_inputs(scenario: &mut Scenario, links: &[Link], path: &Path) -> Result<()> {
    let location = Location::argument("--input");
    let data = location.locate(Data::read(path, None))?;
    for column in data.columns() {
        let name = column.name();
        if !links.iter().any(|link| link.is_from(name)) {
            let signals = links.iter().filter(|link| link.source.is_none());
            let like = like(name, signals.map(|link| link.connection.output.as_str()));
            complain(&format!("warning: --input {}: no FMU has an input {name}{like}", path.display()));
            continue;
        }
        let measured = location.locate(Measured::new(path, &data, name, false))?;
        drive(&mut scenario.inputs, name, Course::Measured(measured), &location);
    }
    Ok(())
}

/// Whether a name is that of a variable or an array that can be set, or of an input's signal.
fn is_settable(scenario: &Scenario, fmus: &[Arc<Fmu>], links: &[Link], name: &str) -> bool {
    let of_fmu = |(member, fmu): (&Member, &Arc<Fmu>)| {
        let own = name.strip_prefix(&format!("{}:", member.name)).unwrap_or(name);
        fmu.description().variable(own).is_some_and(FmuVariable::is_settable)
    };
    scenario.fmus.iter().zip(fmus).any(of_fmu)
        || links.iter().any(|link| link.is_from(name))
        || !elements(scenario, fmus, name).is_empty()
}

/// What a name and the text of its value mean.
enum Meaning<'a> {
    /// The signal of inputs.
    Signal(Signal),
    /// A variable of the member of an index, and the value that it takes.
    Variable(usize, &'a FmuVariable, Value),
    /// The elements of an array, each with the text of its value.
    Elements(Vec<(String, String)>),
}

/// Sets a variable before initialization, or an input's signal.
fn set(
    scenario: &mut Scenario,
    fmus: &[Arc<Fmu>],
    links: &[Link],
    name: &str,
    text: &str,
    location: &Location,
) -> Result<()> {
    match location.locate(meaning(scenario, fmus, links, name, text))? {
        Meaning::Signal(signal) => {
            for member in &mut scenario.fmus {
                member.inputs.retain(|input| input.name != name);
            }
            drive(&mut scenario.inputs, name, signal.into(), location);
            Ok(())
        }
        Meaning::Variable(index, variable, value) => {
            set_variable(&mut scenario.fmus[index], variable, value, location)
        }
        Meaning::Elements(values) => values
            .iter()
            .try_for_each(|(element, value)| set(scenario, fmus, links, element, value, location)),
    }
}

/// What a name and the text of its value mean.
fn meaning<'a>(
    scenario: &Scenario,
    fmus: &'a [Arc<Fmu>],
    links: &[Link],
    name: &str,
    text: &str,
) -> Result<Meaning<'a>> {
    let mut found = vec![];
    for (index, (member, fmu)) in scenario.fmus.iter().zip(fmus).enumerate() {
        let own = name.strip_prefix(&format!("{}:", member.name));
        // Connections may give a signal another name than its inputs.
        let driven = links.iter().find(|link| link.target == index && link.is_from(name));
        let driven = driven.filter(|_| own.is_none());
        let wanted = own.or(driven.map(|link| link.connection.input.as_str())).unwrap_or(name);
        if let Some(variable) = fmu.description().variable(wanted).filter(|variable| variable.is_settable()) {
            let value = fitting(variable, text, driven, fmu.description())?;
            found.push((index, variable, value, driven));
        }
    }
    match found.as_slice() {
        [] => {
            let elements = elements(scenario, fmus, name);
            if elements.is_empty() {
                bail!(not_found(scenario, fmus, name));
            }
            let values = values_of_array(elements.len(), text)?;
            Ok(Meaning::Elements(elements.into_iter().zip(values).collect()))
        }
        [(_, _, value, Some(link)), ..] if let Some(number) = value.number() => {
            let own = || link.conversion.linear().inverse().apply(number);
            Ok(Meaning::Signal(Signal::Constant(text.parse().unwrap_or_else(|_| own()))))
        }
        [(index, variable, value, _)] => Ok(Meaning::Variable(*index, variable, value.clone())),
        _ => {
            let names = found.iter().map(|(index, ..)| format!("{}:{name}", scenario.fmus[*index].name));
            bail!("ambiguous: use {}", names.collect::<Vec<_>>().join(" or "))
        }
    }
}

/// The value that a variable takes for a text, in which a plain number is in the unit of its signal if it is `driven`.
fn fitting(
    variable: &FmuVariable,
    text: &str,
    driven: Option<&Link>,
    description: &FmuDescription,
) -> Result<Value> {
    let value = match (value(variable, text)?, driven) {
        (Value::Real(number, None), Some(link)) => Value::Real(link.conversion.linear().apply(number), None),
        (value, _) => value,
    };
    if let Some(meant) = value.meant_unit(variable, description) {
        let FmuVariable { name, start, unit, .. } = variable;
        complain(&format!(
            "note: {name} = {text} {unit} is far from its start value, {start} {unit}; in {meant}: --set \"{name}={text} \
             {meant}\""
        ));
    }
    let fitted = value.fit(variable, &[], description)?;
    fitted.check_range(variable)?;
    Ok(fitted)
}

/// Sets a variable of a member before initialization, or an input throughout.
fn set_variable(
    member: &mut Member,
    variable: &FmuVariable,
    value: Value,
    location: &Location,
) -> Result<()> {
    if let (true, Some(number)) = (variable.causality == Causality::Input, value.number()) {
        drive(&mut member.inputs, &variable.name, Signal::Constant(number).into(), location);
        return Ok(());
    }
    let mut in_run_in = member.run_in.iter().flat_map(|run_in| run_in.during.iter().chain(&run_in.after));
    if in_run_in.any(|assignment| assignment.name == variable.name) {
        return Err(
            location.error(format!("the scenario sets {} in the run_in of {}", variable.name, member.name))
        );
    }
    member.values.retain(|assignment| assignment.name != variable.name);
    member.values.push(Assignment { name: variable.name.clone(), value, location: location.clone() });
    Ok(())
}

/// The elements of an array, each with the name of its FMU, which is the first that has the array.
fn elements(scenario: &Scenario, fmus: &[Arc<Fmu>], name: &str) -> Vec<String> {
    for (member, fmu) in scenario.fmus.iter().zip(fmus) {
        let own = name.strip_prefix(&format!("{}:", member.name)).unwrap_or(name);
        let elements = fmu.description().array(own).into_iter().filter(|variable| variable.is_settable());
        let elements: Vec<_> =
            elements.map(|variable| format!("{}:{}", member.name, variable.name)).collect();
        if !elements.is_empty() {
            return elements;
        }
    }
    vec![]
}

/// The values of an array's elements, separated by blanks: one each, or one for all. A unit may follow.
fn values_of_array(count: usize, text: &str) -> Result<Vec<String>> {
    let mut values: Vec<_> = text.split_whitespace().map(str::to_owned).collect();
    let is_unit = |text: &String| text.parse::<f64>().is_err() && text.parse::<bool>().is_err();
    if values.len() > 1 && values.last().is_some_and(is_unit) && !values.iter().rev().skip(1).any(is_unit) {
        let unit = values.pop().unwrap_or_default();
        for value in &mut values {
            *value += &format!(" {unit}");
        }
    }
    match &values[..] {
        [one] => Ok(vec![one.clone(); count]),
        several if several.len() == count => Ok(values),
        several => bail!("expected one value or {count}, found {}", several.len()),
    }
}

/// Parses a tolerance.
fn tolerance(text: &str) -> Result<Tolerance, String> {
    match text {
        "none" => Ok(Tolerance::Undefined),
        number => positive()(number).map(Tolerance::Given).map_err(|expected| format!("{expected}, or none")),
    }
}

/// Gives an input a course, which replaces its present one.
fn drive(inputs: &mut Vec<Input>, name: &str, course: Course, location: &Location) {
    inputs.retain(|input| input.name != name);
    inputs.push(Input { name: name.to_owned(), course, location: location.clone() });
}

fn not_found(scenario: &Scenario, fmus: &[Arc<Fmu>], name: &str) -> String {
    let mut known = vec![];
    for (member, fmu) in scenario.fmus.iter().zip(fmus) {
        let settable = fmu.description().variables.iter().filter(|variable| variable.is_settable());
        for variable in settable {
            known.push(variable.name.clone());
            known.push(format!("{}:{}", member.name, variable.name));
        }
    }
    let like = like(name, known.iter().map(String::as_str));
    format!("no FMU has a settable variable {name}{like}")
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
        ValueType::Boolean => match text.to_ascii_lowercase().as_str() {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_an_array_are_one_each_or_one_for_all() {
        for (text, expected) in [
            ("7", ["7", "7", "7"]),
            ("7 kPa", ["7 kPa", "7 kPa", "7 kPa"]),
            ("1 2  -3e2", ["1", "2", "-3e2"]),
            ("1 2 3 kPa", ["1 kPa", "2 kPa", "3 kPa"]),
            ("true false true", ["true", "false", "true"]),
            ("on off on", ["on", "off", "on"]),
        ] {
            assert_eq!(values_of_array(3, text).unwrap(), expected, "{text}");
        }
        let refused = values_of_array(3, "1 2 kPa").unwrap_err().to_string();
        assert_eq!(refused, "expected one value or 3, found 2");
    }
}
