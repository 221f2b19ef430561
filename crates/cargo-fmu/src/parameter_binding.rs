//! FMUs with parameter sets: writes an SSP package for each FMU, which binds the sets to the FMU and exposes its Real
//! inputs and outputs as those of the system.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use fmu_io::{reading, writing};
use fmu_package::{
    Connection, Connector, End, FmuDescription, FmuVariable, Kind, ParameterSet, Placement, System,
    SystemComponent, SystemPackage, SystemStructure, ValueType,
};
use fmu_terms::Interface;

use super::export::{Plan, say};

/// The distance between connectors in mm, and the component's width.
const PITCH: f64 = 10.0;
const WIDTH: f64 = 60.0;

/// Exports FMUs, and writes `MODEL.ssp` for each FMU that has parameter sets.
pub fn export(plan: &Plan, files: &[PathBuf]) -> Result<()> {
    let sets: Vec<_> =
        files.iter().map(|file| Ok((file, ParameterSet::read(file)?))).collect::<Result<_>>()?;
    let systems: Vec<_> = plan
        .folders()
        .iter()
        .flat_map(|folder| plan.models().map(|model| folder.join(format!("{model}.ssp"))))
        .collect();
    let written = plan.run(files, if files.is_empty() { &[] } else { &systems })?;

    let mut bound: BTreeMap<PathBuf, (FmuDescription, Vec<(String, ParameterSet)>)> = BTreeMap::new();
    for (file, set) in sets {
        let failed = || format!("the parameter set {} cannot be bound", file.display());
        let name = file.file_name().and_then(|name| name.to_str()).context("the file's name is not text")?;
        for (fmu, description) in owners(&written, &set).with_context(failed)? {
            let set = set.fit(&description).with_context(failed)?;
            bound.entry(fmu).or_insert_with(|| (description, vec![])).1.push((name.to_owned(), set));
        }
    }
    for (fmu, (description, sets)) in bound {
        if description.interface(Interface::CoSimulation).is_none() {
            bail!(
                "{}: a package with parameter sets needs co-simulation, which this FMU does not offer",
                fmu.display()
            );
        }
        let package = package(&description, reading::bytes(&fmu)?, sets);
        let system = fmu.with_extension("ssp");
        writing::write(&system, |writer| package.write(writer))?;
        say(&system, "")?;
    }
    Ok(())
}

/// The FMUs with a set's parameters, of each FMI version the first one written, and their descriptions.
fn owners(written: &[PathBuf], set: &ParameterSet) -> Result<BTreeMap<PathBuf, FmuDescription>> {
    let first = set.parameters.first().context("it contains no parameters")?;
    let mut owners = BTreeMap::<PathBuf, FmuDescription>::new();
    let mut names = vec![];
    for fmu in written {
        let description = FmuDescription::read(fmu)?;
        names.push(description.attribute("modelName").to_owned());
        let is_first = owners.keys().all(|owner| owner.parent() != fmu.parent());
        if is_first && description.variable(&first.name).is_some() {
            owners.insert(fmu.clone(), description);
        }
    }
    if !owners.is_empty() {
        return Ok(owners);
    }
    bail!("none of {} has a variable {}", names.join(", "), first.name)
}

/// An FMU's package with parameter sets.
fn package(fmu: &FmuDescription, bytes: Vec<u8>, sets: Vec<(String, ParameterSet)>) -> SystemPackage {
    let name = fmu.co_simulation_identifier().unwrap_or("Model").to_owned();
    let of_kind = |kind: Kind| {
        let variables: Vec<_> = fmu
            .of_causality(kind.causality())
            .filter(|variable| variable.value_type() == ValueType::Real && variable.dimensions.is_empty())
            .collect();
        let pitch = 1.0 / (variables.len() + 1) as f64;
        let connectors: Vec<_> = variables
            .into_iter()
            .enumerate()
            .map(|(index, variable)| connector(variable, kind, 1.0 - (index + 1) as f64 * pitch))
            .collect();
        connectors
    };
    let connectors = [of_kind(Kind::Input), of_kind(Kind::Output)];
    let height = PITCH * (connectors.iter().map(Vec::len).max().unwrap_or(0) + 1) as f64;
    let connectors = connectors.concat();
    let experiment = |name: &str, default: f64| {
        let given = fmu.default_experiment.iter().find(|(known, _)| known == name);
        given.and_then(|(_, text)| text.parse().ok()).unwrap_or(default)
    };
    let source = format!("resources/{name}.fmu");
    let sets: Vec<_> =
        sets.into_iter().map(|(file, set)| (format!("resources/{file}"), set.to_xml())).collect();
    let structure = SystemStructure {
        description: fmu.attribute("description").to_owned(),
        system: System {
            name: name.clone(),
            connections: connectors.iter().map(|connector| connection(&name, connector)).collect(),
            components: vec![SystemComponent {
                name: format!("{name}_instance"),
                source: source.clone(),
                connectors: connectors
                    .iter()
                    .map(|connector| Connector { start: None, ..connector.clone() })
                    .collect(),
                placement: Placement { lower_left: (0.0, 0.0), upper_right: (WIDTH, height) },
                parameter_sets: sets.iter().map(|(path, _)| path.clone()).collect(),
            }],
            connectors,
        },
        units: fmu.units.clone(),
        start_time: experiment("startTime", 0.0),
        stop_time: experiment("stopTime", 1.0),
        step_size: experiment("stepSize", 0.01),
        name,
    };
    let sets = sets.into_iter().map(|(path, text)| (path, text.into_bytes()));
    SystemPackage {
        structure,
        variants: vec![],
        resources: [(source, bytes)].into_iter().chain(sets).collect(),
    }
}

fn connector(variable: &FmuVariable, kind: Kind, height: f64) -> Connector {
    Connector {
        name: variable.name.clone(),
        kind,
        value_type: ValueType::Real,
        unit: variable.unit.clone(),
        start: variable.start.parse().ok().filter(|_| kind == Kind::Input),
        place: (if kind == Kind::Input { 0.0 } else { 1.0 }, height),
    }
}

/// Connects the system's connector with the component's.
fn connection(system: &str, connector: &Connector) -> Connection {
    let outside = End { component: None, connector: connector.name.clone() };
    let inside = End { component: Some(format!("{system}_instance")), connector: connector.name.clone() };
    let (start, end) = if connector.kind == Kind::Input { (outside, inside) } else { (inside, outside) };
    Connection { start, end, transformation: None, corners: vec![] }
}
