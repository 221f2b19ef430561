//! A declared variable.

use std::fmt;

use fmu_terms::{Causality, Initial, IntervalVariability, Variability};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

use super::RealType;
use crate::names::rust_name;

/// A variable, or an array of them.
#[allow(clippy::struct_excessive_bools, reason = "each is a key of its own")]
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct VariableDeclaration {
    /// Its name in FMI, up to 200 bytes. In Rust it is in `lower_case`, what Rust does not allow becomes `_`, and reserved
    /// words get a `_`.
    pub(crate) name: String,
    /// Its name in Rust, in `lower_case`, if another one is wanted.
    pub(crate) rust_name: Option<String>,
    /// What it is.
    pub(crate) description: Option<String>,
    /// Further names, by which importers can read it.
    #[serde(default)]
    pub(crate) aliases: Vec<AliasDeclaration>,
    /// Default: local.
    #[serde(default)]
    pub(crate) causality: Causality,
    /// When its value may change. Default: fixed for parameters, continuous for other Reals, otherwise discrete.
    pub(crate) variability: Option<Variability>,
    /// How its start value is determined. For states: exact (the default), or approx if initialization computes it
    /// (the default with `initial_reads`); for other discrete variables: calculated (the default), or exact if they
    /// begin at a start value that events change.
    pub(crate) initial: Option<Initial>,
    /// Real (the default), Integer, Boolean, String or the name of an enumeration or a type of Reals; in FMI 3.0 also `Float32`, `Int8`,
    /// `UInt8`, `Int16`, `UInt16`, `UInt32`, `Int64`, `UInt64`, `Binary` and `Clock`.
    #[serde(rename = "type", default = "real")]
    pub(crate) data_type: String,
    /// The position of its type among the `real_types`, from [`VariableDeclaration::take_from_type`].
    #[serde(skip)]
    pub(crate) real_type: Option<usize>,
    /// Unit of a Real, such as kg/s, N.m, W/(m2.K) or %; 1 if dimensionless. An array may have a list of units.
    pub(crate) unit: Option<OneOrEach>,
    /// Unit in which tools show the value.
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
    /// Initial value of a parameter, input, state, constant or exact variable; for an array one for all elements, or a
    /// list, row by row.
    #[serde(default)]
    #[cfg_attr(test, schemars(schema_with = "start_schema"))]
    pub(crate) start: Option<Value>,
    /// Array sizes, up to 16; in FMI 3.0 optionally names of structural parameters. A model has up to 100000
    /// variables, counting array elements and derivatives.
    #[serde(default)]
    pub(crate) dimensions: Vec<Dimension>,
    /// The array sizes as numbers; the structural parameters of the declaration are filled in.
    #[serde(skip)]
    pub(crate) sizes: Vec<usize>,
    /// For a map or a curve: the parameters over which it is given, one for each dimension, by their names in the same
    /// component or full names. Calibration tools show it over them.
    #[serde(default)]
    pub(crate) axes: Vec<String>,
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
    /// For a state: the equations are invalid above `max`. Evaluations there are discarded, so that a solver tries a
    /// shorter step.
    #[serde(default)]
    pub(crate) strict_max: bool,
    /// Variables that its equation reads directly, and `time` if it does. An array may also name elements, by its own
    /// subscripts i, j, …; `:` is a whole dimension: `T[i-1]`, `A[i,:]`. Default: everything.
    pub(crate) reads: Option<Vec<String>>,
    /// Variables that its equation in initialization reads directly, written like `reads`. Default: `reads`.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// The number by which importers access it, up to 2147483647; for an array, that of the first element. Default: the
    /// next free number.
    #[cfg_attr(test, schemars(with = "Option<u32>"))]
    pub(crate) value_reference: Option<i64>,
    /// The variable changes only at ticks of these clocks.
    #[serde(default)]
    pub(crate) clocks: Vec<String>,
    /// For a variable with clocks: the variable that holds its value at the previous tick; makes it a clocked state.
    pub(crate) previous: Option<String>,
    /// For an input clock: when it ticks. Other clocks are triggered.
    pub(crate) interval_variability: Option<IntervalVariability>,
    /// For a periodic clock: the time between two ticks, in s. Omit it for a fixed or tunable clock if the model
    /// computes it from parameters.
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

/// A further name of a variable.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct AliasDeclaration {
    /// As a variable's.
    pub(crate) name: String,
    /// What it is. Default: the variable's.
    pub(crate) description: Option<String>,
}

impl VariableDeclaration {
    /// Makes a variable of one of the types of Reals a Real with what the type says (FMI 2.0.5, section 2.2.7).
    pub(super) fn take_from_type(&mut self, types: &[RealType]) {
        self.real_type = types.iter().position(|known| known.name == self.data_type);
        let Some(known) = self.real_type.map(|position| &types[position]) else { return };
        self.data_type = real();
        self.unit = self.unit.take().or_else(|| known.unit.clone().map(OneOrEach::All));
        self.display_unit = self.display_unit.take().or_else(|| known.display_unit.clone());
        self.relative_quantity |= known.relative_quantity;
        self.min = self.min.or(known.min);
        self.max = self.max.or(known.max);
        self.nominal = self.nominal.or(known.nominal);
    }

    /// Its name in Rust.
    pub(crate) fn rust_name(&self) -> String {
        self.rust_name.clone().unwrap_or_else(|| rust_name(&self.name))
    }

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

/// A name for all elements of an array, or one for each.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected a text, or a list of texts")]
pub(crate) enum OneOrEach {
    All(String),
    Each(Vec<String>),
}

impl OneOrEach {
    /// That of an element, numbered from 0.
    pub(crate) fn of(&self, element: usize) -> &str {
        match self {
            Self::All(name) => name,
            Self::Each(names) => &names[element],
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
    /// Variables that its equation reads directly, and `time` if it does; elements of an array as in a variable's
    /// `reads`. Default: everything.
    pub(crate) reads: Option<Vec<String>>,
    /// Variables that its equation in initialization reads directly. Default: `reads`.
    pub(crate) initial_reads: Option<Vec<String>>,
    /// Default: the number after the state's.
    #[cfg_attr(test, schemars(with = "Option<u32>"))]
    pub(crate) value_reference: Option<i64>,
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

#[cfg(test)]
pub(super) fn start_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({"type": ["number", "boolean", "string", "array", "null"]})
}

#[cfg(test)]
fn derivative_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let object = generator.subschema_for::<DerivativeDeclaration>();
    schemars::json_schema!({"anyOf": [{"type": "boolean"}, object]})
}
