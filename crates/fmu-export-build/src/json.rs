//! The files as they are written: the schema of a model's JSON and of the units beside it.
//!
//! Unknown fields are refused everywhere, so that a misspelt one is found where it stands instead of
//! silently having no effect.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::marker::PhantomData;
use std::path::Path;

use serde::de::{DeserializeOwned, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use super::error::Error;

/// A model as its JSON declares it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Model {
    pub(crate) model_identifier: String,
    pub(crate) description: String,
    pub(crate) author: String,
    pub(crate) copyright: String,
    pub(crate) license: String,
    pub(crate) default_experiment: DefaultExperiment,
    #[serde(default)]
    pub(crate) capabilities: Capabilities,
    pub(crate) log_categories: Vec<Described>,
    /// The file of units, relative to the model's.
    pub(crate) units: String,
    /// The part of the documentation that is written by hand, likewise.
    pub(crate) documentation: Option<String>,
    /// The picture that importers show the FMU with, likewise.
    pub(crate) icon: Option<String>,
    #[serde(default)]
    pub(crate) enumerations: Vec<Enumeration>,
    #[serde(default)]
    pub(crate) variables: Vec<Variable>,
    #[serde(default)]
    pub(crate) component_types: Vec<ComponentType>,
    #[serde(default)]
    pub(crate) components: Vec<Component>,
    /// Groups of components whose states a model treats as one.
    #[serde(default)]
    pub(crate) state_groups: Vec<Described>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_field_names)]
pub(crate) struct DefaultExperiment {
    pub(crate) start_time: f64,
    pub(crate) stop_time: f64,
    pub(crate) step_size: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's flags")]
pub(crate) struct Capabilities {
    pub(crate) variable_communication_step_size: bool,
    pub(crate) interpolate_inputs: bool,
    pub(crate) get_and_set_state: bool,
    pub(crate) serialize_state: bool,
    pub(crate) directional_derivatives: bool,
}

/// A name and what it means.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Described {
    pub(crate) name: String,
    pub(crate) description: String,
}

/// An enumeration; its items have the values 1, 2, ….
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Enumeration {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) items: Vec<Described>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Variable {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) causality: Causality,
    pub(crate) variability: Option<Variability>,
    pub(crate) initial: Option<Initial>,
    #[serde(rename = "type", default = "real")]
    pub(crate) data_type: String,
    pub(crate) unit: Option<Units>,
    pub(crate) display_unit: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
    pub(crate) start: Option<Value>,
    #[serde(default)]
    pub(crate) dimensions: Vec<usize>,
    pub(crate) derivative: Option<Derivative>,
    pub(crate) reads: Option<Vec<String>>,
    pub(crate) initial_reads: Option<Vec<String>>,
}

/// The unit of a variable, or of each element of an array.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Units {
    All(String),
    Each(Vec<String>),
}

impl Units {
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

/// What makes a variable a continuous-time state.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Derivative {
    pub(crate) description: Option<String>,
    /// When it is not the state's unit followed by `/s`.
    pub(crate) unit: Option<String>,
    pub(crate) reads: Vec<String>,
    pub(crate) initial_reads: Option<Vec<String>>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Causality {
    Parameter,
    CalculatedParameter,
    Input,
    Output,
    Local,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Variability {
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Initial {
    Exact,
    Approx,
    Calculated,
}

/// Variables that several components have in common.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ComponentType {
    pub(crate) name: String,
    pub(crate) variables: Vec<Variable>,
}

/// A part of the model: with variables of its own, or those of a type.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Component {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) variables: Option<Vec<Variable>>,
    #[serde(rename = "type")]
    pub(crate) component_type: Option<String>,
    /// The group that its states belong to.
    pub(crate) state_group: Option<String>,
    /// Start values of the type's variables that hold for this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(crate) start: BTreeMap<String, Value>,
    /// The variables that the type's `{placeholders}` stand for in this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(crate) connections: BTreeMap<String, String>,
}

/// A unit (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Unit {
    pub(crate) name: String,
    /// The exponents of the SI base units; absent where they are not integers.
    #[serde(default, deserialize_with = "some_without_duplicates")]
    pub(crate) base: Option<BTreeMap<BaseUnit, i32>>,
    /// From this unit to the base unit.
    #[serde(default = "one")]
    pub(crate) factor: f64,
    #[serde(default)]
    pub(crate) offset: f64,
    #[serde(default)]
    pub(crate) display_units: Vec<DisplayUnit>,
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DisplayUnit {
    pub(crate) name: String,
    /// From the unit to the display unit.
    #[serde(default = "one")]
    pub(crate) factor: f64,
    #[serde(default)]
    pub(crate) offset: f64,
}

fn one() -> f64 {
    1.0
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

/// Reads a file of the schema `T`.
pub(crate) fn read<T: DeserializeOwned>(file: &Path) -> Result<T, Error> {
    let text = fs::read_to_string(file).map_err(|error| Error::new(file, error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| {
        let name = enclosing_name(&text, error.line(), error.column());
        let within = name.map(|name| format!(" (in '{name}')")).unwrap_or_default();
        Error::new(file, format!("{error}{within}"))
    })
}

/// The `"name"` of the innermost named object around a place: serde says where an error is, but not in
/// which variable.
fn enclosing_name(text: &str, line: usize, column: usize) -> Option<&str> {
    let line_start: usize = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum();
    let place = (line_start + column.saturating_sub(1)).min(text.len());
    let mut open = Vec::new();
    let mut characters = text.char_indices();
    while let Some((position, character)) = characters.next() {
        match character {
            _ if position >= place => break,
            '"' => skip_string(&mut characters),
            '{' => open.push(position),
            '}' => drop(open.pop()),
            _ => {}
        }
    }
    open.into_iter().rev().find_map(|start| name_of_object(&text[start..]))
}

/// The value of an object's own key `name`.
fn name_of_object(text: &str) -> Option<&str> {
    let mut depth = 0_usize;
    let mut characters = text.char_indices();
    while let Some((position, character)) = characters.next() {
        match character {
            '"' => {
                skip_string(&mut characters);
                let rest = text[position..].strip_prefix("\"name\"").map(str::trim_start);
                if depth == 1
                    && let Some(value) = rest.and_then(|rest| rest.strip_prefix(':'))
                {
                    return value.trim_start().strip_prefix('"')?.split('"').next();
                }
            }
            '{' | '[' => depth += 1,
            '}' | ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return None;
        }
    }
    None
}

/// Moves behind the closing quote of a string whose opening one was read.
fn skip_string(characters: &mut impl Iterator<Item = (usize, char)>) {
    while let Some((_, character)) = characters.next() {
        match character {
            '"' => return,
            '\\' => drop(characters.next()),
            _ => {}
        }
    }
}
