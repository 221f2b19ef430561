//! Turns the declaration into parts and scalars: fills in components, at any depth, and spreads arrays into scalars.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use fmu_terms::per_second;
use fmu_terms::{Causality, Initial, Variability};
use serde_json::Value;

use crate::check::variable;
use crate::declaration::{AliasDeclaration, Contents, Declaration, VariableDeclaration, within};
use crate::error::{Refusal, Refusals, nearest};
use crate::model::{
    Alias, Dynamics, Field, MOST_INLINE, Part, Place, Quantity, Scalar, Texts, derivative_description,
    name_within, outward,
};
use crate::names::{length, rust_type_name};

/// The most components: types could contain each other in numbers that no computer holds.
const MOST_COMPONENTS: usize = 100_000;

/// The largest value reference that can be declared, leaving room for those that follow.
const LARGEST_REFERENCE: u32 = i32::MAX.cast_unsigned();

/// Parts and scalars whose names are not yet resolved.
pub(crate) struct Flat<'a> {
    pub(crate) declaration: &'a Declaration,
    /// The positions of the component types.
    types: BTreeMap<&'a str, usize>,
    pub(crate) parts: Vec<Part<'a>>,
    /// The paths of components' start values for variables that exist.
    started: BTreeSet<String>,
    pub(crate) scalars: Vec<Scalar>,
    /// The declared value references, with their keys' paths.
    pinned: Vec<(usize, u32, String)>,
    /// The scalars behind each name in `reads`, of a scalar or an array.
    pub(crate) names: BTreeMap<String, Vec<usize>>,
    /// The variables in arrays of components, by their names without these arrays' subscripts.
    pub(crate) spread: BTreeMap<String, Spread>,
    /// The positions of each array's elements, with their derivatives.
    arrays: Vec<Range<usize>>,
    /// The equations whose reads are not yet resolved.
    pub(crate) equations: Vec<Equation<'a>>,
    /// Whether elements of an array read different variables.
    pub(crate) reads_elements: bool,
    pub(crate) refusals: Refusals,
}

/// A variable of all elements of arrays of components.
#[derive(Default)]
pub(crate) struct Spread {
    /// The sizes of the arrays of components, and the variable's own.
    pub(crate) sizes: Vec<usize>,
    /// The positions of the variable's scalars, row by row.
    pub(crate) positions: Vec<usize>,
}

/// What a variable's elements read, as declared.
pub(crate) struct Equation<'a> {
    pub(crate) positions: Vec<usize>,
    /// The sizes of the arrays of components, with the indices of the variable's component, and its own.
    pub(crate) arrays: Vec<(usize, usize)>,
    pub(crate) sizes: &'a [usize],
    pub(crate) reads: Option<&'a [String]>,
    pub(crate) initial_reads: Option<&'a [String]>,
}

impl<'a> Flat<'a> {
    pub(crate) fn new(declaration: &'a Declaration) -> Result<Self, Refusals> {
        let types = declaration.component_types.iter().enumerate();
        let mut flat = Self {
            declaration,
            types: types.map(|(position, known)| (known.name.as_str(), position)).collect(),
            parts: Vec::new(),
            started: BTreeSet::new(),
            scalars: vec![Scalar::time()],
            pinned: Vec::new(),
            names: BTreeMap::from([("time".to_owned(), vec![0])]),
            spread: BTreeMap::new(),
            arrays: Vec::new(),
            equations: Vec::new(),
            reads_elements: false,
            refusals: Refusals::default(),
        };
        flat.add_part(Part::default(), &declaration.own());
        flat.refuse_unused_types();
        flat.refusals.check()?;
        flat.assign_value_references();
        Ok(flat)
    }

    /// Adds a part with its variables, and the components in it.
    fn add_part(&mut self, mut part: Part<'a>, contents: &Contents<'a>) {
        let list = within(&contents.key, "variables");
        let mut names = BTreeMap::new();
        for (number, variable) in contents.variables.iter().enumerate() {
            let (name, key) = (&variable.name, format!("{list}[{number}]"));
            let own = || (variable.start.as_ref(), format!("{key}.start"));
            let overridden = self.overridden(&part, variable);
            let Some(overridden) = self.refusals.take(overridden) else { continue };
            let (start, start_key) = overridden.map_or_else(own, |(start, key)| (Some(start), key));
            let name_key = format!("{key}.name");
            let field = self.add_field(&part, variable, start, [key, start_key]);
            let Some(field) = self.refusals.take(field) else { continue };
            if let Some(other) = names.insert((field.place, field.name()), name) {
                let reason =
                    format!("{name}: its Rust name is that of '{other}'; give it another 'rust_name'");
                self.refusals.add(name_key, reason);
            }
            part.fields.push(field);
        }
        let position = self.parts.len();
        self.parts.push(part);
        for (number, component) in contents.components.iter().enumerate() {
            match component.dimensions[..] {
                [] => self.add_component(position, contents, number, None),
                [size] if size > 0 => {
                    for index in 0..size {
                        self.add_component(position, contents, number, Some((size, index)));
                    }
                }
                _ => {
                    let reason =
                        format!("{}: an array of components has one size, of at least 1", component.name);
                    self.refusals.add(format!("{}.dimensions", contents.key_of(number)), reason);
                }
            }
        }
    }

    /// Adds one of the components of a part's contents, or an element of an array of them: its size and the index.
    fn add_component(
        &mut self,
        around: usize,
        contents: &Contents<'a>,
        number: usize,
        element: Option<(usize, usize)>,
    ) {
        let (component, key) = (&contents.components[number], contents.key_of(number));
        let position = self.parts.len();
        let outer = &self.parts[around];
        let [subscript, index] = element.map_or_else(<[String; 2]>::default, |(_, index)| {
            [format!("[{}]", index + 1), format!("[{index}]")]
        });
        let part = Part {
            component: Some(component),
            name: outer.name_of(&component.name) + &subscript,
            general_names: outer
                .general_names
                .iter()
                .cloned()
                .chain(element.map(|_| (outer.arrays.len(), outer.name.clone())))
                .map(|(from, outer)| (from, name_within(&outer, &component.name)))
                .collect(),
            index: element.map(|(_, index)| index),
            arrays: outer.arrays.iter().copied().chain(element).collect(),
            path: format!("{}{}{index}.", outer.path, component.rust_name()),
            description: match &component.description {
                Some(description) => Some(outer.describe(description)),
                None => outer.description.clone(),
            },
            type_name: match &component.component_type {
                Some(name) => match self.types.get(name.as_str()) {
                    Some(&known) => self.declaration.component_types[known].rust_name(),
                    // It is refused below.
                    None => String::new(),
                },
                None => outer.type_name.clone() + &rust_type_name(&component.rust_name()),
            },
            around: Some(around),
            key: key.clone(),
            ..Part::default()
        };
        let name = part.name.clone();
        if let Err(reason) = length(&name) {
            return self.refusals.add(format!("{key}.name"), reason);
        }
        if position > MOST_COMPONENTS {
            let reason = format!("{name}: there are more than {MOST_COMPONENTS} components");
            return self.refusals.add(key, reason);
        }
        let is_written = component.variables.is_some() || !component.components.is_empty();
        let inner = match &component.component_type {
            None if is_written => {
                for (unused, of) in [
                    (!component.start.is_empty(), "start"),
                    (!component.connections.is_empty(), "connections"),
                ] {
                    if unused {
                        let reason = format!("{name}: '{of}' is for components with a type");
                        self.refusals.add(format!("{key}.{of}"), reason);
                    }
                }
                contents.of(number)
            }
            Some(wanted) if !is_written => match self.contents_of_type(wanted, around) {
                Ok(contents) => contents,
                Err(reason) => return self.refusals.add(format!("{key}.type"), format!("{name}: {reason}")),
            },
            _ => {
                let reason = format!("{name}: needs 'variables', 'components' or, instead of both, a 'type'");
                return self.refusals.add(key, reason);
            }
        };
        self.parts[around].components.push(position);
        self.add_part(part, &inner);
        if component.component_type.is_some() && element.is_none_or(|(_, index)| index == 0) {
            self.refuse_unknown_starts(position);
        }
    }

    /// What the components of a type contain, unless one of them is around a part.
    fn contents_of_type(&self, wanted: &str, part: usize) -> Result<Contents<'a>, String> {
        let found = self.types.get(wanted).ok_or_else(|| {
            format!("'{wanted}' is not one of the component_types{}", nearest(wanted, self.types.keys()))
        })?;
        let around = outward(&self.parts, part).filter_map(|part| self.parts[part].component_type());
        let mut chain: Vec<_> = [wanted].into_iter().chain(around).collect();
        if let Some(outer) = chain.iter().skip(1).position(|known| *known == wanted) {
            chain.truncate(outer + 2);
            chain.reverse();
            return Err(format!("the type '{wanted}' contains itself: {}", chain.join(" -> ")));
        }
        Ok(self.declaration.of_type(*found))
    }

    /// The start value that the outermost of the components around a part's variable gives it, and its path.
    ///
    /// In an array of components, a list has the value of each: that of a scalar, or lists for those of arrays.
    fn overridden(
        &mut self,
        part: &Part<'a>,
        variable: &VariableDeclaration,
    ) -> Result<Option<(&'a Value, String)>, Refusal> {
        let around = part.around.into_iter().flat_map(|around| outward(&self.parts, around));
        let parts = [part].into_iter().chain(around.map(|part| &self.parts[part]));
        let (mut name, mut found) = (variable.name.clone(), None);
        for part in parts {
            let Some(component) = part.component else { break };
            if let Some(start) = component.start.get(&name) {
                let key = format!("{}.start.{name}", part.key);
                self.started.insert(key.clone());
                let each = part.arrays.last().filter(|_| part.index.is_some()).and_then(|(size, index)| {
                    let values = start.as_array()?;
                    let is_of_each = variable.sizes.is_empty() || values.iter().all(Value::is_array);
                    is_of_each.then_some((values, size, index))
                });
                let start = match each {
                    Some((values, size, _)) if values.len() != *size => {
                        let (name, count) = (&component.name, values.len());
                        let reason = format!(
                            "{name}: there are {count} values of '{}', but {size} components",
                            variable.name
                        );
                        return Err(Refusal::new(key, reason));
                    }
                    Some((values, _, index)) => &values[*index],
                    None => start,
                };
                found = Some((start, key));
            }
            name = format!("{}.{name}", component.name);
        }
        Ok(found)
    }

    /// Rejects the start values of a component for variables that its type does not have.
    fn refuse_unknown_starts(&mut self, part: usize) {
        let Part { component: Some(component), name, key, .. } = &self.parts[part] else { return };
        for started in component.start.keys() {
            let path = format!("{key}.start.{started}");
            if !self.started.contains(&path) {
                // The parts in a component follow it.
                let fields = self.parts[part..].iter().flat_map(|part| {
                    part.fields
                        .iter()
                        .map(|field| part.name_of(&field.declaration.name)[name.len() + 1..].to_owned())
                });
                let nearest = nearest(started, fields);
                self.refusals.add(path, format!("{name}: its type has no variable '{started}'{nearest}"));
            }
        }
    }

    /// Spreads a declared variable into its scalars, each state followed by its derivative.
    fn add_field(
        &mut self,
        part: &Part<'a>,
        declaration: &'a VariableDeclaration,
        start: Option<&Value>,
        [key, start_key]: [String; 2],
    ) -> Result<Field<'a>, Refusal> {
        let name = part.name_of(&declaration.name);
        let before = self.scalars.len();
        let checked =
            variable::check(self.declaration, declaration, start, before).map_err(|(of, reason)| {
                let key = if of == "start" { start_key } else { format!("{key}.{of}") };
                Refusal::new(key, if of == "name" { reason } else { format!("{name}: {reason}") })
            })?;
        let mut positions = Vec::new();
        for (number, (subscripts, indices)) in elements(&declaration.sizes).into_iter().enumerate() {
            let position = self.scalars.len();
            positions.push(position);
            let unit = declaration.unit.as_ref().map(|unit| unit.of(number).to_owned());
            // A structural parameter's start value is its only value.
            let fixed = start.filter(|_| declaration.causality == Causality::StructuralParameter);
            let fixed = fixed.and_then(Value::as_f64);
            let state = Scalar {
                name: format!("{name}{subscripts}"),
                key: key.clone(),
                field: [self.parts.len(), part.fields.len()],
                place: checked.place,
                causality: declaration.causality,
                variability: checked.variability,
                initial: checked.initial,
                data_type: checked.data_type,
                texts: Texts {
                    description: declaration.description.as_deref().map(|text| part.describe(text)),
                    aliases: aliases(declaration, part, &subscripts),
                },
                quantity: Quantity {
                    real_type: declaration.real_type,
                    unit,
                    display_unit: declaration.display_unit.clone(),
                    is_relative: declaration.relative_quantity,
                    min: fixed.or(declaration.min),
                    max: fixed.or(declaration.max),
                    nominal: declaration.nominal,
                },
                dynamics: Dynamics {
                    state: None,
                    reinit: declaration.reinit,
                    strict: [declaration.strict_min, declaration.strict_max],
                },
                start: checked.starts.as_ref().map(|starts| starts[number].clone()),
                path: part.path.clone() + &declaration.rust_name() + &indices,
                ..Scalar::time()
            };
            let rate = rate_of(&state, position, part, declaration);
            self.add_scalar(state)?;
            rate.map_or(Ok(()), |rate| self.add_scalar(rate))?;
        }
        let calculated = match checked.place {
            Place::Inputs | Place::Parameters => false,
            Place::Clocks => declaration.causality != Causality::Input,
            Place::States => checked.initial != Some(Initial::Exact),
            _ => checked.variability != Variability::Constant,
        };
        let derivatives: Vec<_> = positions.iter().map(|position| position + 1).collect();
        let sizes = &declaration.sizes;
        if calculated {
            let [reads, initial_reads] =
                [&declaration.reads, &declaration.initial_reads].map(Option::as_deref);
            let positions = positions.clone();
            let arrays = part.arrays.clone();
            self.equations.push(Equation { positions, arrays, sizes, reads, initial_reads });
        }
        if let Some(derivative) = &declaration.derivative {
            let [reads, initial_reads] = [&derivative.reads, &derivative.initial_reads].map(Option::as_deref);
            let (positions, arrays) = (derivatives.clone(), part.arrays.clone());
            self.equations.push(Equation { positions, arrays, sizes, reads, initial_reads });
        }
        if !sizes.is_empty() {
            self.arrays.push(before..self.scalars.len());
            if checked.place == Place::States {
                self.names.insert(format!("der({name})"), derivatives);
            }
            let names = aliases(declaration, part, "").into_iter().map(|alias| alias.name);
            for name in names.chain([name]) {
                if self.names.insert(name.clone(), positions.clone()).is_some() {
                    return Err(duplicate(&name, &key));
                }
            }
        }
        self.spread(part, declaration, &positions);
        self.pin(declaration, &positions, &key)?;
        let is_boxed = positions.len() > MOST_INLINE;
        Ok(Field { declaration, place: checked.place, data_type: checked.data_type, positions, is_boxed })
    }

    /// Adds a variable's scalars to those of the other elements of arrays of components.
    fn spread(&mut self, part: &Part<'a>, declaration: &VariableDeclaration, positions: &[usize]) {
        for (from, general) in &part.general_names {
            let of_components = part.arrays[*from..].iter().map(|(size, _)| *size);
            let sizes: Vec<_> = of_components.chain(declaration.sizes.iter().copied()).collect();
            let general = format!("{general}.{}", declaration.name);
            let of_derivative = declaration.derivative.as_ref().map(|_| (format!("der({general})"), 1));
            for (name, offset) in [(general, 0)].into_iter().chain(of_derivative) {
                let spread = self.spread.entry(name).or_default();
                spread.sizes.clone_from(&sizes);
                spread.positions.extend(positions.iter().map(|position| position + offset));
            }
        }
    }

    fn add_scalar(&mut self, scalar: Scalar) -> Result<(), Refusal> {
        let aliases = scalar.texts.aliases.iter().map(|alias| &alias.name);
        for name in aliases.chain([&scalar.name]) {
            if self.names.insert(name.clone(), vec![self.scalars.len()]).is_some() {
                return Err(duplicate(name, &scalar.key));
            }
        }
        self.scalars.push(scalar);
        Ok(())
    }

    /// Records the declared value references of a variable and its derivative. An undeclared reference of the
    /// derivative is the next number.
    fn pin(
        &mut self,
        declaration: &VariableDeclaration,
        positions: &[usize],
        key: &str,
    ) -> Result<(), Refusal> {
        let derivative = declaration.derivative.as_ref();
        let own_derivative = derivative.and_then(|derivative| derivative.value_reference);
        let stride = if derivative.is_some() && own_derivative.is_none() { 2 } else { 1 };
        let mut pin = |first: Option<i64>, step: usize, offset: usize, key: &str| {
            let key = format!("{key}.value_reference");
            for (number, position) in positions.iter().enumerate() {
                let Some(first) = first else { continue };
                let reference = first.saturating_add((number * step).cast_signed() as i64);
                let in_range =
                    u32::try_from(reference).ok().filter(|&reference| reference <= LARGEST_REFERENCE);
                let reference = in_range.ok_or_else(|| {
                    let reason =
                        format!("value references go from 0 to {LARGEST_REFERENCE}, not {reference}");
                    Refusal::new(&key, reason)
                })?;
                self.pinned.push((position + offset, reference, key.clone()));
            }
            Ok(())
        };
        let own = declaration.value_reference;
        pin(own, stride, 0, key)?;
        pin(own_derivative, 1, 1, &format!("{key}.derivative"))?;
        if stride == 2 {
            pin(own.map(|own| own.saturating_add(1)), stride, 1, key)?;
        }
        Ok(())
    }

    /// Rejects types without a component, which nothing would check.
    fn refuse_unused_types(&mut self) {
        let used: BTreeSet<_> = self.parts.iter().filter_map(Part::component_type).collect();
        for (number, component_type) in self.declaration.component_types.iter().enumerate() {
            let name = &component_type.name;
            if !used.contains(name.as_str()) {
                self.refusals
                    .add(format!("component_types[{number}]"), format!("no component has the type '{name}'"));
            }
        }
    }

    /// Assigns the declared value references, and then the gaps to other variables, in declaration order. An array gets
    /// the first gap that holds all its elements, so that their numbers follow a rule.
    fn assign_value_references(&mut self) {
        let mut taken = BTreeMap::new();
        for (position, reference, key) in &self.pinned {
            if let Some(other) = taken.insert(*reference, *position) {
                let (name, other) = (&self.scalars[*position].name, &self.scalars[other].name);
                let reason = format!("{name}: '{other}' also has the value reference {reference}");
                self.refusals.add(key, reason);
            }
            self.scalars[*position].value_reference = *reference;
        }
        let pinned: BTreeSet<_> = self.pinned.iter().map(|(position, ..)| *position).collect();
        let (mut arrays, mut position, mut first_free) = (self.arrays.iter().peekable(), 0, 0);
        while position < self.scalars.len() {
            let end = arrays.next_if(|array| array.start == position).map_or(position + 1, |array| array.end);
            let open: Vec<_> = (position..end).filter(|position| !pinned.contains(position)).collect();
            position = end;
            while taken.contains_key(&first_free) {
                first_free += 1;
            }
            let mut first = first_free;
            while let Some((last, _)) =
                taken.range(first..).take_while(|(at, _)| ((**at - first) as usize) < open.len()).last()
            {
                first = last + 1;
            }
            for (position, reference) in open.into_iter().zip(first..) {
                taken.insert(reference, position);
                self.scalars[position].value_reference = reference;
            }
        }
    }
}

/// The derivative of a part's state at a position, if the variable is a state.
fn rate_of(
    state: &Scalar,
    position: usize,
    part: &Part<'_>,
    declaration: &VariableDeclaration,
) -> Option<Scalar> {
    let derivative = declaration.derivative.as_ref()?;
    let description = match &derivative.description {
        Some(description) => part.describe(description),
        None => derivative_description(&state.name),
    };
    let unit = derivative.unit.clone().or_else(|| state.quantity.unit.as_deref().map(per_second));
    Some(Scalar {
        name: format!("der({})", state.name),
        key: format!("{}.derivative", state.key),
        field: state.field,
        place: Place::Derivatives,
        path: state.path.clone(),
        causality: Causality::Local,
        variability: Variability::Continuous,
        initial: Some(Initial::Calculated),
        texts: Texts { description: Some(description), aliases: vec![] },
        quantity: Quantity { unit, ..Quantity::default() },
        dynamics: Dynamics { state: Some(position), ..Dynamics::default() },
        ..Scalar::time()
    })
}

/// The further names of a part's variable, or of its element.
fn aliases(declaration: &VariableDeclaration, part: &Part<'_>, subscripts: &str) -> Vec<Alias> {
    let of_variable = declaration.description.as_deref();
    let alias = |alias: &AliasDeclaration| Alias {
        name: part.name_of(&alias.name) + subscripts,
        description: alias.description.as_deref().or(of_variable).map(|text| part.describe(text)),
    };
    declaration.aliases.iter().map(alias).collect()
}

fn duplicate(name: &str, key: &str) -> Refusal {
    Refusal::new(format!("{key}.name"), format!("{name}: another variable has this name"))
}

/// The elements of an array, row by row: the subscripts in the notation of FMI (`[1,2]`) and the indices in that of
/// Rust (`[0][1]`). A scalar has one element without either.
fn elements(dimensions: &[usize]) -> Vec<(String, String)> {
    let mut elements = vec![Vec::new()];
    for &size in dimensions {
        elements = elements
            .iter()
            .flat_map(|outer| (0..size).map(|index| [outer.as_slice(), &[index]].concat()))
            .collect();
    }
    elements
        .iter()
        .map(|element| {
            let subscripts: Vec<_> = element.iter().map(|index| (index + 1).to_string()).collect();
            let indices: Vec<_> = element.iter().map(|index| format!("[{index}]")).collect();
            (
                if subscripts.is_empty() { String::new() } else { format!("[{}]", subscripts.join(",")) },
                indices.concat(),
            )
        })
        .collect()
}
