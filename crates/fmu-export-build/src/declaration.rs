//! A model's declaration, as written.
//!
//! Editors show the fields' comments: schema/model.schema.json is generated from them.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use crate::data_type::DataType;
use crate::error::Refusal;

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
    /// What the FMU can do. Default: everything but derivatives and Event Mode, which not every model implements.
    #[serde(default)]
    pub(crate) capabilities: Capabilities,
    /// Additional log categories, or new descriptions of the built-in logStatusError, logStatusWarning and logEvents.
    #[serde(default)]
    pub(crate) log_categories: Vec<Described>,
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
    /// The model's own variables: its inputs and outputs, and others that belong to no component.
    #[serde(default)]
    pub(crate) variables: Vec<VariableDeclaration>,
    /// Variables shared by several components.
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
    /// Groups of variables that tools connect at once with those of another FMU.
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
        self.find_sizes()
    }

    /// Finds the sizes of arrays, some of which are structural parameters.
    fn find_sizes(&mut self) -> Result<(), Refusal> {
        let is_structural =
            |variable: &&VariableDeclaration| variable.causality == Causality::StructuralParameter;
        let structural = self.variables.iter().filter(is_structural);
        let size = |start: &Option<Value>| usize::try_from(start.as_ref()?.as_u64()?).ok();
        let sizes: BTreeMap<_, _> =
            structural.map(|variable| (variable.name.clone(), size(&variable.start))).collect();
        let of_components = self.components.iter_mut().enumerate().filter_map(|(number, component)| {
            Some((format!("components[{number}].variables"), component.variables.as_mut()?))
        });
        let of_types = self.component_types.iter_mut().enumerate().map(|(number, component_type)| {
            (format!("component_types[{number}].variables"), &mut component_type.variables)
        });
        let own = ("variables".to_owned(), &mut self.variables);
        for (list, variables) in [own].into_iter().chain(of_components).chain(of_types) {
            for (number, variable) in variables.iter_mut().enumerate() {
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

    /// The variables' built-in types.
    fn types(&self) -> impl Iterator<Item = DataType> {
        let of_components = self.components.iter().filter_map(|component| component.variables.as_ref());
        let of_types = self.component_types.iter().map(|component_type| &component_type.variables);
        let variables = [&self.variables].into_iter().chain(of_components).chain(of_types).flatten();
        variables.filter_map(|variable| DataType::of_name(&variable.data_type))
    }

    /// Whether a variable's type does not exist in FMI 2.0.
    pub(crate) fn needs_fmi3(&self) -> bool {
        self.types().any(|data_type| !data_type.is_of_fmi2())
    }

    /// Whether a variable is a clock.
    pub(crate) fn has_clocks(&self) -> bool {
        self.types().any(|data_type| data_type == DataType::Clock)
    }
}

impl ClockDeclaration {
    /// The clock as a variable. Its interval is not declared, as it follows from parameters.
    fn variable(&self) -> VariableDeclaration {
        let variable = serde_json::json!({
            "name": self.name, "description": self.description, "type": "Clock", "causality": "input",
            "interval_variability": "fixed", "supports_fraction": true, "priority": 0,
        });
        serde_json::from_value(variable).expect("it is a variable")
    }
}

/// A group of variables that tools connect at once (FMI 3.0.2, section 2.4.9).
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

/// Which members of two connected terminals are connected.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum MatchingRule {
    /// All; both sides must have the same names.
    Plug,
    /// Those whose names exist on both sides.
    #[default]
    Bus,
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
    /// The model implements `Model::differentiate`.
    pub(crate) directional_derivatives: bool,
    /// The model implements `Model::differentiate_backwards`. FMI 3.0 only.
    pub(crate) adjoint_derivatives: bool,
    /// In FMI 3.0 co-simulation, importers may handle the model's events, and exchange values between internal steps.
    pub(crate) event_mode: bool,
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
        }
    }
}

/// A name and its meaning.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Described {
    pub(crate) name: String,
    pub(crate) description: String,
}

/// A type whose values are the items 1, 2, ….
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct EnumerationDeclaration {
    /// In the form `TypeName`.
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) items: Vec<Described>,
}

/// A variable, or an array of them.
#[allow(clippy::struct_excessive_bools, reason = "each is a key of its own")]
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct VariableDeclaration {
    /// Letters, digits and underscores, up to 200. `lower_case` in Rust.
    pub(crate) name: String,
    /// What it is.
    pub(crate) description: Option<String>,
    /// Default: local.
    #[serde(default)]
    pub(crate) causality: Causality,
    /// When its value may change. Default: fixed for parameters, continuous for other Reals, otherwise discrete.
    pub(crate) variability: Option<Variability>,
    /// How its start value is determined. For states: exact (the default), or approx if initialization computes it
    /// (the default with `initial_reads`); for other discrete variables: calculated (the default), or exact if they
    /// begin at a start value that events change.
    pub(crate) initial: Option<Initial>,
    /// Real (the default), Integer, Boolean, String or an enumeration's name; in FMI 3.0 also `Float32`, `Int8`,
    /// `UInt8`, `Int16`, `UInt16`, `UInt32`, `Int64`, `UInt64`, `Binary` and `Clock`.
    #[serde(rename = "type", default = "real")]
    pub(crate) data_type: String,
    /// Unit of a Real, such as kg/s, N.m, W/(m2.K) or %; 1 if dimensionless. For an array optionally a list.
    pub(crate) unit: Option<UnitNames>,
    /// Unit in which tools show the value.
    pub(crate) display_unit: Option<String>,
    /// Smallest value.
    pub(crate) min: Option<f64>,
    /// Largest value.
    pub(crate) max: Option<f64>,
    /// Typical magnitude, for solvers.
    pub(crate) nominal: Option<f64>,
    /// Initial value of a parameter, input, state, constant or exact variable; for an array a list, row by row.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "start_schema"))]
    pub(crate) start: Option<Value>,
    /// Array sizes, up to 16; in FMI 3.0 optionally names of structural parameters. A model has up to 100000
    /// variables, counting array elements and derivatives.
    #[serde(default)]
    pub(crate) dimensions: Vec<Dimension>,
    /// The same as numbers, from [`Declaration::find_sizes`].
    #[serde(skip)]
    pub(crate) sizes: Vec<usize>,
    /// Makes the variable a continuous-time state.
    #[serde(default, deserialize_with = "true_or_object")]
    #[cfg_attr(test, schemars(schema_with = "derivative_schema"))]
    pub(crate) derivative: Option<DerivativeDeclaration>,
    /// For a state: events may set it, so that it jumps.
    #[serde(default)]
    pub(crate) reinit: bool,
    /// For a state: the equations are invalid below `min`, as for a pressure below 0. Evaluations there are discarded,
    /// so that a solver tries a shorter step.
    #[serde(default)]
    pub(crate) strict_min: bool,
    /// Likewise above `max`.
    #[serde(default)]
    pub(crate) strict_max: bool,
    /// Variables that its equation reads directly. Default: everything.
    pub(crate) reads: Option<Vec<String>>,
    /// Likewise for initialization, if different.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// Importers' number for it, up to 2147483647; for an array, the first element's. Default: the next free number.
    pub(crate) value_reference: Option<u32>,
    /// The clocks at whose ticks the variable changes, and only then.
    #[serde(default)]
    pub(crate) clocks: Vec<String>,
    /// For a variable with clocks: the variable holding its value at the previous tick, which makes it a clocked
    /// state.
    pub(crate) previous: Option<String>,
    /// For an input clock: when it ticks. Other clocks are triggered.
    pub(crate) interval_variability: Option<IntervalVariability>,
    /// For a periodic clock: the time between two ticks, in s. Omit it for a fixed or tunable one if it follows from
    /// parameters.
    pub(crate) interval_decimal: Option<f64>,
    /// For a periodic clock with a declared interval: the time from start to first tick, in s.
    pub(crate) shift_decimal: Option<f64>,
    /// Interval as a multiple of 1/`resolution` s.
    pub(crate) interval_counter: Option<u64>,
    /// Shift as a multiple of 1/`resolution` s.
    pub(crate) shift_counter: Option<u64>,
    /// Denominator of `interval_counter` and `shift_counter`.
    pub(crate) resolution: Option<u64>,
    /// For a clock with an interval: importers may exchange it as a fraction. Implied by `interval_counter`.
    #[serde(default)]
    pub(crate) supports_fraction: bool,
    /// For an input clock: importers may revoke a tick during an event.
    #[serde(default)]
    pub(crate) can_be_deactivated: bool,
    /// For an input clock: order of simultaneous ticks, from 0; required in Scheduled Execution.
    pub(crate) priority: Option<u32>,
}

/// When a clock ticks (FMI 3.0.2, section 2.2.8).
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum IntervalVariability {
    /// Periodically, as declared.
    Constant,
    /// Periodically, as set by the importer or following from fixed parameters.
    Fixed,
    /// Likewise with tunable parameters.
    Tunable,
    /// After a time that the model determines at each tick for the next one.
    Changing,
    /// After a time that the model determines at any time.
    Countdown,
    /// When something triggers it.
    Triggered,
}

impl IntervalVariability {
    /// Whether ticks are equidistant.
    pub(crate) fn is_periodic(self) -> bool {
        matches!(self, Self::Constant | Self::Fixed | Self::Tunable)
    }
}

impl VariableDeclaration {
    /// A multiple of 1/`resolution` s.
    #[expect(clippy::cast_precision_loss, reason = "it is a time in s, rounded")]
    pub(crate) fn seconds(&self, counter: Option<u64>) -> Option<f64> {
        Some(counter? as f64 / self.resolution? as f64)
    }

    /// The interval and shift of a periodic clock in s, if declared.
    pub(crate) fn timing(&self) -> Option<[f64; 2]> {
        let interval = self.interval_decimal.or(self.seconds(self.interval_counter))?;
        let shift = self.shift_decimal.or(self.seconds(self.shift_counter));
        Some([interval, shift.unwrap_or(0.0)])
    }

    /// When a clock ticks.
    pub(crate) fn ticks(&self) -> IntervalVariability {
        self.interval_variability.unwrap_or(IntervalVariability::Triggered)
    }

    /// Whether importers may exchange a clock's interval as a fraction.
    pub(crate) fn has_fractions(&self) -> bool {
        self.supports_fraction || self.interval_counter.is_some()
    }
}

/// An array size.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected a size, or the name of a structural parameter")]
pub(crate) enum Dimension {
    Size(usize),
    Parameter(String),
}

/// The unit of a variable, or of each array element.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected a unit, or a list of units")]
pub(crate) enum UnitNames {
    All(String),
    Each(Vec<String>),
}

impl UnitNames {
    /// The unit of an element, numbered from 0.
    pub(crate) fn of(&self, element: usize) -> &str {
        match self {
            Self::All(unit) => unit,
            Self::Each(units) => &units[element],
        }
    }
}

fn real() -> String {
    "Real".to_owned()
}

/// The time derivative of a state.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct DerivativeDeclaration {
    /// Default: Time derivative of the state.
    pub(crate) description: Option<String>,
    /// Default: the state's unit divided by s.
    pub(crate) unit: Option<String>,
    /// Variables that its equation reads directly. Default: everything.
    pub(crate) reads: Option<Vec<String>>,
    /// Likewise for initialization, if different.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// Default: the number after the state's.
    pub(crate) value_reference: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Causality {
    Parameter,
    /// An array size, which the build fixes at its start value. FMI 3.0 only.
    StructuralParameter,
    CalculatedParameter,
    Input,
    Output,
    #[default]
    Local,
    /// Of time only.
    #[serde(skip_deserializing)]
    Independent,
}

/// A word of the standard, the same in a declaration and in XML.
pub(crate) fn word(value: impl Serialize) -> impl fmt::Display {
    struct Word<T>(T);

    impl<T: Serialize> fmt::Display for Word<T> {
        fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            self.0.serialize(formatter)
        }
    }

    Word(value)
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Variability {
    Constant,
    Fixed,
    Tunable,
    Discrete,
    #[default]
    Continuous,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Initial {
    Exact,
    Approx,
    Calculated,
}

/// Variables shared by several components.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentType {
    /// In the form `TypeName`.
    pub(crate) name: String,
    pub(crate) variables: Vec<VariableDeclaration>,
}

/// A part of the model, with its own variables or those of a type.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentDeclaration {
    /// In the form `lower_case`.
    pub(crate) name: String,
    pub(crate) description: Option<String>,
    /// Its variables, unless it has a type.
    pub(crate) variables: Option<Vec<VariableDeclaration>>,
    /// One of the `component_types`.
    #[serde(rename = "type")]
    pub(crate) component_type: Option<String>,
    /// The `state_groups` entry to which its states belong.
    pub(crate) state_group: Option<String>,
    /// Start values for this component of its type's variables.
    #[serde(default, deserialize_with = "without_duplicates")]
    #[cfg_attr(test, schemars(schema_with = "starts_schema"))]
    pub(crate) start: BTreeMap<String, Value>,
    /// The variables for the type's {placeholders} in this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(crate) connections: BTreeMap<String, String>,
}

/// `true` for a derivative that needs no details.
fn true_or_object<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<DerivativeDeclaration>, D::Error> {
    struct TrueOrObject;

    impl<'de> Visitor<'de> for TrueOrObject {
        type Value = Option<DerivativeDeclaration>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("true or an object")
        }

        fn visit_bool<E>(self, is_state: bool) -> Result<Self::Value, E> {
            Ok(is_state.then(DerivativeDeclaration::default))
        }

        fn visit_map<A: MapAccess<'de>>(self, access: A) -> Result<Self::Value, A::Error> {
            DerivativeDeclaration::deserialize(MapAccessDeserializer::new(access)).map(Some)
        }
    }

    deserializer.deserialize_any(TrueOrObject)
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
fn start_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({"type": ["number", "boolean", "string", "array", "null"]})
}

#[cfg(test)]
fn starts_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({"type": "object", "additionalProperties": start_schema(generator)})
}

#[cfg(test)]
fn derivative_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let object = generator.subschema_for::<DerivativeDeclaration>();
    schemars::json_schema!({"anyOf": [{"type": "boolean"}, object]})
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
