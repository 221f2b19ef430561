//! Resolves names in a declaration to positions: what equations read, clocks, previous values and units.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use fmu_terms::Unit;
use fmu_terms::{Causality, Variability};

use crate::declaration::OneOrEach;
use crate::dependencies;
use crate::error::{Refusals, nearest};
use crate::flatten::{Equation, Flat, Spread};
use crate::model::{Part, Place, Scalar, outward, without_subscripts};
use crate::subscripts::{Found, Read, Reader};
use crate::units::Units;

impl<'a> Flat<'a> {
    /// Resolves the names that equations read to positions.
    pub(crate) fn look_up_reads(&mut self) {
        let known =
            Known { names: &self.names, spread: &self.spread, parts: &self.parts, scalars: &self.scalars };
        let mut connections = Connections::new(known, &mut self.refusals);
        let (mut read, mut resolved) = (0, Vec::new());
        for Equation { positions, arrays, sizes, reads, initial_reads } in &self.equations {
            let first = &self.scalars[positions[0]];
            let [part, _] = first.field;
            let components: Vec<_> = arrays.iter().map(|(_, index)| *index).collect();
            let reader = Reader { components: &components, sizes };
            let mut look_up = |list: &str, names: &'a [String]| {
                let mut all_found = Vec::new();
                for (number, name) in names.iter().enumerate() {
                    let entries = if known.has(name) { Ok(vec![Read::whole(name)]) } else { Read::all(name) };
                    let found = entries.and_then(|entries| {
                        let (target, read) = connections
                            .look_up_any(part, &entries)
                            .map_err(|reason| format!("reads {reason}"))?;
                        self.reads_elements |= read.is_of_elements();
                        // A rejected connection, or one beyond the ends of an array, leads to nothing.
                        target.map_or(Ok(Found::Alike(&[])), |target| {
                            read.elements(reader, target.positions, target.sizes)
                        })
                    });
                    match found {
                        Ok(found) => all_found.push(found),
                        Err(reason) => {
                            let name = match sizes {
                                [] => first.name.clone(),
                                _ => without_subscripts(&first.name),
                            };
                            let reason = format!("{name}: {reason}");
                            self.refusals.add(format!("{}.{list}[{number}]", first.key), reason);
                        }
                    }
                }
                let are_alike = all_found.iter().all(|found| matches!(found, Found::Alike(_)));
                let mut elements: Vec<Rc<[usize]>> = Vec::with_capacity(positions.len());
                for (element, &position) in positions.iter().enumerate() {
                    if are_alike && element > 0 {
                        elements.push(Rc::clone(&elements[0]));
                        continue;
                    }
                    if read > dependencies::MOST {
                        let reason = dependencies::too_many(&self.scalars[position]);
                        self.refusals.add(format!("{}.{list}", first.key), reason);
                        break;
                    }
                    let mut reads: Vec<_> =
                        all_found.iter().flat_map(|found| found.of(element)).copied().collect();
                    reads.sort_unstable();
                    reads.dedup();
                    read += reads.len();
                    elements.push(reads.into());
                }
                // After a refusal, the rest reads nothing.
                elements.resize(positions.len(), [].into());
                elements
            };
            let reads = reads.map(|names| look_up("reads", names));
            let initial_reads = initial_reads.map(|names| look_up("initial_reads", names));
            resolved.push((positions, reads, initial_reads));
        }
        connections.refuse_unread(&mut self.refusals);
        for (positions, reads, initial_reads) in resolved {
            for (element, &position) in positions.iter().enumerate() {
                let scalar = &mut self.scalars[position];
                let of_element =
                    |reads: &Option<Vec<Rc<[usize]>>>| reads.as_ref().map(|reads| Rc::clone(&reads[element]));
                scalar.reads.in_initialization = of_element(&initial_reads).or_else(|| of_element(&reads));
                if scalar.place != Place::States {
                    scalar.reads.in_steps = of_element(&reads);
                }
            }
        }
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
            scalar.clocked.clocks.push(clock);
            if let Some(reads) = scalar.reads.in_steps.as_mut().filter(|reads| !reads.contains(&clock)) {
                *reads = reads.iter().copied().chain([clock]).collect();
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
            self.scalars[state].clocked.previous = Some(previous);
            self.scalars[previous].clocked.is_previous = true;
        }
    }

    /// The units used by variables and types.
    pub(crate) fn find_units(&mut self, units: &Units<'_>) -> Vec<Unit> {
        let mut used: Vec<Unit> = Vec::new();
        let mut places = BTreeMap::new();
        let of_variables = self.scalars.iter().map(|scalar| {
            (
                scalar.key.clone(),
                &scalar.name,
                scalar.quantity.unit.as_deref(),
                scalar.quantity.display_unit.as_deref(),
            )
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

/// The variables that names may mean.
#[derive(Clone, Copy)]
struct Known<'n, 'a> {
    names: &'n BTreeMap<String, Vec<usize>>,
    spread: &'n BTreeMap<String, Spread>,
    parts: &'n [Part<'a>],
    scalars: &'n [Scalar],
}

/// What a name means: a scalar, an array, or a variable of all elements of an array of components.
struct Target<'n> {
    positions: &'n [usize],
    sizes: &'n [usize],
}

impl<'n> Known<'n, '_> {
    fn has(self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    fn get(self, name: &str) -> Option<Target<'n>> {
        let spread = || self.spread.get(name).map(|Spread { sizes, positions }| Target { positions, sizes });
        let Some(positions) = self.names.get(name) else { return spread() };
        let scalar = positions.first().map(|&position| &self.scalars[position]);
        let [part, field] = match scalar.filter(|scalar| scalar.place != Place::Time) {
            Some(scalar) => scalar.field,
            None => return Some(Target { positions, sizes: &[] }),
        };
        Some(Target { positions, sizes: &self.parts[part].fields[field].declaration.sizes })
    }

    /// All names, for suggestions.
    fn all(self) -> impl Iterator<Item = &'n String> {
        self.names.keys().chain(self.spread.keys())
    }
}

/// The variables behind the connections of components.
struct Connections<'n, 'a> {
    known: Known<'n, 'a>,
    /// The connected variables' names, by the component's position and the connection's name; none for rejected
    /// connections, and for those beyond the ends of an array.
    variables: BTreeMap<(usize, &'a str), Option<String>>,
    /// The connections that are read.
    read: BTreeSet<(usize, &'a str)>,
}

impl<'n, 'a> Connections<'n, 'a> {
    /// Looks up each connection around its component, where earlier connections lead on.
    fn new(known: Known<'n, 'a>, refusals: &mut Refusals) -> Self {
        let mut found = Self { known, variables: BTreeMap::new(), read: BTreeSet::new() };
        for (position, part) in known.parts.iter().enumerate() {
            let (Some(component), Some(around)) = (part.component, part.around) else { continue };
            for (connection, written) in &component.connections {
                let looked_up = found.connected(part, around, written).map_err(|reason| {
                    let reason = format!("{}: is connected to {reason}", part.name);
                    refusals.add(format!("{}.connections.{connection}", part.key), reason);
                });
                found.variables.insert((position, connection), looked_up.unwrap_or_default());
            }
        }
        found
    }

    /// The name of the variable to which a part is connected; none beyond the ends of an array.
    fn connected(
        &mut self,
        part: &Part<'a>,
        around: usize,
        written: &OneOrEach,
    ) -> Result<Option<String>, String> {
        let size = part.index.and_then(|_| part.arrays.last()).map(|(size, _)| *size);
        if let OneOrEach::Each(names) = written
            && Some(names.len()) != size
        {
            let components = size.map_or("no array".to_owned(), |size| format!("{size} components"));
            return Err(format!("{} variables, but there are {components}", names.len()));
        }
        let name = written.of(part.index.unwrap_or(0));
        let entries = if self.known.has(name) { vec![Read::whole(name)] } else { Read::all(name)? };
        let components: Vec<_> = part.arrays.iter().map(|(_, index)| *index).collect();
        let (target, read) = self.look_up_any(around, &entries)?;
        let Some(Target { positions, sizes }) = target else { return Ok(None) };
        if !read.is_of_elements() {
            let written = self.written(around, &read.name)?;
            return Ok(written);
        }
        let reader = Reader { components: &components, sizes: &[] };
        let found = read.elements(reader, positions, sizes)?;
        match found.of(0) {
            [] => Ok(None),
            [one] => Ok(Some(self.known.scalars[*one].name.clone())),
            _ => Err(format!("'{name}', which is more than one variable")),
        }
    }

    /// What a part means by the first of some entries with a meaning.
    fn look_up_any<'r, 't>(
        &mut self,
        part: usize,
        entries: &'r [Read<'t>],
    ) -> Result<(Option<Target<'n>>, &'r Read<'t>), String> {
        let mut first = None;
        for read in entries {
            match self.look_up(part, &read.name) {
                Ok(target) => return Ok((target, read)),
                Err(reason) => first = first.or(Some(reason)),
            }
        }
        Err(first.unwrap_or_default())
    }

    /// What a part means by a name or `{placeholder}`; none behind a connection that leads to nothing.
    fn look_up(&mut self, part: usize, written: &str) -> Result<Option<Target<'n>>, String> {
        let name = self.written(part, written)?;
        Ok(name.and_then(|name| self.known.get(&name)))
    }

    /// The full name of what a part means by a name or `{placeholder}`.
    fn written(&mut self, part: usize, written: &str) -> Result<Option<String>, String> {
        let (name, of_derivative) = match written.strip_prefix("der(").and_then(|name| name.strip_suffix(')'))
        {
            Some(state) => (state, true),
            None => (written, false),
        };
        let wrap = |name: &str| if of_derivative { format!("der({name})") } else { name.to_owned() };
        let parts = self.known.parts;
        let candidates =
            if let Some(connection) = name.strip_prefix('{').and_then(|name| name.strip_suffix('}')) {
                match self.follow(part, connection).map_err(|reason| format!("'{name}', but {reason}"))? {
                    Some(name) => vec![wrap(&name)],
                    None => return Ok(None),
                }
            } else {
                outward(parts, part).map(|part| wrap(&parts[part].name_of(name))).collect()
            };
        let known = candidates.iter().find(|name| self.known.get(name).is_some());
        known.cloned().map(Some).ok_or_else(|| {
            let (own, of_model) = (&candidates[0], &candidates[candidates.len() - 1]);
            format!("'{of_model}', which is not a variable{}", nearest(own, self.known.all()))
        })
    }

    /// The name of the variable behind a connection, which is of the innermost component with a type.
    fn follow(&mut self, part: usize, connection: &str) -> Result<Option<String>, String> {
        let parts = self.known.parts;
        let of_type = outward(parts, part).find(|&part| parts[part].component_type().is_some());
        let of_type = of_type.ok_or("connections are for components with a type")?;
        let Part { component, name, .. } = &parts[of_type];
        let known = component.and_then(|component| component.connections.get_key_value(connection));
        let (connection, _) =
            known.ok_or_else(|| format!("the component '{name}' has no such connection"))?;
        self.read.insert((of_type, connection));
        Ok(self.variables.get(&(of_type, connection.as_str())).cloned().flatten())
    }

    fn refuse_unread(&self, refusals: &mut Refusals) {
        for (key @ (part, connection), variable) in &self.variables {
            if variable.is_some() && !self.read.contains(key) {
                let Part { name, key, .. } = &self.known.parts[*part];
                let reason = format!("{name}: no variable reads '{{{connection}}}'");
                refusals.add(format!("{key}.connections.{connection}"), reason);
            }
        }
    }
}
