//! Turns the declaration into parts and scalars: fills in components, and spreads arrays into scalars.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use fmu_terms::per_second;
use fmu_terms::{Causality, Initial, Variability};
use serde_json::Value;

use crate::check::variable;
use crate::declaration::{AliasDeclaration, ComponentDeclaration, Declaration, VariableDeclaration};
use crate::error::{Refusal, Refusals, nearest};
use crate::model::{Alias, Field, Part, Place, Scalar, derivative_description};

/// The largest value reference that can be declared, leaving room for those that follow.
const LARGEST_REFERENCE: u32 = i32::MAX.cast_unsigned();

/// Parts and scalars whose names are not yet resolved.
pub(crate) struct Flat<'a> {
    pub(crate) declaration: &'a Declaration,
    /// The positions of the component types.
    types: BTreeMap<&'a str, usize>,
    pub(crate) parts: Vec<Part<'a>>,
    pub(crate) scalars: Vec<Scalar>,
    /// The declared value references, with their keys' paths.
    pinned: Vec<(usize, u32, String)>,
    /// The scalars behind each name in `reads`, of a scalar or an array.
    pub(crate) names: BTreeMap<String, Vec<usize>>,
    /// The positions of each array's elements, with their derivatives.
    arrays: Vec<Range<usize>>,
    /// The equations whose reads are not yet resolved.
    pub(crate) equations: Vec<Equation<'a>>,
    /// Whether elements of an array read different variables.
    pub(crate) reads_elements: bool,
    pub(crate) refusals: Refusals,
}

/// What a variable's elements read, as declared.
pub(crate) struct Equation<'a> {
    pub(crate) positions: Vec<usize>,
    pub(crate) sizes: &'a [usize],
    pub(crate) component: Option<&'a ComponentDeclaration>,
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
            scalars: vec![Scalar::time()],
            pinned: Vec::new(),
            names: BTreeMap::from([("time".to_owned(), vec![0])]),
            arrays: Vec::new(),
            equations: Vec::new(),
            reads_elements: false,
            refusals: Refusals::default(),
        };
        flat.add_part("variables", None, &declaration.variables);
        for (number, component) in declaration.components.iter().enumerate() {
            flat.add_component(number, component);
        }
        flat.refuse_unused_types();
        flat.refusals.check()?;
        flat.assign_value_references();
        Ok(flat)
    }

    fn add_component(&mut self, number: usize, component: &'a ComponentDeclaration) {
        let (name, key) = (&component.name, format!("components[{number}]"));
        let types = &self.declaration.component_types;
        let (variables, list) = match (&component.variables, &component.component_type) {
            (Some(variables), None) => {
                for (unused, of) in [
                    (!component.start.is_empty(), "start"),
                    (!component.connections.is_empty(), "connections"),
                ] {
                    if unused {
                        let reason = format!("{name}: '{of}' is for components with a type");
                        self.refusals.add(format!("{key}.{of}"), reason);
                    }
                }
                (variables, format!("{key}.variables"))
            }
            (None, Some(wanted)) => {
                if let Some(&found) = self.types.get(wanted.as_str()) {
                    (&types[found].variables, format!("component_types[{found}].variables"))
                } else {
                    let nearest = nearest(wanted, self.types.keys());
                    let reason = format!("{name}: '{wanted}' is not one of the component_types{nearest}");
                    return self.refusals.add(format!("{key}.type"), reason);
                }
            }
            _ => return self.refusals.add(key, format!("{name}: needs either 'variables' or a 'type'")),
        };
        let names: BTreeSet<_> = variables.iter().map(|variable| &variable.name).collect();
        for started in component.start.keys() {
            if !names.contains(started) {
                let nearest = nearest(started, &names);
                let reason = format!("{name}: its type has no variable '{started}'{nearest}");
                self.refusals.add(format!("{key}.start.{started}"), reason);
            }
        }
        self.add_part(&list, Some((number, component)), variables);
    }

    fn add_part(
        &mut self,
        list: &str,
        component: Option<(usize, &'a ComponentDeclaration)>,
        variables: &'a [VariableDeclaration],
    ) {
        let (number, component) = component.unzip();
        let mut part = Part {
            name: component.map(|component| component.name.as_str()),
            component_type: component.and_then(|component| component.component_type.as_deref()),
            state_group: component.and_then(|component| component.state_group.as_deref()),
            description: component.and_then(|component| component.description.as_deref()),
            fields: Vec::new(),
            key: number.map(|number| format!("components[{number}]")).unwrap_or_default(),
        };
        let mut names = BTreeMap::new();
        for (position, variable) in variables.iter().enumerate() {
            let key = format!("{list}[{position}]");
            let own = component.and_then(|component| component.start.get(&variable.name));
            let (start, start_key) = match own {
                Some(_) => (own, format!("{}.start.{}", part.key, variable.name)),
                None => (variable.start.as_ref(), format!("{key}.start")),
            };
            let name_key = format!("{key}.name");
            let field = self.add_field(&part, component, variable, start, [key, start_key]);
            let Some(field) = self.refusals.take(field) else { continue };
            let name = &variable.name;
            if let Some(other) = names.insert((field.place, field.name()), name) {
                let reason =
                    format!("{name}: its Rust name is that of '{other}'; give it another 'rust_name'");
                self.refusals.add(name_key, reason);
            }
            part.fields.push(field);
        }
        self.parts.push(part);
    }

    /// Spreads a declared variable into its scalars, each state followed by its derivative.
    fn add_field(
        &mut self,
        part: &Part<'a>,
        component: Option<&'a ComponentDeclaration>,
        declaration: &'a VariableDeclaration,
        start: Option<&Value>,
        [key, start_key]: [String; 2],
    ) -> Result<Field<'a>, Refusal> {
        let prefix = part.name.map(|component| format!("{component}.")).unwrap_or_default();
        let name = format!("{prefix}{}", declaration.name);
        let describe = |text: &str| match part.description {
            Some(component) => format!("{component}: {text}"),
            None => text.to_owned(),
        };
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
                description: declaration.description.as_deref().map(describe),
                place: checked.place,
                causality: declaration.causality,
                variability: checked.variability,
                initial: checked.initial,
                data_type: checked.data_type,
                unit: unit.clone(),
                display_unit: declaration.display_unit.clone(),
                aliases: aliases(declaration, &prefix, &subscripts, describe),
                min: fixed.or(declaration.min),
                max: fixed.or(declaration.max),
                nominal: declaration.nominal,
                reinit: declaration.reinit,
                strict: [declaration.strict_min, declaration.strict_max],
                start: checked.starts.as_ref().map(|starts| starts[number].clone()),
                path: format!("{prefix}{}{indices}", declaration.rust_name()),
                ..Scalar::time()
            };
            let rate = declaration.derivative.as_ref().map(|derivative| Scalar {
                name: format!("der({})", state.name),
                key: format!("{key}.derivative"),
                field: state.field,
                description: Some(match &derivative.description {
                    Some(description) => describe(description),
                    None => derivative_description(&state.name),
                }),
                place: Place::Derivatives,
                causality: Causality::Local,
                variability: Variability::Continuous,
                initial: Some(Initial::Calculated),
                unit: derivative.unit.clone().or_else(|| unit.as_deref().map(per_second)),
                state: Some(position),
                path: state.path.clone(),
                ..Scalar::time()
            });
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
            self.equations.push(Equation { positions, sizes, component, reads, initial_reads });
        }
        if let Some(derivative) = &declaration.derivative {
            let [reads, initial_reads] = [&derivative.reads, &derivative.initial_reads].map(Option::as_deref);
            let positions = derivatives.clone();
            self.equations.push(Equation { positions, sizes, component, reads, initial_reads });
        }
        if !sizes.is_empty() {
            self.arrays.push(before..self.scalars.len());
            if checked.place == Place::States {
                self.names.insert(format!("der({name})"), derivatives);
            }
            let names = aliases(declaration, &prefix, "", describe).into_iter().map(|alias| alias.name);
            for name in names.chain([name]) {
                if self.names.insert(name.clone(), positions.clone()).is_some() {
                    return Err(duplicate(&name, &key));
                }
            }
        }
        self.pin(declaration, &positions, &key)?;
        Ok(Field { declaration, place: checked.place, data_type: checked.data_type, positions })
    }

    fn add_scalar(&mut self, scalar: Scalar) -> Result<(), Refusal> {
        let aliases = scalar.aliases.iter().map(|alias| &alias.name);
        for name in aliases.chain([&scalar.name]) {
            if self.names.insert(name.clone(), vec![self.scalars.len()]).is_some() {
                return Err(duplicate(name, &scalar.key));
            }
        }
        self.scalars.push(scalar);
        Ok(())
    }

    /// Records the declared value references of a variable and its derivative. An undeclared one of the derivative is
    /// the next number.
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
        let used: BTreeSet<_> = self.parts.iter().filter_map(|part| part.component_type).collect();
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

/// The further names of a variable in a component, or of its element.
fn aliases(
    declaration: &VariableDeclaration,
    prefix: &str,
    subscripts: &str,
    describe: impl Fn(&str) -> String,
) -> Vec<Alias> {
    let of_variable = declaration.description.as_deref();
    let alias = |alias: &AliasDeclaration| Alias {
        name: format!("{prefix}{}{subscripts}", alias.name),
        description: alias.description.as_deref().or(of_variable).map(&describe),
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
