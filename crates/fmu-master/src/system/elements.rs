//! The elements of a system, from its structure and those within: FMUs, systems, and references to signal dictionaries,
//! with the values that parameter sets give to them.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, bail};
use fmu_io::terminal::complain;
use fmu_package::connection;
use fmu_package::{
    ComponentKind, ConnectionDescription, ConnectorDescription, Content, ElementDescription, FmuDescription,
    FmuVariable, MappingEntry, Parameter, ParameterBinding, ParameterMapping, ParameterSet, Unit, Value,
    is_known_unit, unit_conversion,
};

use super::files::{Base, Unpacked};
use crate::scenario::{Location, Member};

/// The most elements of a system, with those of the structures and packages in it, which may contain each other many times.
const MOST_ELEMENTS: usize = 10_000;

/// The elements, found by their indices.
#[derive(Default)]
pub struct Elements {
    pub all: Vec<Element>,
    /// The FMUs, in file order.
    pub fmus: Vec<SystemFmu>,
    /// The connections, each with the index of its system.
    pub connections: Vec<(usize, ConnectionDescription)>,
    /// The values of connectors.
    pub starts: BTreeMap<Place, Start>,
    /// The signal dictionaries of the systems around an element, the innermost last, each with its first reference.
    dictionaries: Vec<BTreeMap<String, Option<usize>>>,
}

/// A connector: its element and its name.
pub type Place = (usize, String);

pub struct Element {
    pub name: String,
    /// The element's name after those of the elements around it, without the root; empty for the root.
    pub path: String,
    pub connectors: Vec<ConnectorDescription>,
    pub part: Part,
    pub children: Vec<usize>,
}

#[derive(Clone, Copy)]
pub enum Part {
    System,
    /// An FMU, by its index among the FMUs.
    Fmu(usize),
    /// A signal dictionary, by the first element that refers to it.
    Reference(usize),
}

/// An FMU of a system.
pub struct SystemFmu {
    pub member: Member,
    pub description: FmuDescription,
}

/// The value that a parameter set gives to a connector, and its unit, if known.
pub struct Start {
    pub value: Value,
    pub unit: Option<Unit>,
}

/// A parameter on its way from a set.
struct Given<'a> {
    parameter: &'a Parameter,
    /// The units that the set declares.
    units: &'a [Unit],
    /// How the parameter is mapped, if it is.
    entry: Option<&'a MappingEntry>,
}

/// What became of a parameter set.
#[derive(Default)]
struct Taken {
    /// The parameters that fit, by the index of the FMU.
    fitted: BTreeMap<usize, Vec<Parameter>>,
    /// The parameters whose unit nothing defines.
    without_unit: Vec<String>,
}

impl Elements {
    /// Adds an element with all within it, and returns its index.
    pub fn add(
        &mut self,
        description: ElementDescription,
        parent: Option<&str>,
        base: &Base,
        unpacked: &mut Unpacked,
    ) -> Result<usize> {
        let ElementDescription { name, connectors, parameters, content } = description;
        let path = match parent {
            None => String::new(),
            Some("") => name.clone(),
            Some(parent) => format!("{parent}.{name}"),
        };
        let what = match &content {
            Content::Component { .. } => format!("the component {path}"),
            _ => format!("the system {}", if path.is_empty() { &name } else { &path }),
        };
        let location = Location::argument(&what);
        let index = self.all.len();
        if index == MOST_ELEMENTS {
            return Err(location.error(format!("there are more than {MOST_ELEMENTS} elements")));
        }
        if let Some(reason) = connection::refused_name(&name) {
            return Err(location.error(reason));
        }
        let mut within = (vec![], vec![], vec![]);
        let part = match content {
            Content::Component { kind: ComponentKind::Fmu(interface), source } => {
                let file = location.locate(base.file(&source))?;
                let description = FmuDescription::read(&file).and_then(FmuDescription::scalars);
                let description = location.locate(description.map_err(Into::into))?;
                let member = Member { interface, ..Member::new(&path, &file, location) };
                self.fmus.push(SystemFmu { member, description });
                Part::Fmu(self.fmus.len() - 1)
            }
            Content::Component { kind, source } => {
                let (inner, inner_base) = location.locate(base.open(&source, &kind, unpacked))?;
                let inner = ElementDescription { name, ..inner.system };
                self.add(inner, parent, &inner_base, unpacked)?;
                self.take(index, &parameters, base, &what)?;
                return Ok(index);
            }
            Content::System { elements, connections, dictionaries } => {
                within = (elements, connections, dictionaries);
                Part::System
            }
            Content::Reference { dictionary } => {
                let known = self.dictionaries.iter_mut().rev().find_map(|known| known.get_mut(&dictionary));
                let known =
                    known.with_context(|| format!("{path}: there is no signal dictionary {dictionary}"))?;
                Part::Reference(*known.get_or_insert(index))
            }
        };
        self.all.push(Element { name, path: path.clone(), connectors, part, children: vec![] });
        let (elements, connections, dictionaries) = within;
        self.dictionaries.push(dictionaries.into_iter().map(|name| (name, None)).collect());
        let mut names = BTreeSet::new();
        if let Some(twin) = elements.iter().find(|element| !names.insert(element.name.as_str())) {
            bail!("{what}: two elements are named {}", twin.name);
        }
        for element in elements {
            let child = self.add(element, Some(&path), base, unpacked)?;
            self.all[index].children.push(child);
        }
        self.dictionaries.pop();
        self.connections.extend(connections.into_iter().map(|connection| (index, connection)));
        self.take(index, &parameters, base, &what)?;
        Ok(index)
    }

    /// Gives the values of parameter sets to an element. Later ones override earlier ones.
    fn take(&mut self, index: usize, bindings: &[ParameterBinding], base: &Base, what: &str) -> Result<()> {
        let location = Location::argument(what);
        for ParameterBinding { prefix, set, mapping } in bindings {
            let fmu = match self.all[index].part {
                Part::Fmu(fmu) => Some(self.fmus[fmu].member.file.as_path()),
                _ => None,
            };
            let set = location.locate(base.load(set, fmu, ParameterSet::parse))?;
            let mapping = mapping.as_ref().map(|mapping| base.load(mapping, fmu, ParameterMapping::parse));
            let mapping = location.locate(mapping.transpose())?;
            let owner = format!("the parameter set '{}' of {what}", set.name);
            let in_set = Location::argument(&owner);
            let repeated: Vec<_> = set.repeated().map(str::to_owned).collect();
            let mut unknown = vec![];
            let mut taken = Taken::default();
            for parameter in &set.parameters {
                let name = format!("{prefix}{}", parameter.name);
                let entries: Vec<_> = match &mapping {
                    None => vec![None],
                    Some(mapping) => {
                        mapping.entries.iter().filter(|entry| entry.source == name).map(Some).collect()
                    }
                };
                for entry in entries {
                    let target = entry.map_or(name.as_str(), |entry| &entry.target);
                    let given = Given { parameter, units: &set.units, entry };
                    if !in_set.locate(self.give(index, target, &given, &mut taken))? {
                        unknown.push(target.to_owned());
                    }
                }
            }
            for (fmu, parameters) in taken.fitted {
                let own = ParameterSet { parameters, ..set.clone() };
                self.fmus[fmu].member.parameters.push((own, location.clone()));
            }
            for (names, message) in [
                (unknown, "nothing that can be set is named"),
                (repeated, "a later value replaces that of"),
                (taken.without_unit, "the unit is not defined, and the FMU's is taken, for"),
            ] {
                if let [first, ..] = &names[..] {
                    let others = names.len() - 1;
                    let others = if others == 0 { String::new() } else { format!(" and {others} others") };
                    complain(&format!("note: {owner}: {message} {first}{others}"));
                }
            }
        }
        Ok(())
    }

    /// Gives a value to all that has a name in an element. Returns whether anything has.
    fn give(&mut self, index: usize, name: &str, given: &Given<'_>, taken: &mut Taken) -> Result<bool> {
        let Element { part, connectors, children, .. } = &self.all[index];
        if let Part::Fmu(fmu) = *part {
            let description = &self.fmus[fmu].description;
            let variable = description.variable(name).filter(|variable| variable.is_settable());
            let Some(variable) = variable else { return Ok(false) };
            let mut value = given.value();
            if let Value::Real(number, Some(unit)) = &value {
                let is_known = is_known_unit(unit, given.units) || description.unit(unit).is_some();
                if !is_known {
                    taken.without_unit.push(name.to_owned());
                }
                // A variable without a unit takes it unchanged, as it does along connections.
                if !is_known || variable.unit.is_empty() {
                    value = Value::Real(*number, None);
                }
            }
            let value = given.transformed(value.fit(variable, given.units, description)?);
            let parameter = Parameter { name: name.to_owned(), value, ..given.parameter.clone() };
            taken.fitted.entry(fmu).or_default().push(parameter);
            return Ok(true);
        }
        let mut is_known = false;
        // The connector of an array takes the values of its elements.
        let array = name.strip_suffix(']').and_then(|name| Some(name.rsplit_once('[')?.0));
        let connector =
            connectors.iter().find(|known| known.name == name || Some(known.name.as_str()) == array);
        let children: Vec<_> = children
            .iter()
            .filter_map(|child| {
                let rest = name.strip_prefix(&self.all[*child].name)?.strip_prefix('.')?;
                Some((*child, rest.to_owned()))
            })
            .collect();
        if let Some(connector) = connector {
            let start = given.start(connector)?;
            self.starts.insert(self.place(index, name), start);
            is_known = true;
        }
        for (child, rest) in children {
            is_known |= self.give(child, &rest, given, taken)?;
        }
        Ok(is_known)
    }

    /// The variables of an FMU that a connector stands for: one, or the elements of an array.
    pub fn variables(&self, fmu: usize, connector: &str) -> Vec<&FmuVariable> {
        let description = &self.fmus[fmu].description;
        if let Some(variable) = description.variable(connector) {
            return vec![variable];
        }
        description.array(connector)
    }

    /// The connector of an element, that of a signal dictionary for all references to it.
    pub fn place(&self, index: usize, connector: &str) -> Place {
        let index = match self.all[index].part {
            Part::Reference(first) => first,
            _ => index,
        };
        (index, connector.to_owned())
    }
}

impl Given<'_> {
    /// The parameter's value before it is converted.
    fn value(&self) -> Value {
        let value = self.parameter.value.clone();
        match (self.entry, value) {
            (Some(MappingEntry { converts_units: false, .. }), Value::Real(value, _)) => {
                Value::Real(value, None)
            }
            (Some(entry), value) => entry.transformation.tabulated(value),
            (None, value) => value,
        }
    }

    /// The parameter's value after it is converted.
    fn transformed(&self, value: Value) -> Value {
        match (self.entry, value) {
            (Some(entry), Value::Real(value, unit)) => {
                Value::Real(entry.transformation.linear().apply(value), unit)
            }
            (_, value) => value,
        }
    }

    /// The value of a connector, in its unit if it has one.
    fn start(&self, connector: &ConnectorDescription) -> Result<Start> {
        let Value::Real(number, unit) = self.value() else {
            return Ok(Start { value: self.value(), unit: None });
        };
        let known = |name: &String| {
            let known = self.units.iter().find(|unit| unit.name == *name).cloned();
            known.unwrap_or_else(|| Unit::undefined(name))
        };
        let own = unit.as_ref().map(known);
        let number = match (&own, &connector.unit) {
            (Some(own), Some(wanted)) => {
                let [own, wanted] =
                    [own, wanted].map(|unit| (unit.name.as_str(), std::slice::from_ref(unit)));
                unit_conversion(own, wanted).map_err(anyhow::Error::msg)?.apply(number)
            }
            _ => number,
        };
        let value = self.transformed(Value::Real(number, None));
        Ok(Start { value, unit: connector.unit.clone().or(own) })
    }
}
