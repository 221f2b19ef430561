//! Scenarios from other files: a single FMU, or the system in an .ssp with its connections, start values and parameter
//! sets.

use std::path::Path;

use anyhow::{Context, Error, Result, bail};
use fmu_io::reading;
use fmu_io::temporary::Folder;
use fmu_io::terminal::{complain, number};
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{
    ConnectorDescription, FmuDescription, Kind, Linear, ParameterSet, SystemDescription, Unit, Value,
};

use crate::importer::extract;
use crate::scenario::{Input, Location, Member, Scenario, Signal};

/// The structure that every package has (SSP, section 3).
const STRUCTURE: &str = "SystemStructure.ssd";
/// The number of steps for an FMU without a step size, the same as in `fmpy simulate`.
const STEPS: f64 = 500.0;

/// The duration of a run whose end nothing defines (s), the same as in `fmpy simulate`.
const DURATION: f64 = 1.0;

/// Start, stop and communication step of a run (s); none if unspecified.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// The start; by default 0.
    pub start: Option<f64>,
    /// The end; by default 1 s after the start.
    pub stop: Option<f64>,
    /// The communication step; by default a 500th of the run.
    pub step: Option<f64>,
}

impl Times {
    /// These times, else others.
    fn or(self, other: Self) -> Self {
        Self {
            start: self.start.or(other.start),
            stop: self.stop.or(other.stop),
            step: self.step.or(other.step),
        }
    }

    fn scenario(self, title: &str) -> Result<Scenario> {
        let start = self.start.unwrap_or(0.0);
        let stop = self.stop.unwrap_or_else(|| {
            let stop = start + DURATION;
            complain(&format!("note: {title} defines no stop time: it runs to {} s", number(stop)));
            stop
        });
        if stop <= start {
            bail!("the stop time, {} s, is not after the start time, {} s", number(stop), number(start));
        }
        let step = self.step.unwrap_or((stop - start) / STEPS);
        if step <= 0.0 || !step.is_finite() {
            bail!("the communication step is {} s", number(step));
        }
        let mut scenario = Scenario {
            title: Some(title.to_owned()),
            step,
            start_time: start,
            stop_time: stop,
            ..Scenario::default()
        };
        scenario.end_at(stop)?;
        Ok(scenario)
    }
}

/// One FMU on its own. Times that are not given are those of its default experiment. Its outputs are recorded.
///
/// # Errors
/// When its modelDescription.xml cannot be read, or the run does not end after it starts.
pub fn alone(path: &Path, times: Times) -> Result<Scenario> {
    let description = FmuDescription::read(path)?;
    let time = |name: &str| {
        let value = description.default_experiment.iter().find(|(known, _)| known == name);
        value.and_then(|(_, text)| text.trim().parse().ok())
    };
    let own = Times { start: time("startTime"), stop: time("stopTime"), step: time("stepSize") };
    let name = description.attribute("modelName");
    let mut scenario = times.or(own).scenario(name).with_context(|| path.display().to_string())?;
    scenario.fmus.push(Member::new(name, path, Location::argument(&path.display().to_string())));
    scenario.files.push(path.to_owned());
    Ok(scenario)
}

/// The system in an SSP package (`.ssp`), and the temporary folder with its FMUs: keep it while the scenario is in use.
///
/// # Errors
/// When the package or an FMU in it cannot be read, connected units do not convert, a parameter set of
/// the system sets something other than its inputs, or the run does not end after it starts.
pub fn read(path: &Path, times: Times) -> Result<(Scenario, Folder)> {
    let folder = extract(path, |_| true).with_context(|| format!("cannot read {}", path.display()))?;
    let scenario =
        of_structure(folder.path(), times).with_context(|| format!("the system in {}", path.display()));
    let mut scenario = scenario.map_err(|error| named(&error, path, &folder))?;
    scenario.files.push(path.to_owned());
    Ok((scenario, folder))
}

/// An error of a system's run, in which the package's path replaces that of the folder it was extracted to.
#[must_use]
pub fn named(error: &Error, package: &Path, folder: &Folder) -> Error {
    let [package, folder] = [package, folder.path()].map(|path| path.display().to_string());
    Error::msg(format!("{error:#}").replace(&folder, &package))
}

fn of_structure(folder: &Path, times: Times) -> Result<Scenario> {
    let text = reading::text(&folder.join(STRUCTURE)).with_context(|| format!("it has no {STRUCTURE}"))?;
    let system = SystemDescription::parse(&text).with_context(|| format!("its {STRUCTURE}"))?;
    let own = Times { start: system.start_time, stop: system.stop_time, step: system.step_size };
    let mut scenario = times.or(own).scenario(&system.name)?;
    let mut descriptions = vec![];
    for component in &system.components {
        let file = folder.join(&component.source);
        let location = Location::argument(&format!("the component {}", component.name));
        let mut member = Member::new(&component.name, &file, location.clone());
        for source in &component.parameter_sets {
            let set = location.locate(ParameterSet::read(&folder.join(source)).map_err(Into::into))?;
            member.parameters.push((set, location.clone()));
        }
        let description = FmuDescription::read(&file).and_then(FmuDescription::scalars);
        descriptions.push(location.locate(description.map_err(Into::into))?);
        scenario.fmus.push(member);
    }
    // The unit of a component's connector is the structure's, else the FMU's.
    let unit = |component: Option<&str>, connector: &str| -> Option<Unit> {
        let index = component.map(|name| system.components.iter().position(|known| known.name == name));
        let (connectors, description): (&[ConnectorDescription], _) = match index {
            None => (&system.connectors, None),
            Some(index) => (&system.components[index?].connectors, Some(&descriptions[index?])),
        };
        let declared = connectors.iter().find(|known| known.name == connector)?;
        let own = description.and_then(|description| {
            description.variable(connector).and_then(|variable| description.unit(&variable.unit))
        });
        system.units.iter().find(|unit| unit.name == declared.unit).cloned().or(own)
    };
    let mut connections = vec![];
    for connection in &system.connections {
        let (start, end) = (&connection.start, &connection.end);
        // System outputs drive nothing.
        let Some(target) = &end.component else { continue };
        let units = [start, end].map(|end| unit(end.component.as_deref(), &end.connector));
        let by_units = match units.map(|unit| unit.and_then(|unit| unit.base)) {
            [Some(from), Some(to)] if connection.converts_units => from.to(&to).with_context(|| {
                format!("{} and {} have units that do not convert", start.connector, end.connector)
            })?,
            _ => Linear::IDENTITY,
        };
        connections.push(Connection {
            source: start.component.clone(),
            output: start.connector.clone(),
            target: target.clone(),
            input: end.connector.clone(),
            conversion: Conversion::Function(by_units.then(connection.transformation)),
            location: Location::argument(&format!("the connections of {}", system.name)),
        });
    }
    scenario.connections = Some(connections);
    let starts = system.parameter_sets.iter().map(|source| ParameterSet::read(&folder.join(source)));
    for set in starts.collect::<Result<Vec<_>, _>>()? {
        for parameter in &set.parameters {
            take_start(&mut scenario, &system, &set, &parameter.name, &parameter.value)?;
        }
    }
    Ok(scenario)
}

/// Holds a system input at its start value.
fn take_start(
    scenario: &mut Scenario,
    system: &SystemDescription,
    set: &ParameterSet,
    name: &str,
    value: &Value,
) -> Result<()> {
    let connector = system.connectors.iter().find(|connector| connector.name == name);
    let Some(connector) = connector.filter(|connector| connector.kind == Some(Kind::Input)) else {
        bail!("the parameter set {} is for the system, which has no input {name}", set.name);
    };
    let base = |unit: &str| {
        let known = set.units.iter().chain(&system.units).find(|known| known.name == unit);
        known.and_then(|unit| unit.base)
    };
    let number = match value {
        Value::Real(value, Some(unit)) if *unit != connector.unit => {
            let conversion = base(unit).zip(base(&connector.unit)).and_then(|(from, to)| from.to(&to));
            let conversion = conversion.with_context(|| {
                format!("the unit {unit} of {name} does not convert to {}", connector.unit)
            })?;
            conversion.apply(*value)
        }
        value => value.number().with_context(|| format!("{name} is not a number: {value}"))?,
    };
    let mut connections = scenario.connections.iter().flatten();
    if !connections.any(|connection| connection.source.is_none() && connection.output == name) {
        // It drives nothing.
        return Ok(());
    }
    let location = Location::argument(&format!("the system's {name}"));
    scenario.inputs.retain(|input| input.name != name);
    scenario.inputs.push(Input { name: name.to_owned(), course: Signal::Constant(number).into(), location });
    Ok(())
}
