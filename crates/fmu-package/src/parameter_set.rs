//! Parameter sets: the .ssv files of System Structure and Parameterization (SSP, section 6), read in versions 1.0 and
//! 2.0, written in 1.0.

use std::collections::BTreeSet;
use std::fmt::{self, Display, Formatter};
use std::io;
use std::path::Path;

use fmu_io::reading::broken;
use fmu_io::terminal::number;
use fmu_terms::Unit;
use fmu_xml::{XmlWriter, document, element, empty, float};

use crate::units;
use crate::variable::element_name;
use crate::xml::{self, Element, check_version, children, named, number as attribute, text, wrong};

/// The namespace of parameter sets.
pub(crate) const NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";
/// The namespace of elements common to SSP's files.
pub(crate) const COMMON_NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";

/// The elements beside a parameter's value.
const BESIDE: &[&str] = &["Annotations", "Dimension", "MetaData", "Signature"];

/// Named values of parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterSet {
    /// The set's name.
    pub name: String,
    /// The purpose of the set.
    pub description: String,
    /// The parameters, in file order.
    pub parameters: Vec<Parameter>,
    /// The units used by the parameters.
    pub units: Vec<Unit>,
}

/// A parameter's value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The variable's name.
    pub name: String,
    /// The reason for the value.
    pub description: String,
    /// The value with its type, and a unit if the file gives one.
    pub value: Value,
}

/// A value with its type.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number, and its unit if given.
    Real(f64, Option<String>),
    /// An integer.
    Integer(i32),
    /// A Boolean.
    Boolean(bool),
    /// A String.
    String(String),
    /// An enumeration item's name.
    Enumeration(String),
}

/// Converts what a value is made of.
macro_rules! value_from {
    ($($type:ty: $value:ident => $made:expr),*) => {
        $(impl From<$type> for Value {
            fn from($value: $type) -> Self {
                $made
            }
        })*
    };
}

value_from! {
    f64: number => Self::Real(number, None),
    i32: number => Self::Integer(number),
    bool: value => Self::Boolean(value),
    &str: text => Self::String(text.to_owned())
}

impl ParameterSet {
    /// Reads an .ssv file.
    ///
    /// # Errors
    /// When the file does not exist, or is not a parameter set; the message names the file.
    pub fn read(file: &Path) -> io::Result<Self> {
        let shown = file.display();
        let refuse = |reason: &str| broken(format!("{shown} is not a parameter set: {reason}"));
        let set = Self::parse(&xml::read_xml(file)?).map_err(|error| refuse(&error.to_string()))?;
        if let Some(name) = set.repeated().next() {
            return Err(refuse(&format!("the parameter {name} occurs twice")));
        }
        Ok(set)
    }

    /// The names that occur again, which the standard forbids.
    pub fn repeated(&self) -> impl Iterator<Item = &str> {
        let mut names = BTreeSet::new();
        self.parameters
            .iter()
            .map(|parameter| parameter.name.as_str())
            .filter(move |name| !names.insert(*name))
    }

    /// Reads the text of an .ssv file, in which names may occur again.
    ///
    /// # Errors
    /// When it is not XML, or not a parameter set of SSP; the message names element or parameter.
    pub fn parse(xml: &str) -> io::Result<Self> {
        Self::of(xml::read(&xml::with_prefixes(xml), "ParameterSet")?.root_element())
    }

    /// The set of an element.
    pub(crate) fn of(root: Element<'_>) -> io::Result<Self> {
        check_version(root, "parameter sets")?;
        let mut parameters = vec![];
        for parameter in named(root, "Parameters").flat_map(|list| named(list, "Parameter")) {
            let name = text(parameter, "name");
            let refuse = |what: &str| wrong(parameter, &format!("the parameter {name} {what}"));
            let mut values = children(parameter).filter(|child| !BESIDE.contains(&child.tag_name().name()));
            let value = values.next().ok_or_else(|| refuse("has no value"))?;
            if values.next().is_some() {
                return Err(refuse("has a second value"));
            }
            let sizes = named(parameter, "Dimension").map(|dimension| attribute(dimension, "size"));
            let sizes: Vec<usize> = sizes
                .map(|size| size?.ok_or_else(|| refuse("has a dimension without a size")))
                .collect::<io::Result<_>>()?;
            let values = Value::read(value, !sizes.is_empty())
                .map_err(|error| wrong(parameter, &format!("the parameter {name}: {error}")))?;
            let count = sizes.iter().try_fold(1_usize, |product, size| product.checked_mul(*size));
            if count != Some(values.len()) {
                return Err(refuse("has not as many values as elements"));
            }
            let description = text(parameter, "description");
            parameters.extend(values.into_iter().enumerate().map(|(position, value)| Parameter {
                name: element_name(&name, position, &sizes),
                description: description.clone(),
                value,
            }));
        }
        Ok(Self {
            name: text(root, "name"),
            description: text(root, "description"),
            parameters,
            units: units::read(named(root, "Units").flat_map(|list| named(list, "Unit")))?,
        })
    }

    /// The text of the .ssv file.
    #[must_use]
    pub fn to_xml(&self) -> String {
        document(|writer| self.write(writer))
    }

    fn write(&self, writer: &mut XmlWriter) -> io::Result<()> {
        let mut attributes = vec![
            ("xmlns:ssv", NAMESPACE.to_owned()),
            ("xmlns:ssc", COMMON_NAMESPACE.to_owned()),
            ("version", "1.0".to_owned()),
            ("name", self.name.clone()),
        ];
        attributes.extend(described(&self.description));
        element(writer, "ssv:ParameterSet", attributes, |writer| {
            element(writer, "ssv:Parameters", vec![], |writer| {
                self.parameters.iter().try_for_each(|parameter| self.write_parameter(writer, parameter))
            })?;
            let referred = |unit: &&Unit| {
                self.parameters.iter().any(
                    |parameter| matches!(&parameter.value, Value::Real(_, Some(name)) if *name == unit.name),
                )
            };
            let units: Vec<_> = self.units.iter().filter(referred).cloned().collect();
            units::write(writer, "ssv:Units", &units)
        })
    }

    fn write_parameter(&self, writer: &mut XmlWriter, parameter: &Parameter) -> io::Result<()> {
        let mut attributes = vec![("name", parameter.name.clone())];
        attributes.extend(described(&parameter.description));
        element(writer, "ssv:Parameter", attributes, |writer| {
            let (name, mut attributes) = match &parameter.value {
                Value::Real(value, _) => ("ssv:Real", vec![("value", float(*value))]),
                Value::Integer(value) => ("ssv:Integer", vec![("value", value.to_string())]),
                Value::Boolean(value) => ("ssv:Boolean", vec![("value", value.to_string())]),
                Value::String(value) => ("ssv:String", vec![("value", value.clone())]),
                Value::Enumeration(item) => ("ssv:Enumeration", vec![("value", item.clone())]),
            };
            if let Value::Real(_, Some(unit)) = &parameter.value
                && self.units.iter().any(|known| known.name == *unit && known.base.is_some())
            {
                attributes.push(("unit", unit.clone()));
            }
            empty(writer, name, attributes)
        })
    }
}

impl Value {
    /// The values of an element: one, or those of an array.
    fn read(element: Element<'_>, is_array: bool) -> io::Result<Vec<Self>> {
        let listed: Vec<_> = named(element, "Value").map(|value| value.text().unwrap_or_default()).collect();
        let texts = match element.attribute("value") {
            Some(list) if is_array && element.tag_name().name() != "String" => {
                list.split_whitespace().collect()
            }
            Some(value) => vec![value],
            None if listed.is_empty() => return Err(broken("it has no value")),
            None => listed,
        };
        texts.into_iter().map(|text| Self::read_text(element, text)).collect()
    }

    fn read_text(element: Element<'_>, text: &str) -> io::Result<Self> {
        let no = |what: &str| broken(format!("'{text}' is not a {what}"));
        Ok(match element.tag_name().name() {
            "Real" | "Float64" | "Float32" => {
                let value = text.trim().parse().map_err(|_| no("number"))?;
                Self::Real(value, element.attribute("unit").map(str::to_owned))
            }
            "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" => {
                Self::Integer(text.trim().parse().map_err(|_| no("32-bit integer"))?)
            }
            "Boolean" => Self::Boolean(xml::boolean(text).ok_or_else(|| no("Boolean"))?),
            "String" => Self::String(text.to_owned()),
            "Enumeration" => Self::Enumeration(text.to_owned()),
            other => return Err(broken(format!("values of the type {other} are not supported"))),
        })
    }
}

/// The value with its unit, for messages; a number reads back as the same double.
impl Display for Value {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real(value, Some(unit)) => write!(formatter, "{} {unit}", number(*value)),
            Self::Real(value, None) => write!(formatter, "{}", number(*value)),
            Self::Integer(value) => write!(formatter, "{value}"),
            Self::Boolean(value) => write!(formatter, "{value}"),
            Self::String(text) | Self::Enumeration(text) => write!(formatter, "{text}"),
        }
    }
}

fn described(description: &str) -> Option<(&'static str, String)> {
    (!description.is_empty()).then(|| ("description", description.to_owned()))
}
