//! The names of generated types.

use std::collections::BTreeSet;

use crate::model::{Field, Model, Part, Place};
use crate::names::pascal_case;

/// The types that are always generated.
pub(crate) const FIXED_NAMES: [&str; 7] =
    ["Parameters", "Inputs", "States", "Locals", "Outputs", "Variables", "Evaluation"];

/// The type that holds all state groups, if any.
pub(crate) const STATE_GROUPS: &str = "StateGroups";

/// The places with their own structs; derivatives use those of the states.
pub(crate) const PLACES: [Place; 7] = [
    Place::Parameters,
    Place::CalculatedParameters,
    Place::Inputs,
    Place::States,
    Place::Locals,
    Place::Outputs,
    Place::Clocks,
];

impl Place {
    /// Whether models without such variables lack the struct and its field.
    pub(crate) fn is_optional(self) -> bool {
        matches!(self, Self::CalculatedParameters | Self::Clocks)
    }

    /// The field of `Variables`, its type, and what it holds.
    fn texts(self) -> [&'static str; 3] {
        match self {
            Self::Parameters => ["parameters", "Parameters", "The parameters"],
            Self::CalculatedParameters => {
                ["calculated_parameters", "CalculatedParameters", "What follows from the parameters"]
            }
            Self::Inputs => ["inputs", "Inputs", "The inputs"],
            Self::States => ["states", "States", "The continuous-time states"],
            Self::Derivatives => ["derivatives", "States", "The continuous-time states"],
            Self::Outputs => ["outputs", "Outputs", "The outputs other than states"],
            Self::Clocks => ["clocks", "Clocks", "The clocks"],
            Self::Locals | Self::Time | Self::EventIndicators => {
                ["locals", "Locals", "The local variables other than states"]
            }
        }
    }

    pub(crate) fn field_name(self) -> &'static str {
        self.texts()[0]
    }

    pub(crate) fn type_name(self) -> &'static str {
        self.texts()[1]
    }

    pub(crate) fn description(self) -> &'static str {
        self.texts()[2]
    }

    pub(crate) fn fields<'p, 'a>(self, part: &'p Part<'a>) -> impl Iterator<Item = &'p Field<'a>> {
        part.fields.iter().filter(move |field| field.place == self)
    }

    /// The struct that holds a part's variables.
    pub(crate) fn struct_name(self, part: &Part<'_>) -> String {
        part.type_name.clone() + self.type_name()
    }
}

/// The struct names of components and state groups, each with the path of its origin.
pub(crate) fn struct_names(model: &Model<'_>) -> Vec<(String, String)> {
    let declaration = model.declaration;
    // Components of a type, or within a type, share the structs.
    let mut origins = BTreeSet::new();
    let mut is_first =
        |part: &&Part<'_>| origins.insert(part.component_type().unwrap_or(&part.key).to_owned());
    let own: Vec<_> = model.parts[1..].iter().filter(&mut is_first).collect();
    let groups = declaration.state_groups.iter().enumerate();
    own.into_iter()
        .flat_map(|part| {
            let places = PLACES.into_iter().filter(|&place| !model.held(place, part).is_empty());
            places.map(|place| (format!("{}.name", part.key), place.struct_name(part)))
        })
        .chain(
            groups.map(|(number, group)| (format!("state_groups[{number}].name"), states_name(&group.name))),
        )
        .chain(
            (!declaration.state_groups.is_empty())
                .then(|| ("state_groups".to_owned(), STATE_GROUPS.to_owned())),
        )
        .collect()
}

/// The struct that holds a group's states.
pub(crate) fn states_name(group: &str) -> String {
    pascal_case(group) + Place::States.type_name()
}
