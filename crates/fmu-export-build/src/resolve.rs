//! Resolves names in a declaration to positions: what equations read, clocks, previous values and units.

use std::collections::{BTreeMap, BTreeSet};

use fmu_terms::Unit;
use fmu_terms::{Causality, Variability};

use crate::declaration::ComponentDeclaration;
use crate::dependencies;
use crate::error::nearest;
use crate::flatten::{Equation, Flat};
use crate::model::{Place, Scalar, without_subscripts};
use crate::subscripts::Read;
use crate::units::Units;

impl<'a> Flat<'a> {
    /// Resolves the names that equations read to positions.
    pub(crate) fn look_up_reads(&mut self) {
        let (mut used, mut read) = (BTreeSet::new(), 0);
        for Equation { positions, sizes, component, reads, initial_reads } in &self.equations {
            let first = &self.scalars[positions[0]];
            let mut look_up = |list: &str, names: &'a [String]| {
                let mut elements = vec![BTreeSet::new(); positions.len()];
                for (number, name) in names.iter().enumerate() {
                    let is_whole = self.names.contains_key(name);
                    let entry = if is_whole { Ok(Read::whole(name)) } else { Read::new(name) };
                    let found = entry.and_then(|read| {
                        let found = look_up_read(&self.names, *component, &read.name, &mut used)?;
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
        for (number, component) in self.declaration.components.iter().enumerate() {
            for (connection, variable) in &component.connections {
                let name = &component.name;
                let reason = if !self.names.contains_key(variable) {
                    format!(
                        "{name}: there is no variable '{variable}'{}",
                        nearest(variable, self.names.keys())
                    )
                } else if used.contains(&(name.as_str(), connection.as_str())) {
                    continue;
                } else {
                    format!("{name}: no variable reads '{{{connection}}}'")
                };
                self.refusals.add(format!("components[{number}].connections.{connection}"), reason);
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

    /// The units used by variables.
    pub(crate) fn find_units(&mut self, units: &Units<'_>) -> Vec<Unit> {
        let mut used: Vec<Unit> = Vec::new();
        let mut places = BTreeMap::new();
        for scalar in &self.scalars {
            let Some(name) = scalar.unit.as_deref() else { continue };
            let mut refuse = |of: &str, reason: String| {
                self.refusals.add(format!("{}.{of}", scalar.key), format!("{}: {reason}", scalar.name));
            };
            let place = *places.entry(name).or_insert_with(|| {
                let unit = units.find(name).map_err(|reason| refuse("unit", reason)).ok()?;
                used.push(unit);
                Some(used.len() - 1)
            });
            if let Some(unit) = place.map(|place| &mut used[place])
                && let Some(display) = scalar.display_unit.as_deref()
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

/// The positions behind an entry of `reads`; records which connections are used.
fn look_up_read<'n, 'a>(
    names: &'n BTreeMap<String, Vec<usize>>,
    component: Option<&'a ComponentDeclaration>,
    read: &str,
    used: &mut BTreeSet<(&'a str, &'a str)>,
) -> Result<&'n [usize], String> {
    let (read, of_derivative) = match read.strip_prefix("der(").and_then(|read| read.strip_suffix(')')) {
        Some(state) => (state, true),
        None => (read, false),
    };
    let wrap = |name: &str| {
        if of_derivative { format!("der({name})") } else { name.to_owned() }
    };
    let placeholder = read.strip_prefix('{').and_then(|read| read.strip_suffix('}'));
    let candidates = if let Some(connection) = placeholder {
        let component = component
            .filter(|component| component.component_type.is_some())
            .ok_or_else(|| format!("reads '{read}', but connections are for components with a type"))?;
        let (connection, name) = component.connections.get_key_value(connection).ok_or_else(|| {
            format!("reads '{read}', but the component '{}' has no such connection", component.name)
        })?;
        used.insert((&component.name, connection));
        if !names.contains_key(name) {
            // The connection itself is rejected.
            return Ok(&[]);
        }
        vec![wrap(name)]
    } else {
        let own = component.map(|component| wrap(&format!("{}.{read}", component.name)));
        own.into_iter().chain([wrap(read)]).collect()
    };
    candidates.iter().find_map(|name| names.get(name)).map(Vec::as_slice).ok_or_else(|| {
        let read = &candidates[candidates.len() - 1];
        format!("reads '{read}', which is not a variable{}", nearest(&candidates[0], names.keys()))
    })
}
