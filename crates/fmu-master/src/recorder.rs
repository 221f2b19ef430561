//! What a scenario records, found by name among signals and variables.

use std::cell::LazyCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::{Context, Result};
use fmu_package::connection::Conversion;
use fmu_package::{FmuDescription, FmuVariable, Function, ValueType};
use fmu_record::{Column, Record};
use fmu_terms::{Causality, like};

use crate::importer::{EventRow, Fmu, Instance, Selection};
use crate::links::{Link, signal};
use crate::noise::NoiseSource;
use crate::scenario::{Scenario, Signal};

/// Records rows: at communication points, and before and after the events that instances watch. There, what belongs to
/// another instance lies on the line between its own rows, or holds if it is discrete.
pub struct Recorder {
    /// The sources of the columns, each a signal or an instance.
    sources: Vec<Source>,
    /// By member.
    values: Vec<Vec<f64>>,
    /// The columns of what is read, by member.
    columns: Vec<Vec<usize>>,
    /// By member, those since the last communication point.
    events: Vec<Vec<EventRow>>,
    row: Vec<f64>,
    /// The time of the last communication point (s), if there was one, and its row.
    last: Option<f64>,
    last_row: Vec<f64>,
    /// By the index of the column.
    noise: Vec<(usize, NoiseSource)>,
    pub record: Record,
}

enum Source {
    Signal(Signal),
    Instance { member: usize, position: usize },
}

impl Recorder {
    /// Returns also what it reads of each FMU. Names that replaced FMUs do not have become notes.
    pub fn new(
        scenario: &Scenario,
        fmus: &[Arc<Fmu>],
        links: &[Link],
        notes: &mut Vec<String>,
    ) -> Result<(Self, Vec<Selection>)> {
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
            let (mut seen, mut columns) = (BTreeSet::new(), BTreeSet::new());
            for recorded in record {
                let name = &recorded.name;
                if !seen.insert(name) {
                    return Err(recorded.location.error(format!("{name} is already recorded")));
                }
                let one = recorded.location.locate(find(name, scenario, fmus, links));
                let found = one.map(|found| vec![(name.clone(), found)]).or_else(|error| {
                    let several = several(name, scenario, fmus);
                    if several.is_empty() { Err(error) } else { Ok(several) }
                });
                match found {
                    Ok(found) => {
                        for (name, found) in found {
                            if columns.insert(name.clone()) {
                                add(&name, found);
                            }
                        }
                    }
                    Err(error) if scenario.has_replaced_fmus => {
                        notes.push(format!("{error:#}"));
                        missing.push(name);
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
            let mut recorded = Causality::Output;
            if fmus.iter().all(|fmu| numbers(fmu, recorded).next().is_none()) {
                recorded = Causality::Local;
                if fmus.iter().any(|fmu| numbers(fmu, recorded).next().is_some()) {
                    notes.push("there are no outputs: local variables are recorded instead".to_owned());
                }
            }
            for variable in fmus.iter().flat_map(|fmu| numbers(fmu, recorded)) {
                *counts.entry(&variable.name).or_default() += 1;
            }
            for (member, fmu) in fmus.iter().enumerate() {
                for FmuVariable { name, .. } in numbers(fmu, recorded) {
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
        let noise = measurement_noise(scenario, &columns, &missing)?;
        let selections = names
            .iter()
            .zip(fmus)
            .map(|(names, fmu)| fmu.select_with_texts(names.iter().map(String::as_str)));
        let selections = selections.collect::<Result<_>>()?;
        let mut columns_of: Vec<_> = names.iter().map(|names| vec![0; names.len()]).collect();
        for (column, source) in sources.iter().enumerate() {
            if let Source::Instance { member, position } = *source {
                columns_of[member][position] = column;
            }
        }
        let recorder = Self {
            values: names.iter().map(|names| vec![0.0; names.len()]).collect(),
            columns: columns_of,
            events: names.iter().map(|_| vec![]).collect(),
            row: vec![0.0; sources.len()],
            last: None,
            last_row: vec![0.0; sources.len()],
            noise,
            record: Record::new(columns),
            sources,
        };
        Ok((recorder, selections))
    }

    /// Records a row at a communication point (s), from the instances in their order, after those at events before it.
    pub fn take<'a>(&mut self, time: f64, instances: impl Iterator<Item = &'a mut Instance>) -> Result<()> {
        for (member, instance) in instances.enumerate() {
            self.values[member].copy_from_slice(instance.read_watched()?);
            self.events[member] = instance.take_events();
            for (position, texts) in instance.watched_texts() {
                self.record.add_texts(self.columns[member][position], texts);
            }
        }
        for (value, source) in self.row.iter_mut().zip(&self.sources) {
            *value = match source {
                Source::Signal(signal) => signal.at(time),
                Source::Instance { member, position } => self.values[*member][*position],
            };
        }
        for (column, source) in &mut self.noise {
            self.row[*column] += source.draw();
        }
        // Those of a run-in precede the record.
        if let Some(last) = self.last
            && self.events.iter().any(|rows| !rows.is_empty())
        {
            for (time, row) in self.at_events((last, time)) {
                self.record.push_event(time, &row);
            }
        }
        self.record.push(time, &self.row);
        self.last = Some(time);
        std::mem::swap(&mut self.row, &mut self.last_row);
        Ok(())
    }

    /// The rows at the members' events between two communication points (s).
    fn at_events(&mut self, (begin, end): (f64, f64)) -> Vec<(f64, Vec<f64>)> {
        for row in self.events.iter_mut().flatten() {
            // Rounding may put them beside.
            row.time = row.time.max(begin).min(end);
        }
        let this = &*self;
        let mut times: Vec<_> = this.events.iter().flatten().map(|row| row.time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let course = |column| LazyCell::new(move || this.course(column, (begin, end)));
        let courses: Vec<_> = (0..this.sources.len()).map(course).collect();
        let mut rows = vec![];
        for time in times {
            let at_time = |rows: &Vec<EventRow>| {
                let first = rows.partition_point(|row| row.time < time);
                first..rows.partition_point(|row| row.time <= time)
            };
            let at_time: Vec<_> = this.events.iter().map(|rows| &rows[at_time(rows)]).collect();
            let mut count = at_time.iter().map(|rows| rows.len()).max().unwrap_or_default();
            // The row of the communication point is the one after an event there.
            if time >= end && at_time.iter().all(|rows| rows.last().is_none_or(|row| row.is_after)) {
                count -= 1;
            }
            for index in 0..count {
                let value = |(column, course): (usize, &LazyCell<_, _>)| match this.own(column) {
                    Some((member, position)) if !at_time[member].is_empty() => {
                        let rows = at_time[member];
                        rows[index.min(rows.len() - 1)].values[position]
                    }
                    _ => Signal::at(course, time),
                };
                rows.push((time, courses.iter().enumerate().map(value).collect::<Vec<_>>()));
            }
        }
        rows
    }

    /// The member and position that a column's values are read from at events; none where they are not.
    fn own(&self, column: usize) -> Option<(usize, usize)> {
        match self.sources[column] {
            // A measurement with noise is taken at communication points.
            Source::Instance { member, position } if self.noise.iter().all(|(noisy, _)| *noisy != column) => {
                Some((member, position))
            }
            _ => None,
        }
    }

    /// The course of a column between two communication points (s), with its own member's events in between.
    fn course(&self, column: usize, (begin, end): (f64, f64)) -> Signal {
        if let Source::Signal(signal) = &self.sources[column] {
            return signal.clone();
        }
        let mut points = vec![(begin, self.last_row[column])];
        if let Some((member, position)) = self.own(column) {
            points.extend(self.events[member].iter().map(|row| (row.time, row.values[position])));
        }
        points.push((end, self.row[column]));
        if self.record.columns()[column].is_discrete { Signal::Steps(points) } else { Signal::Lines(points) }
    }
}

/// The noise on columns; that on names which are missing is left out.
fn measurement_noise(
    scenario: &Scenario,
    columns: &[Column],
    missing: &[&String],
) -> Result<Vec<(usize, NoiseSource)>> {
    let mut noise = vec![];
    for measured in &scenario.measurement_noise {
        if missing.contains(&&measured.name) {
            continue;
        }
        let Some(column) = columns.iter().position(|column| column.name == measured.name) else {
            let known = columns.iter().map(|column| column.name.as_str());
            let message = format!("{} is not recorded{}", measured.name, like(&measured.name, known));
            return Err(measured.location.error(message));
        };
        if columns[column].is_text {
            return Err(measured
                .location
                .error(format!("{} is a String, which has no noise", measured.name)));
        }
        noise.push((column, NoiseSource::new(measured)?));
    }
    Ok(noise)
}

/// An FMU's variables of a causality that are recorded by default: the numeric ones.
fn numbers(fmu: &Fmu, causality: Causality) -> impl Iterator<Item = &FmuVariable> {
    fmu.description().of_causality(causality).filter(|variable| is_number(variable))
}

fn is_number(variable: &FmuVariable) -> bool {
    !matches!(variable.value_type(), ValueType::String | ValueType::Other)
}

/// Resolves what `record` names if it is no variable: the elements of an array, or the variables whose names fit a
/// pattern, in which `*` stands for any text. Each is of the first FMU that has it.
fn several(name: &str, scenario: &Scenario, fmus: &[Arc<Fmu>]) -> Vec<(String, Found)> {
    let (only, wanted) = match name.split_once(':') {
        Some((member, name)) if scenario.fmus.iter().any(|known| known.name == member) => {
            (Some(member), name)
        }
        _ => (None, name),
    };
    let is_wanted = |variable: &FmuVariable, fmu: &Fmu| {
        fmu.can_tell(variable)
            && (variable.array() == Some(wanted) || wanted.contains('*') && fits(&variable.name, wanted))
    };
    let mut found = vec![];
    for (index, (member, fmu)) in scenario.fmus.iter().zip(fmus).enumerate() {
        if only.is_none_or(|only| only == member.name) {
            let wanted = fmu.description().variables.iter().filter(|variable| is_wanted(variable, fmu));
            found.extend(wanted.map(|variable| {
                let column =
                    only.map_or_else(|| variable.name.clone(), |only| format!("{only}:{}", variable.name));
                (column, Found::Variable { member: index, name: variable.name.clone() })
            }));
        }
    }
    found
}

/// Whether a name fits a pattern, in which `*` stands for any text.
fn fits(name: &str, pattern: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|begin| name.strip_prefix(begin)) else { return false };
    let mut parts = parts.peekable();
    while let Some(part) = parts.next() {
        if parts.peek().is_none() {
            return rest.ends_with(part);
        }
        let Some(place) = rest.find(part) else { return false };
        rest = &rest[place + part.len()..];
    }
    rest.is_empty()
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
    let is_output = |fmu: &Arc<Fmu>| fmu.names(Causality::Output).any(|output| output == name);
    let is_known = |fmu: &Arc<Fmu>| fmu.description().variable(name).is_some();
    let member = fmus.iter().position(is_output).or_else(|| fmus.iter().position(is_known));
    // A name may have a colon, too.
    if let (None, Some((member, name))) = (member, name.split_once(':')) {
        let index = scenario.fmus.iter().position(|known| known.name == member);
        let index = index.with_context(|| format!("no FMU is named {member}"))?;
        fmus[index].variable(name)?;
        return Ok(Found::Variable { member: index, name: name.to_owned() });
    }
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
                    links.iter().filter(|link| link.is_from(name) && link.conversion == Function::IDENTITY);
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
        display_unit: description.display_unit(variable),
        is_discrete: variable.is_discrete(),
        is_text: variable.value_type() == ValueType::String,
        items: match variable.value_type() {
            ValueType::Boolean => vec![("false".to_owned(), 0), ("true".to_owned(), 1)],
            ValueType::Enumeration => enumeration().map_or_else(Vec::new, |found| found.items.clone()),
            _ => vec![],
        },
        ..Column::from((name, variable.unit.as_str()))
    }
}
