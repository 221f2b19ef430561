//! What a scenario records, found by name among signals and variables. A name that several FMUs have is an error that
//! lists them; a pattern means all that match.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::{Result, bail};
use fmu_package::connection::Conversion;
use fmu_package::{FmuDescription, FmuVariable, Function, ValueType};
use fmu_record::Column;
use fmu_terms::{Causality, like};

use crate::importer::Fmu;
use crate::links::{Link, signal};
use crate::scenario::{Input, Scenario, Signal};

/// The columns of a record.
pub struct Columns {
    /// The columns, with what they hold.
    pub all: Vec<(Column, Found)>,
    /// The recorded names that FMUs do not have, because one was replaced.
    pub missing: Vec<String>,
}

/// What a column holds.
pub enum Found {
    Signal(Signal),
    /// A variable of a member, by its name in the FMU.
    Variable {
        member: usize,
        name: String,
    },
}

impl Columns {
    /// What a scenario records of its FMUs, by default its signals and all outputs. Names that replaced FMUs do not have
    /// become notes.
    pub fn new(
        scenario: &Scenario,
        fmus: &[Arc<Fmu>],
        links: &[Link],
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let names = Names { scenario, fmus, links };
        let mut columns = Self { all: vec![], missing: vec![] };
        if let Some(record) = &scenario.record {
            let mut seen = BTreeSet::new();
            for recorded in record {
                let name = &recorded.name;
                if !seen.insert(name) {
                    return Err(recorded.location.error(format!("{name} is already recorded")));
                }
                match recorded.location.locate(names.find_all(name)) {
                    Ok(found) => columns.add_new(found, &names),
                    Err(error) if scenario.has_replaced_fmus && !names.are_several(name) => {
                        notes.push(format!("{error:#}"));
                        columns.missing.push(name.clone());
                    }
                    Err(error) => return Err(error),
                }
            }
        } else {
            columns.add_all(&names, notes)?;
        }
        for panel in scenario.panels.iter().flatten().flatten() {
            let mut known = columns.all.iter().map(|(column, _)| column.name.as_str());
            if !columns.missing.contains(&panel.name) && !known.clone().any(|name| name == panel.name) {
                let message = format!("{} is not recorded{}", panel.name, like(&panel.name, &mut known));
                return Err(panel.location.error(message));
            }
        }
        Ok(columns)
    }

    fn add(&mut self, name: &str, found: Found, names: &Names<'_>) {
        self.all.push((found.column(name, names.fmus, names.links), found));
    }

    /// Adds columns by their names, except those that are there already.
    fn add_new(&mut self, found: Vec<(String, Found)>, names: &Names<'_>) {
        let is_pattern = found.len() > 1;
        let known = |found: &Found| match found {
            Found::Signal(_) => None,
            Found::Variable { member, name } => Some((*member, name.clone())),
        };
        let mut columns: BTreeSet<_> = self.all.iter().map(|(column, _)| column.name.clone()).collect();
        let variables: BTreeSet<_> = self.all.iter().filter_map(|(_, found)| known(found)).collect();
        for (name, found) in found {
            let is_there = is_pattern && known(&found).is_some_and(|variable| variables.contains(&variable));
            if !is_there && columns.insert(name.clone()) {
                self.add(&name, found, names);
            }
        }
    }

    /// Adds the signals and all outputs; without outputs, the local variables.
    fn add_all(&mut self, names: &Names<'_>, notes: &mut Vec<String>) -> Result<()> {
        let Names { scenario, fmus, links } = *names;
        for input in &scenario.inputs {
            self.add(&input.name, Found::Signal(signal(input, links, fmus)?), names);
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
                self.add(&column, Found::Variable { member, name: name.clone() }, names);
            }
        }
        Ok(())
    }
}

/// The names of a scenario's signals and variables.
#[derive(Clone, Copy)]
struct Names<'a> {
    scenario: &'a Scenario,
    fmus: &'a [Arc<Fmu>],
    links: &'a [Link],
}

/// What a name means.
enum Meaning<'a> {
    Signal(&'a Input),
    Variables(Vec<(usize, String)>),
}

impl<'a> Names<'a> {
    /// What a name means: a signal, else an output, else any variable. An FMU's name and a colon may precede it.
    fn meaning(&self, name: &str) -> Meaning<'a> {
        if let Some(input) = self.scenario.inputs.iter().find(|input| input.name == name) {
            return Meaning::Signal(input);
        }
        let having = |is_meant: &dyn Fn(&FmuVariable) -> bool| -> Vec<_> {
            let has = |(_, fmu): &(usize, &Arc<Fmu>)| fmu.description().variable(name).is_some_and(is_meant);
            self.fmus.iter().enumerate().filter(has).map(|(member, _)| (member, name.to_owned())).collect()
        };
        let mut found = having(&|variable| variable.causality == Causality::Output);
        if found.is_empty() {
            found = having(&|_| true);
        }
        // A name may have a colon, too.
        found.extend(self.with_member(name).filter_map(|(member, own)| {
            self.fmus[member].description().variable(own).map(|_| (member, own.to_owned()))
        }));
        Meaning::Variables(found)
    }

    /// Each reading of a name as `member:name`: the member's position and the rest.
    fn with_member<'n>(&self, name: &'n str) -> impl Iterator<Item = (usize, &'n str)> {
        let fmus = &self.scenario.fmus;
        name.match_indices(':').filter_map(move |(colon, _)| {
            let member = fmus.iter().position(|member| member.name == name[..colon])?;
            Some((member, &name[colon + 1..]))
        })
    }

    /// What `record` names: a signal or variable, the elements of an array, or the variables whose names fit a pattern, in
    /// which `*` stands for any text.
    fn find_all(&self, name: &str) -> Result<Vec<(String, Found)>> {
        let variables = match self.meaning(name) {
            Meaning::Signal(input) => {
                return Ok(vec![(name.to_owned(), Found::Signal(signal(input, self.links, self.fmus)?))]);
            }
            Meaning::Variables(variables) => variables,
        };
        match &variables[..] {
            [] => {}
            [(member, own)] => {
                return Ok(vec![(name.to_owned(), Found::Variable { member: *member, name: own.clone() })]);
            }
            _ => bail!("{}", self.ambiguous(name, &variables)),
        }
        let arrays = self.arrays(name);
        match &arrays[..] {
            [] => {}
            [(member, own)] => {
                let is_element = |variable: &FmuVariable| variable.array() == Some(own);
                return Ok(self.matching(*member, &name[..name.len() - own.len()], &is_element));
            }
            _ => bail!("{}", self.ambiguous(name, &arrays)),
        }
        let matches = self.fitting(name);
        if !matches.is_empty() {
            return Ok(matches);
        }
        // The signal for an FMU whose replacement does not have this input.
        let mut own = self.scenario.fmus.iter().flat_map(|member| &member.inputs);
        if let Some(input) = own.find(|input| input.name == name) {
            return Ok(vec![(name.to_owned(), Found::Signal(input.location.locate(input.course.plain())?))]);
        }
        if let Some((member, own)) = self.with_member(name).next() {
            self.fmus[member].variable(own)?;
        } else if let Some((member, _)) = name.split_once(':') {
            bail!("no FMU is named {member}");
        }
        let all = self.fmus.iter().flat_map(|fmu| &fmu.description().variables);
        bail!("no FMU has a variable {name}{}", like(name, all.map(|variable| variable.name.as_str())))
    }

    /// Whether several FMUs have a name.
    fn are_several(&self, name: &str) -> bool {
        let is_variable = matches!(self.meaning(name), Meaning::Variables(all) if all.len() > 1);
        is_variable || self.arrays(name).len() > 1
    }

    /// The error for a name of several variables.
    fn ambiguous(&self, name: &str, variables: &[(usize, String)]) -> String {
        let candidates =
            variables.iter().map(|(member, own)| format!("{}:{own}", self.scenario.fmus[*member].name));
        format!("several FMUs have {name}: use {}", candidates.collect::<Vec<_>>().join(" or "))
    }

    /// The arrays of a name.
    fn arrays(&self, name: &str) -> Vec<(usize, String)> {
        let all = (0..self.fmus.len()).map(|member| (member, name)).chain(self.with_member(name));
        let has = |(member, own): &(usize, &str)| {
            let mut variables = self.fmus[*member].description().variables.iter();
            variables.any(|variable| variable.array() == Some(own) && self.fmus[*member].can_tell(variable))
        };
        all.filter(has).map(|(member, own)| (member, own.to_owned())).collect()
    }

    /// The variables that fit a pattern.
    fn fitting(&self, pattern: &str) -> Vec<(String, Found)> {
        if !pattern.contains('*') {
            return vec![];
        }
        let of_member = self.with_member(pattern).next();
        match of_member {
            Some((member, own)) => {
                let prefix = &pattern[..pattern.len() - own.len()];
                self.matching(member, prefix, &|variable| fits(&variable.name, own))
            }
            None => (0..self.fmus.len())
                .flat_map(|member| self.matching(member, "", &|variable| fits(&variable.name, pattern)))
                .collect(),
        }
    }

    /// A member's variables that are meant, as columns. Without a prefix, a name that is not enough has the member's.
    fn matching(
        &self,
        member: usize,
        prefix: &str,
        is_meant: &dyn Fn(&FmuVariable) -> bool,
    ) -> Vec<(String, Found)> {
        let fmu = &self.fmus[member];
        let variables = fmu.description().variables.iter();
        let meant = variables.filter(|variable| fmu.can_tell(variable) && is_meant(variable));
        let columns = meant.map(|FmuVariable { name, .. }| {
            let is_enough =
                || matches!(self.meaning(name), Meaning::Variables(all) if all == [(member, name.clone())]);
            let column = if !prefix.is_empty() || is_enough() {
                format!("{prefix}{name}")
            } else {
                format!("{}:{name}", self.scenario.fmus[member].name)
            };
            (column, Found::Variable { member, name: name.clone() })
        });
        columns.collect()
    }
}

/// An FMU's variables of a causality that are recorded by default: the numeric ones.
fn numbers(fmu: &Fmu, causality: Causality) -> impl Iterator<Item = &FmuVariable> {
    fmu.description().of_causality(causality).filter(|variable| is_number(variable))
}

fn is_number(variable: &FmuVariable) -> bool {
    !matches!(variable.value_type(), ValueType::String | ValueType::Other)
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
