//! The states as arrays, for solvers, and by group.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::generator::{Generator, bound, markdown, nested_values, numbered};
use crate::declaration::Described;
use crate::model::{Part, Place};
use crate::type_names::{STATE_GROUPS, states_name};

impl Generator<'_, '_> {
    /// All states as an array, for solvers.
    pub(super) fn states_impl(&self) -> String {
        let parts: Vec<_> = self.model.parts.iter().filter(|part| Place::States.is_in(part)).collect();
        self.arrays(Place::States.type_name(), &parts, "")
    }

    /// The structs that each hold a group's states.
    pub(super) fn state_groups(&self) -> String {
        let groups = &self.model.declaration.state_groups;
        let mut text = String::new();
        let (mut members, mut fields) = (String::new(), vec![String::new(); self.model.parts.len()]);
        let mut parts_of: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (position, part) in self.model.parts.iter().enumerate() {
            parts_of.entry(part.state_group).or_default().push((position, part));
        }
        for Described { name: group, description } in groups {
            let name = states_name(group);
            let own = parts_of.remove(&Some(group.as_str())).unwrap_or_default();
            let parts: Vec<_> = own.iter().map(|(_, part)| *part).collect();
            let nominal =
                |position: usize| format!("{:?}", self.model.scalars[position].nominal.unwrap_or(1.0));
            let min = |position: usize| bound(self.model.scalars[position].min, "f64::NEG_INFINITY");
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
                nested_values(Place::States, &parts, nominal),
                nested_values(Place::States, &parts, min),
            );
            let title = format!("The states of a group: {}.", markdown(description));
            text += &self.place_struct(Place::States, &name, &title, &parts);
            text += &self.arrays(&name, &parts, &constants);
            let of = parts.iter().filter_map(|part| part.name);
            let of: Vec<_> = of.map(|name| format!("{name}: states.{name}")).collect();
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
            let _ = writeln!(members, "    /// {}\n    pub {group}: {name}<T>,", markdown(description));
            for (position, part) in own {
                let component = part.name.unwrap_or_default();
                fields[position] = format!("            {component}: groups.{group}.{component},\n");
            }
        }
        if !groups.is_empty() {
            let _ = write!(
                text,
                "
/// All states by group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct {STATE_GROUPS}<T = f64> {{
{members}}}

impl<T: ::core::marker::Copy> States<T> {{
    /// All states, from their groups.
    #[must_use]
    pub fn from_groups(groups: {STATE_GROUPS}<T>) -> Self {{
        Self {{
{}        }}
    }}
}}
",
                fields.concat()
            );
        }
        text
    }

    /// Some parts' states as an array, with further constants.
    fn arrays(&self, name: &str, parts: &[&Part<'_>], constants: &str) -> String {
        let fields = parts.iter().flat_map(|part| Place::States.fields(part));
        let positions: Vec<_> = fields.flat_map(|field| field.positions.iter().copied()).collect();
        let states: Vec<_> = positions.iter().map(|&position| &self.model.scalars[position]).collect();
        let names: Vec<_> = states.iter().map(|state| format!("{:?}", state.name)).collect();
        let values: Vec<_> = states.iter().map(|state| format!("self.{}", state.path)).collect();
        let places = numbered(&positions);
        let element = |position| format!("values[{}]", places[&position]);
        let fields = nested_values(Place::States, parts, element);
        let argument = if states.is_empty() { "_" } else { "values" };
        let (of, to, real) =
            if states.is_empty() { ("", "", "f64") } else { ("<T: ::core::marker::Copy>", "<T>", "T") };
        let count = states.len();
        format!(
            "
impl {name} {{
    /// The number of states.
    pub const COUNT: usize = {count};

    /// The names of the states, in the order of the arrays.
    pub const NAMES: [&'static str; Self::COUNT] = [{names}];
{constants}}}

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
    pub const fn to_array(&self) -> [{real}; {count}] {{
        [{values}]
    }}
}}
",
            names = names.join(", "),
            values = values.join(", "),
        )
    }
}
