//! A model's declaration, as written.
//!
//! Editors show the comments of the fields: schema/model.schema.json is generated from them.

mod variable;

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use fmu_terms::{Causality, DataType, MatchingRule, Version};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use crate::error::Refusal;
use crate::names::{rust_name, rust_type_name};
use crate::value_type::ValueType;

#[cfg(test)]
use variable::start_schema;
pub(crate) use variable::{AliasDeclaration, Dimension, OneOrEach, VariableDeclaration};

/// A model: its name and variables.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Declaration {
    /// The JSON Schema of this file, for editors.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Name of the model, the FMU and its library. Default: the package's name, with _ for -.
    pub(crate) model_identifier: Option<String>,
    /// What the model represents. Default: the package's description.
    pub(crate) description: Option<String>,
    /// Default: the package's authors.
    pub(crate) author: Option<String>,
    /// Omitted by default.
    pub(crate) copyright: Option<String>,
    /// Default: the package's license.
    pub(crate) license: Option<String>,
    /// Settings that an importer proposes for a run.
    pub(crate) default_experiment: Option<DefaultExperiment>,
    /// What the FMU can do. Default: everything except derivatives and Event Mode, which not every model implements.
    #[serde(default)]
    pub(crate) capabilities: Capabilities,
    /// Additional log categories, or new descriptions of the built-in logStatusError, logStatusWarning and logEvents.
    #[serde(default)]
    pub(crate) log_categories: Vec<Described>,
    /// How the FMU warns. Some importers end a run at the status fmi2Warning. Default: by a message.
    #[serde(default)]
    pub(crate) warnings: Warnings,
    /// File of units beyond those of SI, relative to this file.
    pub(crate) units: Option<String>,
    /// HTML fragment for the documentation page, relative to this file.
    pub(crate) documentation: Option<String>,
    /// PNG that importers show for the FMU, relative to this file.
    pub(crate) icon: Option<String>,
    /// Folder of files that the model reads at run time, relative to this file; becomes the FMU's folder resources.
    pub(crate) resources: Option<String>,
    /// Types whose values are names.
    #[serde(default)]
    pub(crate) enumerations: Vec<EnumerationDeclaration>,
    /// Types of Reals, with attributes that variables of the type have unless they declare them.
    #[serde(default)]
    pub(crate) real_types: Vec<RealType>,
    /// The model's own variables: its inputs and outputs, and others that belong to no component.
    #[serde(default)]
    pub(crate) variables: Vec<VariableDeclaration>,
    /// Variables and components shared by several components.
    #[serde(default)]
    pub(crate) component_types: Vec<ComponentType>,
    /// The model's parts. Variable x of component c is called c.x.
    #[serde(default)]
    pub(crate) components: Vec<ComponentDeclaration>,
    /// Groups of components whose states are integrated together.
    #[serde(default)]
    pub(crate) state_groups: Vec<Described>,
    /// Names of the event indicators: functions whose sign changes are events.
    #[serde(default)]
    pub(crate) event_indicators: Vec<String>,
    /// Event indicators that no event may leave positive, such as the distance beyond an end stop.
    #[serde(default)]
    pub(crate) limits: Vec<String>,
    /// Groups of variables that tools connect to another FMU in one operation.
    #[serde(default)]
    pub(crate) terminals: Vec<TerminalDeclaration>,
    /// The clock of a sampled model in Scheduled Execution, which ticks at each sample.
    pub(crate) clock: Option<ClockDeclaration>,
    /// The same as a variable, from [`Declaration::complete`].
    #[serde(skip)]
    pub(crate) sample_clock: Option<VariableDeclaration>,
}

/// A clock whose interval is a sampled model's period (FMI 3.0.2, section 2.2.8).
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ClockDeclaration {
    pub(crate) name: String,
    pub(crate) description: Option<String>,
}

impl Declaration {
    /// Adds what follows from the rest.
    pub(crate) fn complete(&mut self) -> Result<(), Refusal> {
        // FMI 3.0.2, section 4.4: an FMU with clocks has Event Mode.
        self.capabilities.event_mode |= self.has_clocks();
        self.sample_clock = self.clock.as_ref().map(ClockDeclaration::variable);
        self.complete_variables()
    }

    /// Adds to variables what their types say, and the sizes of arrays, some of which are structural parameters.
    fn complete_variables(&mut self) -> Result<(), Refusal> {
        let is_structural =
            |variable: &&VariableDeclaration| variable.causality == Causality::StructuralParameter;
        let structural = self.variables.iter().filter(is_structural);
        let size = |start: &Option<Value>| usize::try_from(start.as_ref()?.as_u64()?).ok();
        let sizes: BTreeMap<_, _> =
            structural.map(|variable| (variable.name.clone(), size(&variable.start))).collect();
        let own = lists("", &mut self.variables, &mut self.components);
        let of_types = self.component_types.iter_mut().enumerate().flat_map(|(number, known)| {
            lists(&format!("component_types[{number}]"), &mut known.variables, &mut known.components)
        });
        for (list, variables) in own.into_iter().chain(of_types) {
            for (number, variable) in variables.iter_mut().enumerate() {
                variable.take_from_type(&self.real_types);
                for dimension in &variable.dimensions {
                    variable.sizes.push(match dimension {
                        Dimension::Size(size) => *size,
                        Dimension::Parameter(name) => {
                            sizes.get(name).copied().flatten().ok_or_else(|| {
                                let of = &variable.name;
                                let reason =
                                    format!("{of}: there is no structuralParameter '{name}' with a size");
                                Refusal::new(format!("{list}[{number}].dimensions"), reason)
                            })?
                        }
                    });
                }
            }
        }
        Ok(())
    }

    /// What the model, its types and the components in both contain.
    pub(crate) fn contents(&self) -> Vec<Contents<'_>> {
        let types = 0..self.component_types.len();
        [self.own()]
            .into_iter()
            .chain(types.map(|number| self.of_type(number)))
            .flat_map(Contents::all)
            .collect()
    }

    /// What the model itself contains.
    pub(crate) fn own(&self) -> Contents<'_> {
        Contents { key: String::new(), variables: &self.variables, components: &self.components }
    }

    /// What a type contains.
    pub(crate) fn of_type(&self, number: usize) -> Contents<'_> {
        let ComponentType { variables, components, .. } = &self.component_types[number];
        Contents { key: format!("component_types[{number}]"), variables, components }
    }

    /// The variables' built-in types.
    fn types(&self) -> impl Iterator<Item = DataType> {
        let variables = self.contents().into_iter().flat_map(|contents| contents.variables);
        variables.filter_map(|variable| ValueType::of_name(&variable.data_type))
    }

    /// Whether a variable's type does not exist in FMI 2.0.
    pub(crate) fn needs_fmi3(&self) -> bool {
        self.types().any(|data_type| !data_type.is_of(Version::Two))
    }

    /// Whether a variable is a clock.
    pub(crate) fn has_clocks(&self) -> bool {
        self.types().any(|data_type| data_type == DataType::Clock)
    }

    /// Whether importers may exchange values within a communication step. A model with clocks computes in Event Mode
    /// only.
    pub(crate) fn has_intermediate_updates(&self) -> bool {
        self.capabilities.event_mode && !self.has_clocks()
    }

    /// Whether a communication step may end early (FMI 3.0.2, section 4.1.3): at an event or intermediate update, or
    /// when the model requests the end.
    pub(crate) fn returns_early(&self) -> bool {
        self.has_intermediate_updates() || self.capabilities.termination
    }
}

impl ClockDeclaration {
    /// The clock as a variable. Its interval is not declared, because it depends on parameters.
    fn variable(&self) -> VariableDeclaration {
        let variable = serde_json::json!({
            "name": self.name, "description": self.description, "type": "Clock", "causality": "input",
            "interval_variability": "fixed", "supports_fraction": true, "priority": 0,
        });
        serde_json::from_value(variable).expect("it is a variable")
    }
}

/// A group of variables that tools connect in one operation (FMI 3.0.2, section 2.4.9).
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct TerminalDeclaration {
    pub(crate) name: String,
    pub(crate) description: Option<String>,
    /// Default: bus.
    #[serde(default)]
    pub(crate) matching_rule: MatchingRule,
    /// The members, connected by name; in FMI 3.0, whole arrays.
    pub(crate) variables: Vec<String>,
}

/// Times in seconds.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct DefaultExperiment {
    /// Start of the run.
    pub(crate) start_time: Option<f64>,
    /// End of the run.
    pub(crate) stop_time: Option<f64>,
    /// Communication step.
    pub(crate) step_size: Option<f64>,
    /// Relative tolerance, which holds where an importer gives none.
    pub(crate) tolerance: Option<f64>,
}

/// Optional functions of FMI 2.0 co-simulation (section 4.3.1).
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's flags")]
pub(crate) struct Capabilities {
    /// Communication steps may vary in length.
    pub(crate) variable_communication_step_size: bool,
    /// Inputs may have derivatives.
    pub(crate) interpolate_inputs: bool,
    /// The state can be saved and restored.
    pub(crate) get_and_set_state: bool,
    /// A saved state can be moved to another process. Default: whether it can be saved.
    pub(crate) serialize_state: Option<bool>,
    /// A `Stepper` implements `Stepper::differentiate`.
    pub(crate) directional_derivatives: bool,
    /// A `Stepper` implements `Stepper::differentiate_backwards`. FMI 3.0 only.
    pub(crate) adjoint_derivatives: bool,
    /// In FMI 3.0 co-simulation, importers may handle the model's events, and exchange values between internal steps.
    pub(crate) event_mode: bool,
    /// The model may end the simulation within a communication step (`Context::terminate`). FMI 3.0 announces this to
    /// importers.
    pub(crate) termination: bool,
}

impl Capabilities {
    pub(crate) fn serializes_state(&self) -> bool {
        self.serialize_state.unwrap_or(self.get_and_set_state)
    }
}

/// What the runtime does for every model.
impl Default for Capabilities {
    fn default() -> Self {
        Self {
            variable_communication_step_size: true,
            interpolate_inputs: true,
            get_and_set_state: true,
            serialize_state: None,
            directional_derivatives: false,
            adjoint_derivatives: false,
            event_mode: false,
            termination: false,
        }
    }
}

/// How an FMU warns.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub(crate) enum Warnings {
    /// By a message of the status fmi2Warning; the call returns fmi2OK.
    #[default]
    Message,
    /// By such a message, and by the status fmi2Warning of the call.
    Status,
}

/// A name and its meaning.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Described {
    pub(crate) name: String,
    pub(crate) description: String,
}

/// A type of Reals.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct RealType {
    /// As a variable's.
    pub(crate) name: String,
    pub(crate) description: Option<String>,
    /// The physical quantity, such as `Pressure`.
    pub(crate) quantity: Option<String>,
    /// Unit of the variables.
    pub(crate) unit: Option<String>,
    /// Unit in which tools show the values.
    pub(crate) display_unit: Option<String>,
    /// Values are differences: conversion to other units ignores offsets.
    #[serde(default)]
    pub(crate) relative_quantity: bool,
    /// Smallest value.
    pub(crate) min: Option<f64>,
    /// Largest value.
    pub(crate) max: Option<f64>,
    /// Typical magnitude, for solvers.
    pub(crate) nominal: Option<f64>,
    /// Values may become much larger than `nominal`, such as the angle of a shaft.
    #[serde(default)]
    pub(crate) unbounded: bool,
}

/// A type whose values are items.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct EnumerationDeclaration {
    /// Its name in FMI.
    pub(crate) name: String,
    /// Its name in Rust, in the form `TypeName`, if another one is wanted.
    pub(crate) rust_name: Option<String>,
    pub(crate) description: Option<String>,
    pub(crate) items: Vec<ItemDeclaration>,
}

impl EnumerationDeclaration {
    /// Its name in Rust.
    pub(crate) fn rust_name(&self) -> String {
        self.rust_name.clone().unwrap_or_else(|| rust_type_name(&self.name))
    }

    /// The items with their values. The check refuses one after the largest 32-bit integer.
    pub(crate) fn valued(&self) -> impl Iterator<Item = (&ItemDeclaration, i32)> {
        self.items.iter().scan(0_i32, |last, item| {
            *last = item.value.unwrap_or(last.saturating_add(1));
            Some((item, *last))
        })
    }
}

/// A value of an enumeration.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ItemDeclaration {
    pub(crate) name: String,
    /// Default: 1, or the one after that of the item before.
    pub(crate) value: Option<i32>,
    pub(crate) description: Option<String>,
}

/// Variables and components shared by several components.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentType {
    /// The name by which components refer to it.
    pub(crate) name: String,
    /// With what the names of its structs in Rust begin, in the form `TypeName`, if not with its own name.
    pub(crate) rust_name: Option<String>,
    #[serde(default)]
    pub(crate) variables: Vec<VariableDeclaration>,
    #[serde(default)]
    pub(crate) components: Vec<ComponentDeclaration>,
}

impl ComponentType {
    /// With what the names of its structs begin.
    pub(crate) fn rust_name(&self) -> String {
        self.rust_name.clone().unwrap_or_else(|| rust_type_name(&self.name))
    }
}

/// A part of the model, with variables and components of its own or those of a type.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentDeclaration {
    /// Its name in FMI, before those of its variables.
    pub(crate) name: String,
    /// Its name in Rust, in `lower_case`, if another one is wanted.
    pub(crate) rust_name: Option<String>,
    pub(crate) description: Option<String>,
    /// The size of an array of components: `[24]`.
    #[serde(default)]
    pub(crate) dimensions: Vec<usize>,
    /// Its variables, unless it has a type.
    pub(crate) variables: Option<Vec<VariableDeclaration>>,
    /// The components in it, unless it has a type. Variable x of component d in component c is called c.d.x.
    #[serde(default)]
    pub(crate) components: Vec<ComponentDeclaration>,
    /// One of the `component_types`.
    #[serde(rename = "type")]
    pub(crate) component_type: Option<String>,
    /// The `state_groups` entry to which its states belong, including those of the components in it.
    pub(crate) state_group: Option<String>,
    /// Start values for this component of its type's variables; d.x is variable x of the type's component d. In an array
    /// of components, a value for all, or a list of those of each.
    #[serde(default, deserialize_with = "without_duplicates")]
    #[cfg_attr(test, schemars(schema_with = "starts_schema"))]
    pub(crate) start: BTreeMap<String, Value>,
    /// The variables for the type's {placeholders} in this component. In an array of components, a variable for all, which
    /// may have the subscript `i` of the component, or a list of those of each.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(crate) connections: BTreeMap<String, OneOrEach>,
}

impl ComponentDeclaration {
    /// Its name in Rust.
    pub(crate) fn rust_name(&self) -> String {
        self.rust_name.clone().unwrap_or_else(|| rust_name(&self.name))
    }
}

/// What the model, a component or a type contains.
#[derive(Clone)]
pub(crate) struct Contents<'a> {
    /// The path of what contains it; empty for the model.
    pub(crate) key: String,
    pub(crate) variables: &'a [VariableDeclaration],
    pub(crate) components: &'a [ComponentDeclaration],
}

impl Contents<'_> {
    /// The path of one of the components.
    pub(crate) fn key_of(&self, component: usize) -> String {
        within(&self.key, &format!("components[{component}]"))
    }

    /// What a component without a type contains.
    pub(crate) fn of(&self, component: usize) -> Self {
        let ComponentDeclaration { variables, components, .. } = &self.components[component];
        let variables = variables.as_deref().unwrap_or_default();
        Self { key: self.key_of(component), variables, components }
    }

    /// These, and those of the components in them.
    fn all(self) -> Vec<Self> {
        let inner: Vec<_> =
            (0..self.components.len()).flat_map(|component| self.of(component).all()).collect();
        [self].into_iter().chain(inner).collect()
    }
}

/// The path of a list.
pub(crate) fn within(key: &str, list: &str) -> String {
    if key.is_empty() { list.to_owned() } else { format!("{key}.{list}") }
}

/// The variables of some contents and of the components in them, each list with its path.
fn lists<'a>(
    key: &str,
    variables: &'a mut [VariableDeclaration],
    components: &'a mut [ComponentDeclaration],
) -> Vec<(String, &'a mut [VariableDeclaration])> {
    let mut found = vec![(within(key, "variables"), variables)];
    for (number, component) in components.iter_mut().enumerate() {
        let key = within(key, &format!("components[{number}]"));
        let variables = component.variables.as_deref_mut().unwrap_or_default();
        found.extend(lists(&key, variables, &mut component.components));
    }
    found
}

/// A map with unique keys; serde's own keeps the last duplicate.
fn without_duplicates<'de, D, K, V>(deserializer: D) -> Result<BTreeMap<K, V>, D::Error>
where
    D: Deserializer<'de>,
    K: Deserialize<'de> + Ord + fmt::Debug,
    V: Deserialize<'de>,
{
    struct MapVisitor<K, V>(PhantomData<(K, V)>);

    impl<'de, K, V> Visitor<'de> for MapVisitor<K, V>
    where
        K: Deserialize<'de> + Ord + fmt::Debug,
        V: Deserialize<'de>,
    {
        type Value = BTreeMap<K, V>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("an object")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Self::Value, A::Error> {
            let mut map = BTreeMap::new();
            while let Some(key) = access.next_key::<K>()? {
                if map.contains_key(&key) {
                    return Err(A::Error::custom(format!("{key:?} is given twice")));
                }
                map.insert(key, access.next_value()?);
            }
            Ok(map)
        }
    }

    deserializer.deserialize_map(MapVisitor(PhantomData))
}

#[cfg(test)]
fn starts_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({"type": "object", "additionalProperties": start_schema(generator)})
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parser's types generate the schema. After an intended change, update it with `FMU_EXPORT_BLESS=1 cargo test
    /// -p fmu-export-build --lib`.
    #[test]
    fn the_schema_is_that_of_the_parser() {
        let schema = schemars::generate::SchemaSettings::draft2020_12().into_generator();
        let schema = schema.into_root_schema_for::<Declaration>();
        let text = serde_json::to_string_pretty(&schema).expect("a schema is JSON") + "\n";
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/schema/model.schema.json");
        if std::env::var_os("FMU_EXPORT_BLESS").is_some() {
            std::fs::write(file, &text).expect("the folder is writable");
        }
        let kept = std::fs::read_to_string(file).expect("the schema is in the crate");
        assert!(text == kept, "schema/model.schema.json is not that of the parser");
    }
}
