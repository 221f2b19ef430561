//! The connections of a scenario between its FMUs, with their conversions.
//!
//! Without connections of its own, a scenario connects each output to the inputs of the same name at other FMUs, and
//! each signal to the inputs of its name. If the declared units differ, values are converted, as in connections of
//! System Structure and Parameterization 1.0.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, Result};
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{FmuVariable, Linear, Unit, unit_conversion};
use fmu_terms::{Causality, like};

use crate::importer::Fmu;
use crate::scenario::{Input, Member, Scenario, Signal};

/// A connection between FMUs that have its ends.
#[derive(Clone, Debug)]
pub struct Link {
    /// The connection, by names.
    pub connection: Connection,
    /// The position of the source among the scenario's FMUs; none for a signal.
    pub source: Option<usize>,
    /// The position of the target.
    pub target: usize,
    /// From the output's value to the input's.
    pub conversion: Linear,
}

/// The connections of a scenario with its FMUs, in their order.
///
/// # Errors
/// When an FMU or variable is missing, an input has two sources, or units do not convert; the message names the place.
pub fn links(scenario: &Scenario, fmus: &[Arc<Fmu>]) -> Result<Vec<Link>> {
    let given = scenario.connections.as_deref().map(Cow::Borrowed);
    let connections = given.unwrap_or_else(|| by_name(scenario, fmus).into());
    let mut links: Vec<Link> = vec![];
    let mut places = BTreeMap::new();
    for connection in connections.iter() {
        // By name, a signal would drive what another FMU drives already; the master refuses it.
        let is_signal = scenario.connections.is_none() && connection.source.is_none();
        if let Some(other) = places.insert((connection.to(), is_signal), connection) {
            let [one, two] = [other, connection].map(Connection::from);
            let line = other.location.line().map_or_else(String::new, |line| format!(", in line {line}"));
            let message = format!("{} has two sources: {one}{line}, and {two}", connection.to());
            return Err(connection.location.error(message));
        }
        links.push(connection.location.locate(Link::new(connection, &scenario.fmus, fmus))?);
    }
    Ok(links)
}

/// Each output to the inputs of its name at other FMUs, unless a signal of its own drives one; and each input to a
/// signal of its name.
fn by_name(scenario: &Scenario, fmus: &[Arc<Fmu>]) -> Vec<Connection> {
    let members = || scenario.fmus.iter().zip(fmus);
    let connection = |source: Option<&Member>, target: &Member, name: &str| Connection {
        source: source.map(|member| member.name.clone()),
        output: name.to_owned(),
        target: target.name.clone(),
        input: name.to_owned(),
        conversion: Conversion::DECLARED,
        location: target.location.clone(),
    };
    let mut connections = vec![];
    for (member, fmu) in members() {
        for name in fmu.names(Causality::Input) {
            connections.push(connection(None, member, name));
            if member.inputs.iter().any(|input| input.name == name) {
                continue;
            }
            let others = members().filter(|(other, _)| other.name != member.name);
            let givers =
                others.filter(|(_, other)| other.names(Causality::Output).any(|output| output == name));
            connections.extend(givers.map(|(giver, _)| connection(Some(giver), member, name)));
        }
    }
    connections
}

impl Link {
    fn new(connection: &Connection, members: &[Member], fmus: &[Arc<Fmu>]) -> Result<Self> {
        let find = |fmu: &str, name: &str, causality: Causality| {
            let index = members.iter().position(|member| member.name == fmu).with_context(|| {
                let names = members.iter().map(|member| member.name.as_str());
                format!("there is no FMU {fmu}{}", like(fmu, names))
            })?;
            let description = fmus[index].description();
            let found = description.of_causality(causality).find(|variable| variable.name == name);
            let variable = found.with_context(|| {
                format!("{fmu} has no {causality} {name}{}", like(name, fmus[index].names(causality)))
            })?;
            anyhow::Ok((index, variable))
        };
        let source = connection.source.as_ref().map(|fmu| find(fmu, &connection.output, Causality::Output));
        let source = source.transpose()?;
        let (target, input) = find(&connection.target, &connection.input, Causality::Input)?;
        if source.is_some_and(|(index, _)| index == target) {
            anyhow::bail!("{} is of the same FMU", connection.from());
        }
        let output = source.map(|(index, variable)| (variable, fmus[index].description()));
        Ok(Self {
            conversion: connection.function(output, (input, fmus[target].description()))?,
            source: source.map(|(index, _)| index),
            target,
            connection: connection.clone(),
        })
    }

    /// Whether a signal of the scenario drives the input.
    #[must_use]
    pub fn is_from(&self, signal: &str) -> bool {
        self.source.is_none() && self.connection.output == signal
    }

    /// The input's declaration.
    fn input<'a>(&self, fmus: &'a [Arc<Fmu>]) -> Option<&'a FmuVariable> {
        fmus[self.target].description().variable(&self.connection.input)
    }

    /// The unit that its signal has as it is the input's, if that has one.
    fn signal_unit<'a>(&'a self, fmus: &'a [Arc<Fmu>]) -> Option<(&'a str, &'a [Unit])> {
        let Conversion::Units { from: None, to } = &self.connection.conversion else { return None };
        let unit = to.as_deref().or_else(|| Some(self.input(fmus)?.unit.as_str()))?;
        (!unit.is_empty()).then_some((unit, fmus[self.target].description().units.as_slice()))
    }
}

/// Rejects a signal that several inputs with different units take as it is.
pub(crate) fn refuse_ambiguous_unit(
    input: &Input,
    scenario: &Scenario,
    links: &[Link],
    fmus: &[Arc<Fmu>],
) -> Result<()> {
    let has_own =
        |link: &&Link| scenario.fmus[link.target].inputs.iter().any(|own| own.name == link.connection.input);
    let takers = links.iter().filter(|link| link.is_from(&input.name) && !has_own(link));
    let mut units = takers.filter_map(|link| Some((link, link.signal_unit(fmus)?)));
    let Some((first, unit)) = units.next() else { return Ok(()) };
    match units.find(|(_, other)| unit_conversion(unit, *other) != Ok(Linear::IDENTITY)) {
        None => Ok(()),
        Some((second, other)) => Err(input.location.error(format!(
            "{} is in {}, {} in {}: give each its own signal, or a connection with from_unit",
            first.connection.to(),
            unit.0,
            second.connection.to(),
            other.0
        ))),
    }
}

/// The signal of an input that every FMU connected to it takes, by the first of them that declares a unit, if any does.
///
/// # Errors
/// When measured data do not fit.
pub(crate) fn signal(input: &Input, links: &[Link], fmus: &[Arc<Fmu>]) -> Result<Signal> {
    let links = links.iter().filter(|link| link.is_from(&input.name));
    let takers: Vec<_> = links.filter_map(|link| Some((link, link.input(fmus)?))).collect();
    let with_unit = takers.iter().find(|(_, variable)| !variable.unit.is_empty());
    input.location.locate(match with_unit.or(takers.first()) {
        Some((link, variable)) => {
            input.course.fit(variable, fmus[link.target].description(), link.conversion)
        }
        None => input.course.plain(),
    })
}
