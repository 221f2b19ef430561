//! The states as arrays, for solvers, and by group.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::generator::{Component, Generator, Members, bound, filled, markdown};
use super::structs::is_copied;
use crate::declaration::Described;
use crate::model::{Field, Place};
use crate::type_names::{STATE_GROUPS, states_name};

impl Generator<'_, '_> {
    /// All states as an array, for solvers.
    pub(super) fn states_impl(&self) -> String {
        self.arrays(Place::States.type_name(), &self.members(Place::States, &self.model.parts[0]), "")
    }

    /// The structs that each hold a group's states.
    pub(super) fn state_groups(&self) -> String {
        let groups = &self.model.declaration.state_groups;
        let (mut text, mut all_are_copy) = (String::new(), true);
        let (mut structs, mut fields) = (String::new(), String::new());
        let mut components_of: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for component in Component::all(self.model.components(&self.model.parts[0])) {
            let Some(group) = component.first().state_group() else { continue };
            let name = component.first().rust_name();
            components_of.entry(group).or_default().push(component);
            let _ = writeln!(fields, "            {name}: groups.{group}.{name},");
        }
        for Described { name: group, description } in groups {
            let name = states_name(group);
            let components = components_of.remove(group.as_str()).unwrap_or_default();
            let members = Members { fields: Vec::new(), components };
            let scalar = |field: &Field<'_>| &self.model.scalars[field.positions[0]];
            let nominal = |field: &Field<'_>| {
                let nominal = format!("{:?}", scalar(field).quantity.nominal.unwrap_or(1.0));
                filled(&field.declaration.sizes, &nominal, true)
            };
            let min = |field: &Field<'_>| {
                filled(
                    &field.declaration.sizes,
                    &bound(scalar(field).quantity.min, "f64::NEG_INFINITY"),
                    true,
                )
            };
            let constants = format!(
                "
    /// The states' nominal values; 1 if undeclared.
    pub const NOMINAL: Self = Self {{
            {}
    }};

    /// The declared minimum values.
    pub const MIN: Self = Self {{
            {}
    }};
",
                self.values(Place::States, &members, &nominal),
                self.values(Place::States, &members, &min),
            );
            let title = format!("The states of a group: {}.", markdown(description));
            text += &self.members_struct(Place::States, &name, &title, &members);
            text += &self.arrays(&name, &members, &constants);
            let is_copy = self.all(Place::States, &members).into_iter().all(is_copied);
            all_are_copy &= is_copy;
            let clone = if is_copy { "" } else { ".clone()" };
            let of = members.components.iter().map(|component| component.first().rust_name());
            let of: Vec<_> = of.map(|name| format!("{name}: states.{name}{clone}")).collect();
            let _ = write!(
                text,
                "
impl<T: ::core::marker::Copy> {name}<T> {{
    /// This group's states among all states.
    #[must_use]
    pub fn of(states: &States<T>) -> Self {{
        Self {{ {} }}
    }}
}}
",
                of.join(", ")
            );
            let _ = writeln!(structs, "    /// {}\n    pub {group}: {name}<T>,", markdown(description));
        }
        if !groups.is_empty() {
            let _ = write!(
                text,
                "
/// All states by group.
#[derive(Clone, {copy}Debug, PartialEq)]
pub struct {STATE_GROUPS}<T = f64> {{
{structs}}}

impl<T: ::core::marker::Copy> States<T> {{
    /// All states, from their groups.
    #[must_use]
    pub fn from_groups(groups: {STATE_GROUPS}<T>) -> Self {{
        Self {{
{fields}        }}
    }}
}}
",
                copy = if all_are_copy { "Copy, " } else { "" },
            );
        }
        text
    }

    /// The states of some members as an array, with further constants; neither of states on the heap.
    fn arrays(&self, name: &str, members: &Members<'_, '_>, constants: &str) -> String {
        let fields = self.all(Place::States, members);
        let count: usize = fields.iter().map(|field| field.positions.len()).sum();
        let number = format!(
            "
impl {name} {{
    /// The number of states.
    pub const COUNT: usize = {count};
"
        );
        if fields.iter().any(|field| field.is_boxed) {
            return number + "}\n";
        }
        let scalar = |field: &Field<'_>| &self.model.scalars[field.positions[0]];
        let are_scalars = fields.iter().all(|field| field.declaration.sizes.is_empty());
        let (mut names, mut values) = (String::new(), "[]".to_owned());
        if are_scalars {
            let states: Vec<_> = fields.iter().map(|field| scalar(field)).collect();
            let named: Vec<_> = states.iter().map(|state| format!("{:?}", state.name)).collect();
            names = format!(
                "
    /// The names of the states, in the order of the arrays.
    pub const NAMES: [&'static str; Self::COUNT] = [{}];
",
                named.join(", ")
            );
            let paths: Vec<_> = states.iter().map(|state| format!("self.{}", state.path)).collect();
            values = format!("[{}]", paths.join(", "));
        } else if let Some(first) = fields.first() {
            values = format!(
                "let mut values = [self.{}; {count}];
        let mut number = 0;
        self.for_each(&mut |value| {{
            values[number] = value;
            number += 1;
        }});
        values",
                scalar(first).path
            );
        }
        // Each field from those after the fields before it.
        let mut before = BTreeMap::new();
        let mut next = 0;
        for field in &fields {
            before.insert(field.positions[0], next);
            next += field.positions.len();
        }
        let element =
            |field: &Field<'_>| element(&field.declaration.sizes, &before[&field.positions[0]].to_string());
        let fields = self.values(Place::States, members, &element);
        let argument = if count == 0 { "_" } else { "values" };
        let (of, to, real) =
            if count == 0 { ("", "", "f64") } else { ("<T: ::core::marker::Copy>", "<T>", "T") };
        let constness = if are_scalars { "const " } else { "" };
        format!(
            "{number}{names}{constants}}}

impl{of} {name}{to} {{
    /// The states from an array, in the order of declaration.
    #[must_use]
    pub fn from_array({argument}: [{real}; {count}]) -> Self {{
        Self {{
            {fields}
        }}
    }}

    /// The states as an array, in the order of declaration.
    #[must_use]
    pub {constness}fn to_array(&self) -> [{real}; {count}] {{
        {values}
    }}
}}
"
        )
    }
}

/// A field of an array expression's value `values` from a position on.
fn element(sizes: &[usize], position: &str) -> String {
    let Some((size, inner)) = sizes.split_first() else { return format!("values[{position}]") };
    let (index, step) = (format!("i{}", inner.len()), inner.iter().product::<usize>());
    let position =
        if step == 1 { format!("{position} + {index}") } else { format!("{position} + {step} * {index}") };
    format!("::core::array::from_fn::<_, {size}, _>(|{index}| {})", element(inner, &position))
}
