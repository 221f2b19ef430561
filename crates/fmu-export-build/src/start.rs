//! Start values, as declared.

use std::fmt;

use fmu_terms::DataType;
use fmu_xml::float;
use serde_json::Value;

use crate::declaration::{Declaration, VariableDeclaration};
use crate::error::nearest;
use crate::texts::lost_in_xml;
use crate::value_type::ValueType;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Start {
    Real(f64),
    Integer(i128),
    Boolean(bool),
    String(String),
    Binary(Vec<u8>),
    /// An item of the enumeration.
    Item {
        /// The item's position, from 0.
        position: usize,
        value: i32,
    },
}

impl Start {
    /// The start values of a variable's scalars, row by row, in one list or a list of rows; a single value is for all
    /// elements.
    pub(crate) fn all(
        declaration: &Declaration,
        variable: &VariableDeclaration,
        data_type: ValueType,
        start: &Value,
    ) -> Result<Vec<Self>, String> {
        if !variable.sizes.is_empty() && !start.is_array() {
            let elements = variable.sizes.iter().product();
            return Self::read(declaration, variable, data_type, start).map(|start| vec![start; elements]);
        }
        let is_flat = start.as_array().is_some_and(|list| !list.iter().any(Value::is_array));
        let elements = [variable.sizes.iter().product()];
        let sizes = if is_flat { &elements } else { &variable.sizes[..] };
        let mut values = vec![start];
        for &size in sizes {
            let rows = values.into_iter().map(|value| match value {
                Value::Array(row) if row.len() == size => Ok(row),
                Value::Array(row) => {
                    Err(format!("has {} elements, but the dimensions require {size}", row.len()))
                }
                _ => Err(format!("{value} is not an array of {size} elements, as the dimensions require")),
            });
            values = rows.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        }
        values.into_iter().map(|value| Self::read(declaration, variable, data_type, value)).collect()
    }

    fn read(
        declaration: &Declaration,
        variable: &VariableDeclaration,
        data_type: ValueType,
        value: &Value,
    ) -> Result<Self, String> {
        let mismatch = || format!("{value} is not of type {}", variable.data_type);
        let number = || {
            let number = value.as_f64().ok_or_else(mismatch)?;
            match (variable.min, variable.max) {
                (Some(min), _) if number < min => Err(format!("{value} is less than min {min}")),
                (_, Some(max)) if number > max => Err(format!("{value} is greater than max {max}")),
                _ => Ok(number),
            }
        };
        if let Some((_, range)) = data_type.integer() {
            let integer = value.as_i64().map(i128::from).or_else(|| value.as_u64().map(i128::from));
            let integer = integer.filter(|integer| range.contains(integer)).ok_or_else(mismatch)?;
            return number().map(|_| Self::Integer(integer));
        }
        let text = || value.as_str().ok_or_else(mismatch);
        match data_type {
            ValueType::Standard(DataType::Float32)
                if value.as_f64().is_some_and(|value| value.abs() > f32::MAX.into()) =>
            {
                Err(mismatch())
            }
            ValueType::Standard(DataType::Boolean) => value.as_bool().map(Self::Boolean).ok_or_else(mismatch),
            ValueType::Standard(DataType::Clock) => Err("a Clock has no 'start' value".to_owned()),
            ValueType::Standard(DataType::String) => match lost_in_xml(text()?) {
                None => Ok(Self::String(text()?.to_owned())),
                Some(lost) => Err(format!("contains {lost}, which XML does not preserve")),
            },
            ValueType::Standard(DataType::Binary) => bytes(text()?)
                .map(Self::Binary)
                .ok_or_else(|| format!("{value} does not consist of two hexadecimal digits per byte")),
            ValueType::Enumeration(enumeration) => {
                let name = text()?;
                let enumeration = &declaration.enumerations[enumeration];
                let found = enumeration.valued().enumerate().find(|(_, (item, _))| item.name == name);
                found.map(|(position, (_, value))| Self::Item { position, value }).ok_or_else(|| {
                    let items = || enumeration.items.iter().map(|item| item.name.as_str());
                    let known = items().collect::<Vec<_>>().join(", ");
                    let nearest = nearest(name, items());
                    format!("'{name}' is not one of {}'s items {known}{nearest}", variable.data_type)
                })
            }
            ValueType::Standard(_) => number().map(Self::Real),
        }
    }
}

/// The start value as in XML.
impl fmt::Display for Start {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real(value) => formatter.write_str(&float(*value)),
            Self::Integer(value) => write!(formatter, "{value}"),
            Self::Boolean(value) => write!(formatter, "{value}"),
            Self::String(value) => formatter.write_str(value),
            Self::Binary(bytes) => bytes.iter().try_for_each(|byte| write!(formatter, "{byte:02x}")),
            Self::Item { value, .. } => write!(formatter, "{value}"),
        }
    }
}

/// Bytes from two hexadecimal digits each.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<_>> = text.chars().map(|digit| digit.to_digit(16)).collect();
    let digits = digits.filter(|digits| digits.len().is_multiple_of(2))?;
    digits.chunks(2).map(|pair| u8::try_from(16 * pair[0] + pair[1]).ok()).collect()
}
