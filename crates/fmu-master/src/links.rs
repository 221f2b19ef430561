//! The connections of a scenario between its FMUs, with their conversions.
//!
//! If a scenario lists no connections, each output connects to the inputs of the same name at other FMUs, and each
//! signal to the inputs of its name. If the declared units differ, values are converted, as in connections of
//! System Structure and Parameterization 1.0.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Context, Error, Result};
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{Domain, FmuDescription, FmuVariable, Function, Linear, Unit, unit_conversion};
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
    /// The position of the target among the scenario's FMUs.
    pub target: usize,
    /// The conversion from the output's value to the input's.
    pub conversion: Function,
}

/// The connections of a scenario with its FMUs, in their order.
///
/// # Errors
/// When an FMU or variable is missing, an input has two sources, or units do not convert; the message names the place.
pub fn links(scenario: &Scenario, fmus: &[Arc<Fmu>]) -> Result<Vec<Link>> {
    let members: Vec<_> =
        scenario.fmus.iter().zip(fmus).map(|(member, fmu)| Ends::new(member, fmu)).collect();
    let given = scenario.connections.as_deref().map(Cow::Borrowed);
    let connections = given.unwrap_or_else(|| by_name(&members).into());
    let mut links: Vec<Link> = vec![];
    let mut places = BTreeMap::new();
    for connection in connections.iter() {
        // By name, a signal would drive what another FMU drives already; the master refuses it.
        let is_signal = scenario.connections.is_none() && connection.source.is_none();
        if let Some(other) = places.insert((connection.to(), is_signal), connection) {
            let [one, two] = [other, connection].map(Connection::from);
            let line = other.location.line().filter(|line| Some(*line) != connection.location.line());
            let line = line.map_or_else(String::new, |line| format!(", in line {line},"));
            let message = format!("{} has two sources: {one}{line} and {two}", connection.to());
            return Err(connection.location.error(message));
        }
        links.push(connection.location.locate(Link::new(connection, &members))?);
    }
    Ok(links)
}

/// What connections may lead from and to, by name.
struct Ends<'a> {
    member: &'a Member,
    description: &'a FmuDescription,
    outputs: BTreeMap<&'a str, &'a FmuVariable>,
    inputs: BTreeMap<&'a str, &'a FmuVariable>,
}

impl<'a> Ends<'a> {
    fn new(member: &'a Member, fmu: &'a Fmu) -> Self {
        let description = fmu.description();
        let [outputs, inputs] = [Causality::Output, Causality::Input].map(|causality| {
            let variables = description.of_causality(causality);
            variables.map(|variable| (variable.name.as_str(), variable)).collect()
        });
        Self { member, description, outputs, inputs }
    }

    fn find(&self, causality: Causality, name: &str) -> Result<&'a FmuVariable> {
        let known = if causality == Causality::Input { &self.inputs } else { &self.outputs };
        known.get(name).copied().with_context(|| {
            let like = like(name, known.keys().copied());
            format!("{} has no {causality} {name}{like}", self.member.name)
        })
    }
}

/// Connections from each output to the inputs of its name at other FMUs, unless the FMU's own signal drives one; and
/// from a signal to each input of its name.
fn by_name(members: &[Ends<'_>]) -> Vec<Connection> {
    let connection = |source: Option<&Ends<'_>>, target: &Member, name: &str| Connection {
        source: source.map(|giver| giver.member.name.clone()),
        output: name.to_owned(),
        target: target.name.clone(),
        input: name.to_owned(),
        conversion: Conversion::DECLARED,
        threshold: None,
        location: target.location.clone(),
    };
    let mut connections = vec![];
    for Ends { member, inputs, .. } in members {
        for name in inputs.keys() {
            connections.push(connection(None, member, name));
            if member.inputs.iter().any(|input| input.name == *name) {
                continue;
            }
            let givers = members.iter().filter(|giver| giver.member.name != member.name);
            let givers = givers.filter(|giver| giver.outputs.contains_key(name));
            connections.extend(givers.map(|giver| connection(Some(giver), member, name)));
        }
    }
    connections
}

impl Link {
    fn new(connection: &Connection, members: &[Ends<'_>]) -> Result<Self> {
        let position = |fmu: &str| {
            members.iter().position(|ends| ends.member.name == fmu).with_context(|| {
                let names = members.iter().map(|ends| ends.member.name.as_str());
                format!("there is no FMU {fmu}{}", like(fmu, names))
            })
        };
        let source = connection.source.as_ref().map(|fmu| {
            let index = position(fmu)?;
            anyhow::Ok((index, members[index].find(Causality::Output, &connection.output)?))
        });
        let source = source.transpose()?;
        let index = position(&connection.target)?;
        let taken = members[index].find(Causality::Input, &connection.input)?;
        if let Some(threshold) = connection.threshold {
            Domain::with_threshold(taken, threshold).map_err(Error::msg)?;
        }
        let output = source.map(|(giver, variable)| (variable, members[giver].description));
        Ok(Self {
            conversion: connection.function(output, (taken, members[index].description))?,
            source: source.map(|(giver, _)| giver),
            target: index,
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

    /// The unit of the signal where it is taken as it is: the input's, if that has one.
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
            input.course.fit(variable, fmus[link.target].description(), link.conversion.linear())
        }
        None => input.course.plain(),
    })
}
