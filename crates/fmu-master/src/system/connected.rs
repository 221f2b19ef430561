//! From where the inputs and parameters of a system's FMUs have their values: each follows its connections back to an FMU or
//! to a connector of a system.

use std::collections::BTreeMap;
use std::iter;

use anyhow::{Context, Error, Result, anyhow, bail};
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{
    Causality, ConnectionDescription, Domain, End, FmuDescription, FmuVariable, Function, Kind, Linear,
    Parameter, ParameterSet, Transformation, Unit, Value, ValueType, unit_conversion,
};
use fmu_terms::like;

use super::elements::{Elements, Part, Place, Start, SystemFmu};
use crate::scenario::{Input, Location, Scenario, Signal};

/// A connection to a connector.
struct Edge {
    source: Place,
    /// The connectors of source and target.
    ports: [Port; 2],
    transformation: Transformation,
    converts_units: bool,
    location: Location,
}

/// What a connector declares.
struct Port {
    name: String,
    unit: Option<Unit>,
    items: Vec<(String, i32)>,
}

/// From where a value comes.
struct Origin<'a> {
    place: Place,
    /// The items of the value's enumeration, if known.
    items: &'a [(String, i32)],
    function: Function,
}

/// What a scenario's FMUs get.
#[derive(Default)]
struct Connected {
    connections: Vec<Connection>,
    inputs: Vec<Input>,
    /// The parameters, by the index of the FMU.
    parameters: BTreeMap<usize, Vec<Parameter>>,
}

/// Connects a scenario's FMUs, and gives values to the parameters and inputs that depend on connectors of systems.
pub fn connect(elements: &mut Elements, scenario: &mut Scenario, system: &str) -> Result<()> {
    let edges = edges(elements, system)?;
    let mut connected = Connected::default();
    for (target, edge) in &edges {
        if let Part::Fmu(taker) = elements.all[target.0].part {
            let origin = origin(target, &edges, elements)?;
            edge.location.locate(connected.add(taker, &target.1, edge, &origin, elements))?;
        }
    }
    if elements.fmus.is_empty() {
        for (place, start) in &elements.starts {
            start
                .value
                .number()
                .into_iter()
                .for_each(|number| connected.drive(&elements.name(place), number));
        }
    }
    let Connected { connections, mut inputs, parameters } = connected;
    for (fmu, parameters) in parameters {
        let member = &mut elements.fmus[fmu].member;
        let set =
            ParameterSet { name: "connected parameters".to_owned(), parameters, ..ParameterSet::default() };
        member.parameters.push((set, member.location.clone()));
    }
    let connectors = &elements.all[0].connectors;
    let position = |input: &Input| connectors.iter().position(|connector| connector.name == input.name);
    inputs.sort_by_key(|input| position(input).unwrap_or(connectors.len()));
    scenario.inputs = inputs;
    scenario.connections = Some(connections);
    Ok(())
}

impl Connected {
    /// Adds a connection to a connector of an FMU, or to each of its elements.
    fn add(
        &mut self,
        taker: usize,
        connector: &str,
        edge: &Edge,
        origin: &Origin<'_>,
        elements: &Elements,
    ) -> Result<()> {
        let [from, to] = &edge.ports;
        let takers = elements.variables(taker, connector);
        // A missing one is refused when the FMU is loaded.
        let is_input = takers.first().is_none_or(|variable| variable.causality == Causality::Input);
        let (index, source) = &origin.place;
        let giver = match elements.all[*index].part {
            Part::Fmu(giver) if is_input => Some(giver),
            Part::Fmu(_) => bail!("{} is a parameter, which cannot have the value of {}", to.name, from.name),
            _ => None,
        };
        let inputs = names(&takers, connector);
        let outputs = match giver {
            Some(giver) => names(&elements.variables(giver, source), source),
            None => inputs.iter().map(|input| input.replacen(connector, source, 1)).collect(),
        };
        if inputs.len() != outputs.len() {
            bail!("{} has {} elements, {} {}", from.name, outputs.len(), to.name, inputs.len());
        }
        let SystemFmu { member, description } = &elements.fmus[taker];
        for (position, (output, input)) in outputs.into_iter().zip(inputs).enumerate() {
            let place = (*index, output);
            let variable = takers.get(position);
            let start = elements.starts.get(&place).filter(|_| giver.is_none()).zip(variable);
            let value =
                start.map(|(start, variable)| value(start, origin, variable, description)).transpose()?;
            if let (Some(value), Some(variable)) = (&value, variable)
                && (!is_input || matches!(value, Value::String(_)))
            {
                let value = of_variable(value.clone(), &origin.function, variable, description)
                    .with_context(|| format!("{} to {}", from.name, to.name))?;
                let parameter = Parameter { name: input, description: String::new(), value };
                self.parameters.entry(taker).or_default().push(parameter);
                continue;
            }
            if !is_input {
                continue;
            }
            let output = if giver.is_some() { place.1 } else { elements.name(&place) };
            if let Some(number) = value.and_then(|value| value.number()) {
                self.drive(&output, number);
            }
            self.connections.push(Connection {
                source: giver.map(|giver| elements.fmus[giver].member.name.clone()),
                output,
                target: member.name.clone(),
                input,
                conversion: Conversion::Function(origin.function.clone()),
                threshold: None,
                location: edge.location.clone(),
            });
        }
        Ok(())
    }

    /// Holds a connector at its value.
    fn drive(&mut self, name: &str, value: f64) {
        if self.inputs.iter().all(|known| known.name != name) {
            let location = Location::argument(&format!("the system's {name}"));
            let course = Signal::Constant(value).into();
            self.inputs.push(Input { name: name.to_owned(), course, location });
        }
    }
}

/// The names of variables; that of their connector if there are none.
fn names(variables: &[&FmuVariable], connector: &str) -> Vec<String> {
    if variables.is_empty() {
        return vec![connector.to_owned()];
    }
    variables.iter().map(|variable| variable.name.clone()).collect()
}

/// The connections by their targets.
fn edges(elements: &Elements, root: &str) -> Result<BTreeMap<Place, Edge>> {
    let mut edges: BTreeMap<Place, Edge> = BTreeMap::new();
    for (system, connection) in &elements.connections {
        let name = match elements.all[*system].path.as_str() {
            "" => root,
            path => path,
        };
        let location = Location::argument(&format!("the connections of {name}"));
        let [source, target] = location.locate(elements.ends(*system, connection))?;
        let ports = [&source, &target].map(|(index, connector)| elements.port(*index, connector));
        let place = elements.place(target.0, &target.1);
        let edge = Edge {
            source: elements.place(source.0, &source.1),
            ports,
            transformation: connection.transformation.clone(),
            converts_units: connection.converts_units,
            location,
        };
        if let Some(other) = edges.get(&place) {
            let names = [&other.ports[0], &edge.ports[0]].map(|port| port.name.as_str());
            let message = format!("{} has two sources: {} and {}", edge.ports[1].name, names[0], names[1]);
            return Err(edge.location.error(message));
        }
        edges.insert(place, edge);
    }
    Ok(edges)
}

/// Follows the connections to a target back, and composes what they do with the value.
fn origin<'a>(
    target: &Place,
    edges: &'a BTreeMap<Place, Edge>,
    elements: &'a Elements,
) -> Result<Origin<'a>> {
    let way: Vec<_> =
        iter::successors(edges.get(target), |edge| edges.get(&edge.source)).take(edges.len() + 1).collect();
    let [last, ..] = &way[..] else { bail!("no connection") };
    let first = way.last().context("no connection")?;
    if way.len() > edges.len() {
        return Err(last.location.error(format!("{} depends on itself", last.ports[1].name)));
    }
    let mut unit = elements.start_of(&first.source).and_then(|start| start.unit.as_ref());
    let mut items: &[(String, i32)] = &[];
    let mut function = Function::IDENTITY;
    for edge in way.iter().rev() {
        let [giver, taker] = &edge.ports;
        let mut then = |next: Function| -> Result<()> {
            function = function
                .clone()
                .then(next)
                .ok_or_else(|| anyhow!("a table follows a linear transformation"))?;
            Ok(())
        };
        let mut step = || {
            then(conversion(unit, giver.unit.as_ref())?.into())?;
            unit = giver.unit.as_ref().or(unit);
            if !giver.items.is_empty() {
                items = &giver.items;
            }
            if edge.converts_units {
                then(conversion(unit, taker.unit.as_ref())?.into())?;
                unit = taker.unit.as_ref().or(unit);
            } else {
                unit = taker.unit.as_ref();
            }
            let wanted = if taker.items.is_empty() { &last.ports[1].items } else { &taker.items };
            let transformation = edge.transformation.function(items, wanted).map_err(Error::msg)?;
            if transformation != Function::IDENTITY {
                unit = taker.unit.as_ref();
            }
            if !taker.items.is_empty() {
                items = &taker.items;
            }
            then(transformation)
        };
        let names = format!("{} to {}", giver.name, taker.name);
        edge.location.locate(step().with_context(|| names))?;
    }
    Ok(Origin { place: first.source.clone(), items: &first.ports[0].items, function })
}

/// The conversion between two units; the identity where one of them or its definition is missing.
fn conversion(from: Option<&Unit>, to: Option<&Unit>) -> Result<Linear> {
    let defined = |unit: Option<&Unit>| unit.filter(|unit| unit.base.is_some()).cloned();
    let (Some(from), Some(to)) = (defined(from), defined(to)) else { return Ok(Linear::IDENTITY) };
    let [from, to] = [&from, &to].map(|unit| (unit.name.as_str(), std::slice::from_ref(unit)));
    unit_conversion(from, to).map_err(Error::msg)
}

/// The value of a connector as a number or a text; an item of an enumeration by the connector's items, or the variable's.
fn value(start: &Start, origin: &Origin<'_>, variable: &FmuVariable, fmu: &FmuDescription) -> Result<Value> {
    let Value::Enumeration(item) = &start.value else { return Ok(start.value.clone()) };
    let own = fmu.enumeration(&variable.declared_type).map_or(&[] as &[_], |known| known.items.as_slice());
    let items = if origin.items.is_empty() { own } else { origin.items };
    let found = items.iter().find(|(known, _)| known == item);
    let number = found.map(|(_, number)| *number).with_context(|| {
        format!("there is no item {item}{}", like(item, items.iter().map(|(known, _)| known.as_str())))
    })?;
    Ok(Value::Integer(number))
}

/// The value of a variable, from that of the connector.
#[expect(clippy::cast_possible_truncation, reason = "the numbers of integers and items are whole")]
fn of_variable(
    value: Value,
    function: &Function,
    variable: &FmuVariable,
    fmu: &FmuDescription,
) -> Result<Value> {
    let Some(number) = value.number().map(|number| function.apply(number)) else { return Ok(value) };
    let taken = Domain::of(variable, fmu).take(number).map_err(Error::msg)?;
    Ok(match variable.value_type() {
        ValueType::Boolean => Value::Boolean(taken != 0.0),
        ValueType::Integer | ValueType::Enumeration if f64::from(taken as i32) - taken == 0.0 => {
            Value::Integer(taken as i32)
        }
        // Others do not fit the parameter.
        _ => Value::Real(taken, None),
    })
}

impl Elements {
    /// The value of a connector, or of one of an array's elements.
    fn start_of(&self, place: &Place) -> Option<&Start> {
        let from_here = self.starts.range(place.clone()..);
        let mut own =
            from_here.take_while(|((index, name), _)| *index == place.0 && name.starts_with(&place.1));
        let found =
            own.find(|((_, name), _)| matches!(name.as_bytes().get(place.1.len()), None | Some(b'[')));
        found.map(|(_, start)| start)
    }

    /// A connector's name, after the path of its element.
    fn name(&self, (index, connector): &Place) -> String {
        match self.all[*index].path.as_str() {
            "" => connector.clone(),
            path => format!("{path}.{connector}"),
        }
    }

    /// Source and target of a connection.
    fn ends(&self, system: usize, connection: &ConnectionDescription) -> Result<[(usize, String); 2]> {
        let find = |end: &End| -> Result<(usize, String, Option<bool>)> {
            let index = match &end.component {
                None => system,
                Some(name) => {
                    let mut children = self.all[system].children.iter().copied();
                    children.find(|child| self.all[*child].name == *name).with_context(|| {
                        let names =
                            self.all[system].children.iter().map(|child| self.all[*child].name.as_str());
                        format!("there is no element {name}{}", like(name, names))
                    })?
                }
            };
            let kind = self.kind(index, &end.connector)?;
            // A system's own inputs give within it.
            let gives = kind.map(|kind| (kind == Kind::Output) == (index != system));
            Ok((index, end.connector.clone(), gives))
        };
        let (start, end) = (find(&connection.start)?, find(&connection.end)?);
        let is_reversed = match (start.2, end.2) {
            (Some(one), Some(other)) if one == other => {
                let [start, end] = [&start, &end].map(|(index, name, _)| self.name(&(*index, name.clone())));
                let what = if one { "give values" } else { "take values" };
                bail!("{start} and {end} both {what}");
            }
            (Some(false), _) | (_, Some(true)) => true,
            _ => false,
        };
        let [start, end] = [(start.0, start.1), (end.0, end.1)];
        Ok(if is_reversed { [end, start] } else { [start, end] })
    }

    /// Whether a connector takes or gives values, if its declaration or its FMU shows it.
    fn kind(&self, index: usize, connector: &str) -> Result<Option<Kind>> {
        let element = &self.all[index];
        let declared = element.connectors.iter().find(|known| known.name == connector);
        match (declared, element.part) {
            (Some(declared), _) if declared.kind.is_some() => Ok(declared.kind),
            (_, Part::Fmu(fmu)) => Ok(self.variables(fmu, connector).first().map(|variable| match variable
                .causality
                .meaning()
            {
                Some(Causality::Input | Causality::Parameter | Causality::StructuralParameter) => Kind::Input,
                _ => Kind::Output,
            })),
            (None, Part::System) => {
                let names = element.connectors.iter().map(|known| known.name.as_str());
                bail!("{} has no connector {connector}{}", element.name, like(connector, names))
            }
            _ => Ok(None),
        }
    }

    /// What a connector declares: unit and items are the structure's, else the FMU's.
    fn port(&self, index: usize, connector: &str) -> Port {
        let element = &self.all[index];
        let declared = element.connectors.iter().find(|known| known.name == connector);
        let (mut unit, mut items) =
            declared.map_or((None, vec![]), |declared| (declared.unit.clone(), declared.items.clone()));
        if let Part::Fmu(fmu) = element.part {
            let description = &self.fmus[fmu].description;
            if let Some(variable) = self.variables(fmu, connector).first() {
                unit = unit.filter(|unit| unit.base.is_some()).or_else(|| description.unit(&variable.unit));
                if let Some(enumeration) = description.enumeration(&variable.declared_type) {
                    items.clone_from(&enumeration.items);
                }
            }
        }
        Port { name: self.name(&(index, connector.to_owned())), unit, items }
    }
}
