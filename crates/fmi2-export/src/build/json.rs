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
pub(super) struct Model {
    pub(super) model_identifier: String,
    pub(super) description: String,
    pub(super) author: String,
    pub(super) copyright: String,
    pub(super) license: String,
    pub(super) default_experiment: DefaultExperiment,
    #[serde(default)]
    pub(super) capabilities: Capabilities,
    pub(super) log_categories: Vec<Described>,
    /// The file of units, relative to the model's.
    pub(super) units: String,
    /// The part of the documentation that is written by hand, likewise.
    pub(super) documentation: Option<String>,
    /// The picture that importers show the FMU with, likewise.
    pub(super) icon: Option<String>,
    #[serde(default)]
    pub(super) enumerations: Vec<Enumeration>,
    #[serde(default)]
    pub(super) variables: Vec<Variable>,
    #[serde(default)]
    pub(super) component_types: Vec<ComponentType>,
    #[serde(default)]
    pub(super) components: Vec<Component>,
    /// Groups of components whose states a model treats as one.
    #[serde(default)]
    pub(super) state_groups: Vec<Described>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_field_names)]
pub(super) struct DefaultExperiment {
    pub(super) start_time: f64,
    pub(super) stop_time: f64,
    pub(super) step_size: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(clippy::struct_excessive_bools, reason = "they are the standard's flags")]
pub(super) struct Capabilities {
    pub(super) variable_communication_step_size: bool,
    pub(super) interpolate_inputs: bool,
    pub(super) get_and_set_state: bool,
    pub(super) serialize_state: bool,
    pub(super) directional_derivatives: bool,
}

/// A name and what it means.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Described {
    pub(super) name: String,
    pub(super) description: String,
}

/// An enumeration; its items have the values 1, 2, ….
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Enumeration {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) items: Vec<Described>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) causality: Causality,
    pub(super) variability: Option<Variability>,
    pub(super) initial: Option<Initial>,
    #[serde(rename = "type", default = "real")]
    pub(super) data_type: String,
    pub(super) unit: Option<Units>,
    pub(super) display_unit: Option<String>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) nominal: Option<f64>,
    pub(super) start: Option<Value>,
    #[serde(default)]
    pub(super) dimensions: Vec<usize>,
    pub(super) derivative: Option<Derivative>,
    pub(super) reads: Option<Vec<String>>,
    pub(super) initial_reads: Option<Vec<String>>,
}

/// The unit of a variable, or of each element of an array.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Units {
    All(String),
    Each(Vec<String>),
}

impl Units {
    /// The unit of the element with this number, counted from 0.
    pub(super) fn of(&self, element: usize) -> &str {
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
pub(super) struct Derivative {
    pub(super) description: Option<String>,
    /// When it is not the state's unit followed by `/s`.
    pub(super) unit: Option<String>,
    pub(super) reads: Vec<String>,
    pub(super) initial_reads: Option<Vec<String>>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) enum Causality {
    Parameter,
    CalculatedParameter,
    Input,
    Output,
    Local,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) enum Variability {
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) enum Initial {
    Exact,
    Approx,
    Calculated,
}

/// Variables that several components have in common.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ComponentType {
    pub(super) name: String,
    pub(super) variables: Vec<Variable>,
}

/// A part of the model: with variables of its own, or those of a type.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Component {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) variables: Option<Vec<Variable>>,
    #[serde(rename = "type")]
    pub(super) component_type: Option<String>,
    /// The group that its states belong to.
    pub(super) state_group: Option<String>,
    /// Start values of the type's variables that hold for this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(super) start: BTreeMap<String, Value>,
    /// The variables that the type's `{placeholders}` stand for in this component.
    #[serde(default, deserialize_with = "without_duplicates")]
    pub(super) connections: BTreeMap<String, String>,
}

/// A unit (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Unit {
    pub(super) name: String,
    /// The exponents of the SI base units; absent where they are not integers.
    #[serde(default, deserialize_with = "some_without_duplicates")]
    pub(super) base: Option<BTreeMap<BaseUnit, i32>>,
    /// From this unit to the base unit.
    #[serde(default = "one")]
    pub(super) factor: f64,
    #[serde(default)]
    pub(super) offset: f64,
    #[serde(default)]
    pub(super) display_units: Vec<DisplayUnit>,
}

/// The base units, in the order of the schema's attributes.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BaseUnit {
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
    pub(super) fn symbol(self) -> &'static str {
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
pub(super) struct DisplayUnit {
    pub(super) name: String,
    /// From the unit to the display unit.
    #[serde(default = "one")]
    pub(super) factor: f64,
    #[serde(default)]
    pub(super) offset: f64,
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
pub(super) fn read<T: DeserializeOwned>(file: &Path) -> Result<T, Error> {
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
