//! Resolves names in a declaration to positions: what equations read, clocks, previous values and units.

use std::collections::{BTreeMap, BTreeSet};

use fmu_terms::Unit;
use fmu_terms::{Causality, Variability};

use crate::dependencies;
use crate::error::{Refusals, nearest};
use crate::flatten::{Equation, Flat};
use crate::model::{Part, Place, Scalar, outward, without_subscripts};
use crate::subscripts::Read;
use crate::units::Units;

impl<'a> Flat<'a> {
    /// Resolves the names that equations read to positions.
    pub(crate) fn look_up_reads(&mut self) {
        let mut connections = Connections::new(&self.names, &self.parts, &mut self.refusals);
        let mut read = 0;
        for Equation { positions, sizes, reads, initial_reads } in &self.equations {
            let first = &self.scalars[positions[0]];
            let [part, _] = first.field;
            let mut look_up = |list: &str, names: &'a [String]| {
                let mut elements = vec![BTreeSet::new(); positions.len()];
                for (number, name) in names.iter().enumerate() {
                    let is_whole = self.names.contains_key(name);
                    let entry = if is_whole { Ok(Read::whole(name)) } else { Read::new(name) };
                    let found = entry.and_then(|read| {
                        let found = connections.look_up(part, &read.name);
                        let found = found.map_err(|reason| format!("reads {reason}"))?;
                        // A rejected connection leads to nothing.
                        let found = found.map_or(&[][..], |name| &self.names[name]);
                        self.reads_elements |= read.is_of_elements();
                        let known = found.iter().map(|&position| &self.scalars[position]).next();
                        let known = known.filter(|known| known.place != Place::Time).map(|known| known.field);
                        let known =
                            known.map(|[part, field]| &self.parts[part].fields[field].declaration.sizes);
                        read.elements(sizes, found, known.map_or(&[], Vec::as_slice))
                    });
                    let found = match found {
                        Ok(found) => found,
                        Err(reason) => {
                            let name = match sizes {
                                [] => first.name.clone(),
                                _ => without_subscripts(&first.name),
                            };
                            let reason = format!("{name}: {reason}");
                            self.refusals.add(format!("{}.{list}[{number}]", first.key), reason);
                            continue;
                        }
                    };
                    for (element, reads) in elements.iter_mut().enumerate() {
                        if read > dependencies::MOST {
                            let reason = dependencies::too_many(&self.scalars[positions[element]]);
                            self.refusals.add(format!("{}.{list}", first.key), reason);
                            break;
                        }
                        read += found.of(element).len();
                        reads.extend(found.of(element));
                    }
                }
                elements.into_iter().map(|reads| reads.into_iter().collect::<Vec<_>>())
            };
            let reads: Option<Vec<_>> = reads.map(|names| look_up("reads", names).collect());
            let initial_reads: Option<Vec<_>> =
                initial_reads.map(|names| look_up("initial_reads", names).collect());
            for (element, &position) in positions.iter().enumerate() {
                let scalar = &mut self.scalars[position];
                let of_element =
                    |reads: &Option<Vec<Vec<usize>>>| reads.as_ref().map(|reads| reads[element].clone());
                scalar.initial_reads = of_element(&initial_reads).or_else(|| of_element(&reads));
                if scalar.place != Place::States {
                    scalar.reads = of_element(&reads);
                }
            }
        }
        connections.refuse_unread(&mut self.refusals);
    }

    /// Resolves names of clocks to positions. A variable depends on their ticks, too.
    pub(crate) fn look_up_clocks(&mut self) {
        let mut clocked = Vec::new();
        for field in self.parts.iter().flat_map(|part| &part.fields) {
            for (number, name) in field.declaration.clocks.iter().enumerate() {
                let first = &self.scalars[field.positions[0]];
                let is_clock = |scalar: &&Scalar| scalar.place == Place::Clocks;
                let found = self.names.get(name).and_then(|positions| positions.first().copied());
                let reason = match found.filter(|&clock| is_clock(&&self.scalars[clock])) {
                    None => {
                        let clocks = self.scalars.iter().filter(is_clock).map(|clock| &clock.name);
                        format!("there is no clock '{name}'{}", nearest(name, clocks))
                    }
                    Some(clock) if clock == field.positions[0] => {
                        "a clock cannot belong to itself".to_owned()
                    }
                    Some(clock)
                        if self.scalars[clock].causality == Causality::Local
                            && first.causality != Causality::Local =>
                    {
                        format!("the clock '{name}' is local, so only local variables can belong to it")
                    }
                    Some(clock) => {
                        clocked.extend(field.positions.iter().map(|&position| (position, clock)));
                        continue;
                    }
                };
                self.refusals
                    .add(format!("{}.clocks[{number}]", first.key), format!("{}: {reason}", first.name));
            }
        }
        for (position, clock) in clocked {
            let scalar = &mut self.scalars[position];
            scalar.clocks.push(clock);
            if let Some(reads) = scalar.reads.as_mut().filter(|reads| !reads.contains(&clock)) {
                reads.push(clock);
            }
        }
    }

    /// Resolves names of previous values to positions (FMI 3.0.2, section 2.4.7.4).
    pub(crate) fn look_up_previous(&mut self) {
        let mut found = BTreeMap::new();
        for field in self.parts.iter().flat_map(|part| &part.fields) {
            let Some(name) = &field.declaration.previous else { continue };
            let first = &self.scalars[field.positions[0]];
            let previous = self.names.get(name);
            let reason = match previous.map(|positions| (positions, &self.scalars[positions[0]])) {
                None => format!("there is no variable '{name}'{}", nearest(name, self.names.keys())),
                Some((positions, _)) if *positions == field.positions => {
                    "a variable is not its own previous value".to_owned()
                }
                Some((positions, previous))
                    if previous.data_type != first.data_type || positions.len() != field.positions.len() =>
                {
                    format!("'{name}' differs in type or size")
                }
                Some((_, previous))
                    if previous.variability != Variability::Discrete
                        || previous.causality == Causality::Input =>
                {
                    format!("'{name}' is not a discrete output or local variable")
                }
                Some((positions, _)) if found.contains_key(&positions[0]) => {
                    format!("'{name}' is the previous value of another variable")
                }
                Some((positions, _)) => {
                    found.extend(positions.iter().copied().zip(field.positions.iter().copied()));
                    continue;
                }
            };
            self.refusals.add(format!("{}.previous", first.key), format!("{}: {reason}", first.name));
        }
        for (previous, state) in found {
            self.scalars[state].previous = Some(previous);
            self.scalars[previous].is_previous = true;
        }
    }

    /// The units used by variables and types.
    pub(crate) fn find_units(&mut self, units: &Units<'_>) -> Vec<Unit> {
        let mut used: Vec<Unit> = Vec::new();
        let mut places = BTreeMap::new();
        let of_variables = self.scalars.iter().map(|scalar| {
            (scalar.key.clone(), &scalar.name, scalar.unit.as_deref(), scalar.display_unit.as_deref())
        });
        let of_types = self.declaration.real_types.iter().enumerate().map(|(number, known)| {
            let key = format!("real_types[{number}]");
            (key, &known.name, known.unit.as_deref(), known.display_unit.as_deref())
        });
        for (key, of_name, name, display) in of_types.chain(of_variables) {
            let Some(name) = name else { continue };
            let mut refuse = |of: &str, reason: String| {
                self.refusals.add(format!("{key}.{of}"), format!("{of_name}: {reason}"));
            };
            let place = *places.entry(name).or_insert_with(|| {
                let unit = units.find(name).map_err(|reason| refuse("unit", reason)).ok()?;
                used.push(unit);
                Some(used.len() - 1)
            });
            if let Some(unit) = place.map(|place| &mut used[place])
                && let Some(display) = display
                && unit.display_units.iter().all(|known| known.name != display)
            {
                match units.display_unit(name, display) {
                    Ok(display) => unit.display_units.push(display),
                    Err(reason) => refuse("display_unit", reason),
                }
            }
        }
        used.sort_by_key(|unit| units.position(&unit.name).unwrap_or(usize::MAX));
        used
    }
}

/// The variables behind the connections of components.
struct Connections<'n, 'a> {
    names: &'n BTreeMap<String, Vec<usize>>,
    parts: &'n [Part<'a>],
    /// By the component's position and the connection's name; none for rejected ones.
    variables: BTreeMap<(usize, &'a str), Option<&'n str>>,
    /// Those that are read.
    read: BTreeSet<(usize, &'a str)>,
}

impl<'n, 'a> Connections<'n, 'a> {
    /// Looks up each connection around its component, where earlier connections lead on.
    fn new(names: &'n BTreeMap<String, Vec<usize>>, parts: &'n [Part<'a>], refusals: &mut Refusals) -> Self {
        let mut found = Self { names, parts, variables: BTreeMap::new(), read: BTreeSet::new() };
        for (position, part) in parts.iter().enumerate() {
            let (Some(component), Some(around)) = (part.component, part.around) else { continue };
            for (connection, variable) in &component.connections {
                let looked_up = found.look_up(around, variable).map_err(|reason| {
                    let reason = format!("{}: is connected to {reason}", part.name);
                    refusals.add(format!("{}.connections.{connection}", part.key), reason);
                });
                found.variables.insert((position, connection), looked_up.unwrap_or_default());
            }
        }
        found
    }

    /// The name of the variable that a part means by a name or `{placeholder}`; none behind a rejected connection.
    fn look_up(&mut self, part: usize, written: &str) -> Result<Option<&'n str>, String> {
        let (name, of_derivative) = match written.strip_prefix("der(").and_then(|name| name.strip_suffix(')'))
        {
            Some(state) => (state, true),
            None => (written, false),
        };
        let wrap = |name: &str| if of_derivative { format!("der({name})") } else { name.to_owned() };
        let candidates =
            if let Some(connection) = name.strip_prefix('{').and_then(|name| name.strip_suffix('}')) {
                match self.follow(part, connection).map_err(|reason| format!("'{name}', but {reason}"))? {
                    Some(name) => vec![wrap(name)],
                    None => return Ok(None),
                }
            } else {
                outward(self.parts, part).map(|part| wrap(&self.parts[part].name_of(name))).collect()
            };
        let known = candidates.iter().find_map(|name| self.names.get_key_value(name));
        known.map(|(name, _)| Some(name.as_str())).ok_or_else(|| {
            let (own, of_model) = (&candidates[0], &candidates[candidates.len() - 1]);
            format!("'{of_model}', which is not a variable{}", nearest(own, self.names.keys()))
        })
    }

    /// The variable behind a connection, which is of the innermost component with a type.
    fn follow(&mut self, part: usize, connection: &str) -> Result<Option<&'n str>, String> {
        let of_type = outward(self.parts, part).find(|&part| self.parts[part].component_type().is_some());
        let of_type = of_type.ok_or("connections are for components with a type")?;
        let Part { component, name, .. } = &self.parts[of_type];
        let known = component.and_then(|component| component.connections.get_key_value(connection));
        let (connection, _) =
            known.ok_or_else(|| format!("the component '{name}' has no such connection"))?;
        self.read.insert((of_type, connection));
        Ok(self.variables.get(&(of_type, connection.as_str())).copied().flatten())
    }

    fn refuse_unread(&self, refusals: &mut Refusals) {
        for (key @ (part, connection), variable) in &self.variables {
            if variable.is_some() && !self.read.contains(key) {
                let Part { name, key, .. } = &self.parts[*part];
                let reason = format!("{name}: no variable reads '{{{connection}}}'");
                refusals.add(format!("{key}.connections.{connection}"), reason);
            }
        }
    }
}
