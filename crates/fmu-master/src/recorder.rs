//! What a scenario records, found by name among signals and variables.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::{Context, Result};
use fmu_package::connection::Conversion;
use fmu_package::{FmuDescription, FmuVariable, Linear, ValueType};
use fmu_record::{Column, Record};
use fmu_terms::{Causality, like};

use crate::importer::{Fmu, Instance, Selection};
use crate::links::{Link, signal};
use crate::noise::NoiseSource;
use crate::scenario::{Scenario, Signal};

/// Records rows.
pub struct Recorder {
    /// The sources of the columns, each a signal or an instance.
    sources: Vec<Source>,
    selections: Vec<(Selection, Vec<f64>)>,
    row: Vec<f64>,
    /// By the index of the column.
    noise: Vec<(usize, NoiseSource)>,
    pub record: Record,
}

enum Source {
    Signal(Signal),
    Instance { member: usize, position: usize },
}

impl Recorder {
    /// Names that replaced FMUs do not have become notes.
    pub fn new(
        scenario: &Scenario,
        fmus: &[Arc<Fmu>],
        links: &[Link],
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let mut names = vec![vec![]; fmus.len()];
        let mut sources = vec![];
        let mut columns = vec![];
        let mut add = |name: &str, found: Found| {
            let column = found.column(name, fmus, links);
            let source = match found {
                Found::Signal(signal) => Source::Signal(signal),
                Found::Variable { member, name } => {
                    names[member].push(name);
                    Source::Instance { member, position: names[member].len() - 1 }
                }
            };
            sources.push(source);
            columns.push(column);
        };
        let mut missing = vec![];
        if let Some(record) = &scenario.record {
            let mut seen = BTreeSet::new();
            for recorded in record {
                if !seen.insert(&recorded.name) {
                    return Err(recorded.location.error(format!("{} is already recorded", recorded.name)));
                }
                match recorded.location.locate(find(&recorded.name, scenario, fmus, links)) {
                    Ok(found) => add(&recorded.name, found),
                    Err(error) if scenario.has_replaced_fmus => {
                        notes.push(format!("{error:#}"));
                        missing.push(&recorded.name);
                    }
                    Err(error) => return Err(error),
                }
            }
        } else {
            for input in &scenario.inputs {
                add(&input.name, Found::Signal(signal(input, links, fmus)?));
            }
            let signals = scenario.inputs.iter().map(|input| input.name.as_str());
            let mut counts: BTreeMap<&str, usize> = signals.map(|name| (name, 1)).collect();
            for variable in fmus.iter().flat_map(|fmu| number_outputs(fmu)) {
                *counts.entry(&variable.name).or_default() += 1;
            }
            for (member, fmu) in fmus.iter().enumerate() {
                for FmuVariable { name, .. } in number_outputs(fmu) {
                    let column = match counts.get(name.as_str()) {
                        Some(2..) => format!("{}:{name}", scenario.fmus[member].name),
                        _ => name.clone(),
                    };
                    add(&column, Found::Variable { member, name: name.clone() });
                }
            }
        }
        for panel in scenario.panels.iter().flatten().flatten() {
            let mut known = columns.iter().map(|column| column.name.as_str());
            if !missing.contains(&&panel.name) && !known.clone().any(|name| name == panel.name) {
                let message = format!("{} is not recorded{}", panel.name, like(&panel.name, &mut known));
                return Err(panel.location.error(message));
            }
        }
        let mut noise = vec![];
        let noises = scenario.measurement_noise.iter().filter(|noise| !missing.contains(&&noise.name));
        for measured in noises {
            let Some(column) = columns.iter().position(|column| column.name == measured.name) else {
                let known = columns.iter().map(|column| column.name.as_str());
                let message = format!("{} is not recorded{}", measured.name, like(&measured.name, known));
                return Err(measured.location.error(message));
            };
            noise.push((column, NoiseSource::new(measured)?));
        }
        let selections = names.iter().zip(fmus).map(|(names, fmu)| {
            let selection = fmu.select(names.iter().map(String::as_str))?;
            Ok((selection, vec![0.0; names.len()]))
        });
        let selections = selections.collect::<Result<_>>()?;
        Ok(Self { selections, row: vec![0.0; sources.len()], noise, record: Record::new(columns), sources })
    }

    /// Records a row at a time (s), from the instances in their order.
    pub fn take<'a>(&mut self, time: f64, instances: impl Iterator<Item = &'a mut Instance>) -> Result<()> {
        for (instance, (selection, values)) in instances.zip(&mut self.selections) {
            instance.read(selection, values)?;
        }
        for (value, source) in self.row.iter_mut().zip(&self.sources) {
            *value = match source {
                Source::Signal(signal) => signal.at(time),
                Source::Instance { member, position } => self.selections[*member].1[*position],
            };
        }
        for (column, source) in &mut self.noise {
            self.row[*column] += source.draw();
        }
        self.record.push(time, &self.row);
        Ok(())
    }
}

/// An FMU's recordable outputs: the numeric ones.
fn number_outputs(fmu: &Fmu) -> impl Iterator<Item = &FmuVariable> {
    let is_number =
        |variable: &&FmuVariable| !matches!(variable.value_type(), ValueType::String | ValueType::Other);
    fmu.description().of_causality(Causality::Output).filter(is_number)
}

enum Found {
    Signal(Signal),
    Variable { member: usize, name: String },
}

/// Resolves a name in `record`: a signal, else an output, else any variable. An FMU's name and a colon may precede it.
fn find(name: &str, scenario: &Scenario, fmus: &[Arc<Fmu>], links: &[Link]) -> Result<Found> {
    if let Some(input) = scenario.inputs.iter().find(|input| input.name == name) {
        return signal(input, links, fmus).map(Found::Signal);
    }
    if let Some((member, name)) = name.split_once(':') {
        let index = scenario.fmus.iter().position(|known| known.name == member);
        let index = index.with_context(|| format!("no FMU is named {member}"))?;
        fmus[index].variable(name)?;
        return Ok(Found::Variable { member: index, name: name.to_owned() });
    }
    let is_output = |fmu: &Arc<Fmu>| fmu.names(Causality::Output).any(|output| output == name);
    let is_known = |fmu: &Arc<Fmu>| fmu.description().variable(name).is_some();
    let member = fmus.iter().position(is_output).or_else(|| fmus.iter().position(is_known));
    // The signal for an FMU whose replacement does not have this input.
    let mut own = scenario.fmus.iter().flat_map(|member| &member.inputs);
    if let (None, Some(input)) = (member, own.find(|input| input.name == name)) {
        return input.location.locate(input.course.plain()).map(Found::Signal);
    }
    let member = member.with_context(|| {
        let all = fmus.iter().flat_map(|fmu| &fmu.description().variables);
        format!("no FMU has a variable {name}{}", like(name, all.map(|variable| variable.name.as_str())))
    })?;
    Ok(Found::Variable { member, name: name.to_owned() })
}

impl Found {
    /// The column: a variable's as the FMU declares it, a signal's as the first FMU that takes it unchanged does, with
    /// a unit if any does.
    fn column(&self, name: &str, fmus: &[Arc<Fmu>], links: &[Link]) -> Column {
        let declared = |index: usize, name: &str| {
            let description = fmus[index].description();
            Some((description, description.variable(name)?))
        };
        let found: Vec<_> = match self {
            Self::Variable { member, name } => declared(*member, name).into_iter().collect(),
            Self::Signal(_) => {
                let takers =
                    links.iter().filter(|link| link.is_from(name) && link.conversion == Linear::IDENTITY);
                takers.filter_map(|link| declared(link.target, &link.connection.input)).collect()
            }
        };
        let with_unit = found.iter().find(|(_, variable)| !variable.unit.is_empty());
        if let Some((description, variable)) = with_unit.or_else(|| found.first()) {
            return column_of(name, variable, description);
        }
        let mut given =
            links.iter().filter(|link| link.is_from(name)).map(|link| &link.connection.conversion);
        let unit = given.find_map(|conversion| match conversion {
            Conversion::Units { from, .. } => from.as_deref(),
            Conversion::Function(_) => None,
        });
        Column::from((name, unit.unwrap_or_default()))
    }
}

/// A column of this name for values of a variable.
#[must_use]
pub fn column_of(name: &str, variable: &FmuVariable, description: &FmuDescription) -> Column {
    let enumeration = || description.enumeration(&variable.declared_type);
    Column {
        display_unit: description.display_unit(variable).cloned(),
        is_discrete: variable.is_discrete(),
        items: match variable.value_type() {
            ValueType::Boolean => vec![("false".to_owned(), 0), ("true".to_owned(), 1)],
            ValueType::Enumeration => enumeration().map_or_else(Vec::new, |found| found.items.clone()),
            _ => vec![],
        },
        ..Column::from((name, variable.unit.as_str()))
    }
}
