//! The files as they are written: a model's declaration, and the units beside it.
//!
//! The comments on the fields are what editors show: schema/model.schema.json is made of them.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use crate::error::Refusal;

/// The types that FMI 3.0 alone has.
pub(crate) const TYPES_OF_FMI3: [&str; 10] =
    ["Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Binary", CLOCK];

/// The type of clocks.
const CLOCK: &str = "Clock";

/// A model: what it is called and which variables it has.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Declaration {
    /// The JSON Schema of this file, for editors.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Name of the model, of the FMU and its library. Default: the package's name, with _ for -.
    pub(crate) model_identifier: Option<String>,
    /// What the model is. Default: the package's description.
    pub(crate) description: Option<String>,
    /// Default: the package's authors.
    pub(crate) author: Option<String>,
    /// Left out of the FMU by default.
    pub(crate) copyright: Option<String>,
    /// Default: the package's license.
    pub(crate) license: Option<String>,
    /// What an importer proposes for a run.
    pub(crate) default_experiment: Option<DefaultExperiment>,
    /// What the FMU can do. Default: everything but directional derivatives, which the model has to implement.
    #[serde(default)]
    pub(crate) capabilities: Capabilities,
    /// Further log categories, or other texts for logStatusError, logStatusWarning and logEvents, which every model has.
    #[serde(default)]
    pub(crate) log_categories: Vec<Described>,
    /// A file of units beside those of SI, relative to this file.
    pub(crate) units: Option<String>,
    /// A fragment of HTML for the page of documentation, relative to this file.
    pub(crate) documentation: Option<String>,
    /// The PNG that importers show the FMU with, relative to this file.
    pub(crate) icon: Option<String>,
    /// The folder of files that the model reads at run time, relative to this file; the FMU's folder resources.
    pub(crate) resources: Option<String>,
    /// Types whose values are names.
    #[serde(default)]
    pub(crate) enumerations: Vec<EnumerationDeclaration>,
    /// The variables of the model itself: its inputs and outputs, and what belongs to no component.
    #[serde(default)]
    pub(crate) variables: Vec<VariableDeclaration>,
    /// Variables that several components share.
    #[serde(default)]
    pub(crate) component_types: Vec<ComponentType>,
    /// The parts of the model. The variable x of the component c is called c.x.
    #[serde(default)]
    pub(crate) components: Vec<ComponentDeclaration>,
    /// Groups of components whose states are integrated together.
    #[serde(default)]
    pub(crate) state_groups: Vec<Described>,
    /// The names of the event indicators: the functions whose change of sign is an event.
    #[serde(default)]
    pub(crate) event_indicators: Vec<String>,
    /// Those event indicators that no event may leave positive: the distance beyond an end stop, say.
    #[serde(default)]
    pub(crate) limits: Vec<String>,
    /// Groups of variables that tools connect in one stroke with those of another FMU.
    #[serde(default)]
    pub(crate) terminals: Vec<TerminalDeclaration>,
    /// The clock of a sampled model in Scheduled Execution, at whose ticks a sample is computed.
    pub(crate) clock: Option<ClockDeclaration>,
    /// The same as a variable, by [`Declaration::complete`].
    #[serde(skip)]
    pub(crate) sample_clock: Option<VariableDeclaration>,
}

/// A clock whose interval is the period of a sampled model (FMI 3.0.2, section 2.2.8).
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
        // FMI 3.0.2, section 4.4: an FMU that has clocks has Event Mode.
        self.capabilities.event_mode |= self.has_clocks();
        self.sample_clock = self.clock.as_ref().map(ClockDeclaration::variable);
        self.find_sizes()
    }

    /// Finds the sizes of arrays, of which some are structural parameters.
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

    /// The names of the variables' types.
    fn types(&self) -> impl Iterator<Item = &str> {
        let of_components = self.components.iter().filter_map(|component| component.variables.as_ref());
        let of_types = self.component_types.iter().map(|component_type| &component_type.variables);
        let variables = [&self.variables].into_iter().chain(of_components).chain(of_types).flatten();
        variables.map(|variable| variable.data_type.as_str())
    }

    /// Whether a variable has a type that FMI 2.0 does not have.
    pub(crate) fn needs_fmi3(&self) -> bool {
        self.types().any(|name| TYPES_OF_FMI3.contains(&name))
    }

    /// Whether a variable is a clock.
    pub(crate) fn has_clocks(&self) -> bool {
        self.types().any(|name| name == CLOCK)
    }
}

impl ClockDeclaration {
    /// The clock as a variable. Its interval is not declared, as it follows from parameters.
    fn variable(&self) -> VariableDeclaration {
        let variable = serde_json::json!({
            "name": self.name, "description": self.description, "type": CLOCK, "causality": "input",
            "interval_variability": "fixed", "supports_fraction": true, "priority": 0,
        });
        serde_json::from_value(variable).expect("it is a variable")
    }
}

/// A group of variables that tools connect in one stroke (FMI 3.0.2, section 2.4.9).
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct TerminalDeclaration {
    pub(crate) name: String,
    pub(crate) description: Option<String>,
    /// Default: bus.
    #[serde(default)]
    pub(crate) matching_rule: MatchingRule,
    /// The variables, by whose names the members are connected; in FMI 3.0 arrays as a whole.
    pub(crate) variables: Vec<String>,
}

/// Which members of two connected terminals are connected.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum MatchingRule {
    /// All, which must have the same names on both sides.
    Plug,
    /// Those whose names are on both sides.
    #[default]
    Bus,
}

/// Times in seconds.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct DefaultExperiment {
    /// When the run starts.
    pub(crate) start_time: Option<f64>,
    /// When the run ends.
    pub(crate) stop_time: Option<f64>,
    /// The communication step.
    pub(crate) step_size: Option<f64>,
}

/// Optional functions of FMI 2.0 co-simulation (section 4.3.1).
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's flags")]
pub(crate) struct Capabilities {
    /// Communication steps may differ in length.
    pub(crate) variable_communication_step_size: bool,
    /// Inputs may come with their derivatives.
    pub(crate) interpolate_inputs: bool,
    /// The state can be saved and restored.
    pub(crate) get_and_set_state: bool,
    /// A saved state can be carried into another process. Default: whether it can be saved.
    pub(crate) serialize_state: Option<bool>,
    /// The model implements `Model::differentiate`.
    pub(crate) directional_derivatives: bool,
    /// The model implements `Model::differentiate_backwards`. In FMI 3.0 alone.
    pub(crate) adjoint_derivatives: bool,
    /// In Co-Simulation of FMI 3.0, importers may handle the model's events, and exchange values between internal steps.
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
    /// Written like this: `TypeName`.
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
    /// Letters, digits and underscores, up to 200. In Rust it is written like this: `lower_case`.
    pub(crate) name: String,
    /// What it is.
    pub(crate) description: Option<String>,
    /// Default: local.
    #[serde(default)]
    pub(crate) causality: Causality,
    /// When its value may change. Default: fixed for parameters, continuous for other Reals, otherwise discrete.
    pub(crate) variability: Option<Variability>,
    /// How its start value comes about. To be chosen for states: exact (the default), or approx where initialization
    /// computes it (the default with `initial_reads`); and for other discrete variables that are calculated (the
    /// default): exact where they begin at a start value, and events change them.
    pub(crate) initial: Option<Initial>,
    /// Real (the default), Integer, Boolean, String or the name of an enumeration; in FMI 3.0 also `Float32`, `Int8`,
    /// `UInt8`, `Int16`, `UInt16`, `UInt32`, `Int64`, `UInt64`, `Binary` and `Clock`.
    #[serde(rename = "type", default = "real")]
    pub(crate) data_type: String,
    /// The unit of a Real, such as kg/s, N.m, W/(m2.K) or %; 1 without dimension. For an array also a list.
    pub(crate) unit: Option<UnitNames>,
    /// Another unit, in which tools shall show the value.
    pub(crate) display_unit: Option<String>,
    /// The smallest value.
    pub(crate) min: Option<f64>,
    /// The largest value.
    pub(crate) max: Option<f64>,
    /// A typical magnitude, for solvers.
    pub(crate) nominal: Option<f64>,
    /// The value of a parameter, input, state or exact variable to begin with, and that of a constant; for an array a
    /// list, row by row.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "start_schema"))]
    pub(crate) start: Option<Value>,
    /// The sizes of an array, up to 16; in FMI 3.0 also the names of structural parameters. A model has up to 100000
    /// variables, with the elements of arrays and the derivatives.
    #[serde(default)]
    pub(crate) dimensions: Vec<Dimension>,
    /// The same as numbers, by [`Declaration::find_sizes`].
    #[serde(skip)]
    pub(crate) sizes: Vec<usize>,
    /// Makes the variable a continuous-time state.
    #[serde(default, deserialize_with = "true_or_object")]
    #[cfg_attr(test, schemars(schema_with = "derivative_schema"))]
    pub(crate) derivative: Option<DerivativeDeclaration>,
    /// Of a state: whether events may set it, by which it jumps.
    #[serde(default)]
    pub(crate) reinit: bool,
    /// Of a state: whether the equations have no meaning below `min`, as of a pressure below 0. An evaluation there is
    /// discarded, so that a solver tries a shorter step.
    #[serde(default)]
    pub(crate) strict_min: bool,
    /// The same above `max`.
    #[serde(default)]
    pub(crate) strict_max: bool,
    /// The variables that its equation reads directly. Left out: it depends on everything.
    pub(crate) reads: Option<Vec<String>>,
    /// The same for initialization, where that differs.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// The number by which importers know it, up to 2147483647; of an array, the number of the first element. Default: the
    /// next free one.
    pub(crate) value_reference: Option<u32>,
    /// The clocks at whose ticks alone the variable changes.
    #[serde(default)]
    pub(crate) clocks: Vec<String>,
    /// Of a variable of clocks: the variable that has its value of the previous tick, which makes it a clocked state.
    pub(crate) previous: Option<String>,
    /// Of a clock that is an input: when it ticks. Other clocks are triggered.
    pub(crate) interval_variability: Option<IntervalVariability>,
    /// Of a periodic clock: the time between two ticks, in s. Left out of a fixed or tunable one where it follows from
    /// parameters.
    pub(crate) interval_decimal: Option<f64>,
    /// Of a periodic clock whose interval is declared: the time of the first tick after the start, in s.
    pub(crate) shift_decimal: Option<f64>,
    /// The interval as a multiple of 1/`resolution` s.
    pub(crate) interval_counter: Option<u64>,
    /// The shift as a multiple of 1/`resolution` s.
    pub(crate) shift_counter: Option<u64>,
    /// The denominator of `interval_counter` and `shift_counter`.
    pub(crate) resolution: Option<u64>,
    /// Of a clock with an interval: whether importers may exchange it as a fraction. Implied by `interval_counter`.
    #[serde(default)]
    pub(crate) supports_fraction: bool,
    /// Of a clock that is an input: whether importers may take back a tick during an event.
    #[serde(default)]
    pub(crate) can_be_deactivated: bool,
    /// Of a clock that is an input: which one comes first where several tick at one time, from 0; needed in Scheduled
    /// Execution.
    pub(crate) priority: Option<u32>,
}

/// When a clock ticks (FMI 3.0.2, section 2.2.8).
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum IntervalVariability {
    /// Periodically, as declared.
    Constant,
    /// Periodically, by what the importer sets or what follows from fixed parameters.
    Fixed,
    /// The same with tunable parameters.
    Tunable,
    /// After a time that the model finds at each tick for the next one.
    Changing,
    /// After a time that the model finds when it likes.
    Countdown,
    /// When something triggers it.
    Triggered,
}

impl IntervalVariability {
    /// Whether ticks are at equal distances.
    pub(crate) fn is_periodic(self) -> bool {
        matches!(self, Self::Constant | Self::Fixed | Self::Tunable)
    }

    /// The text in the standard.
    pub(crate) fn as_str(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Fixed => "fixed",
            Self::Tunable => "tunable",
            Self::Changing => "changing",
            Self::Countdown => "countdown",
            Self::Triggered => "triggered",
        }
    }
}

impl VariableDeclaration {
    /// A multiple of 1/`resolution` s.
    #[expect(clippy::cast_precision_loss, reason = "it is a time in s, rounded")]
    pub(crate) fn seconds(&self, counter: Option<u64>) -> Option<f64> {
        Some(counter? as f64 / self.resolution? as f64)
    }

    /// The interval and the shift of a periodic clock in s, where they are declared.
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

/// A size of an array.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected a size, or the name of a structural parameter")]
pub(crate) enum Dimension {
    Size(usize),
    Parameter(String),
}

/// The unit of a variable, or of each element of an array.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected a unit, or a list of units")]
pub(crate) enum UnitNames {
    All(String),
    Each(Vec<String>),
}

impl UnitNames {
    /// The unit of the element with this number, counted from 0.
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
    /// The variables that its equation reads directly. Left out: it depends on everything.
    pub(crate) reads: Option<Vec<String>>,
    /// The same for initialization, where that differs.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// Default: the number after the state's.
    pub(crate) value_reference: Option<u32>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Causality {
    Parameter,
    /// The size of arrays, which the build fixes at its start value. In FMI 3.0 alone.
    StructuralParameter,
    CalculatedParameter,
    Input,
    Output,
    #[default]
    Local,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Variability {
    Constant,
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Initial {
    Exact,
    Approx,
    Calculated,
}

/// Variables that several components have in common.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentType {
    /// Written like this: `TypeName`.
    pub(crate) name: String,
    pub(crate) variables: Vec<VariableDeclaration>,
}

/// A part of the model: with variables of its own, or those of a type.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentDeclaration {
    /// Written like this: `lower_case`.
    pub(crate) name: String,
    pub(crate) description: Option<String>,
    /// Its variables, unless it has a type.
    pub(crate) variables: Option<Vec<VariableDeclaration>>,
    /// One of the `component_types`.
    #[serde(rename = "type")]
    pub(crate) component_type: Option<String>,
    /// The one of the `state_groups` that its states belong to.
    pub(crate) state_group: Option<String>,
    /// Start values of the type's variables that hold for this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    #[cfg_attr(test, schemars(schema_with = "starts_schema"))]
    pub(crate) start: BTreeMap<String, Value>,
    /// The variables that the type's {placeholders} stand for in this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(crate) connections: BTreeMap<String, String>,
}

/// A unit of the file of units (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct UnitDeclaration {
    pub(crate) name: String,
    /// The exponents of the SI base units; left out of a unit that is built in, and of one without.
    #[serde(default, deserialize_with = "some_without_duplicates")]
    pub(crate) base: Option<BTreeMap<BaseUnit, i32>>,
    /// From this unit to the base unit.
    #[serde(default = "one")]
    pub(crate) factor: f64,
    #[serde(default)]
    pub(crate) offset: f64,
    #[serde(default)]
    pub(crate) display_units: Vec<DisplayUnitDeclaration>,
}

/// A unit for display: the name of a known unit, or a new one.
#[derive(Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields, expecting = "expected the name of a unit, or an object with a name")]
pub(crate) enum DisplayUnitDeclaration {
    Known(String),
    New {
        name: String,
        /// From the unit to the display unit.
        #[serde(default = "one")]
        factor: f64,
        #[serde(default)]
        offset: f64,
    },
}

impl DisplayUnitDeclaration {
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Known(name) | Self::New { name, .. } => name,
        }
    }
}

/// The base units, in the order of the schema's attributes.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum BaseUnit {
    #[serde(rename = "kg")]
    Kilogram,
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "s")]
    Second,
    A,
    K,
    #[serde(rename = "mol")]
    Mole,
    #[serde(rename = "cd")]
    Candela,
    #[serde(rename = "rad")]
    Radian,
}

impl BaseUnit {
    pub(crate) const ALL: [Self; 8] = [
        Self::Kilogram,
        Self::Metre,
        Self::Second,
        Self::A,
        Self::K,
        Self::Mole,
        Self::Candela,
        Self::Radian,
    ];

    /// The attribute that holds the exponent.
    pub(crate) fn symbol(self) -> &'static str {
        match self {
            Self::Kilogram => "kg",
            Self::Metre => "m",
            Self::Second => "s",
            Self::A => "A",
            Self::K => "K",
            Self::Mole => "mol",
            Self::Candela => "cd",
            Self::Radian => "rad",
        }
    }
}

fn one() -> f64 {
    1.0
}

/// `true` for a derivative of which there is nothing to say.
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

/// A map in which each key stands once; serde's own takes the last of several.
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

/// The same for a map that may be absent.
fn some_without_duplicates<'de, D, K, V>(deserializer: D) -> Result<Option<BTreeMap<K, V>>, D::Error>
where
    D: Deserializer<'de>,
    K: Deserialize<'de> + Ord + fmt::Debug,
    V: Deserialize<'de>,
{
    without_duplicates(deserializer).map(Some)
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

    /// The schema is made of the types that the parser is made of. After a wanted change it is written anew with
    /// `FMU_EXPORT_BLESS=1 cargo test -p fmu-export-build --lib`.
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
