//! An FMU's variables, of any FMI version.

use std::collections::HashMap;
use std::io;

use fmu_io::reading::broken;

use crate::xml::{self, children, named, number, text};

/// A variable as declared; undeclared fields are empty, or have the default of the FMI version.
#[derive(Clone, Debug, Default)]
pub struct FmuVariable {
    /// Unique in the FMU.
    pub name: String,
    /// The value reference.
    pub value_reference: String,
    /// `Real`, `Integer`, `Boolean`, `String`, `Enumeration`, or a type of FMI 3.0.
    pub data_type: String,
    /// The enumeration or another declared type.
    pub declared_type: String,
    /// `causality`.
    pub causality: String,
    /// `variability`.
    pub variability: String,
    /// `initial`.
    pub initial: String,
    /// The unit, or that of its type.
    pub unit: String,
    /// The unit in which to show values, or that of its type.
    pub display_unit: String,
    /// The start value.
    pub start: String,
    /// The smallest value.
    pub min: String,
    /// The largest value.
    pub max: String,
    /// Empty if the FMU gives none.
    pub description: String,
    /// The variable of which it is the derivative: its position from 1 on, in FMI 3.0 its value reference.
    pub derivative: String,
    /// `intervalVariability` of a Clock (FMI 3.0).
    pub interval_variability: String,
    /// The sizes of an array (FMI 3.0).
    pub dimensions: Vec<Dimension>,
    /// Other names of the variable, each with its description (FMI 3.0).
    pub aliases: Vec<(String, String)>,
    /// Its place in an array, from `FmuDescription::scalars`.
    pub element: Option<Element>,
}

/// An array size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// A number.
    Fixed(usize),
    /// The start value of the structural parameter or constant with this value reference.
    Variable(String),
}

/// An array element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element {
    /// Its position among the array's values, with the last index varying fastest (FMI 3.0.2, section 2.2.7).
    pub position: usize,
    /// The number of the array's values.
    pub size: usize,
}

/// The type of a variable's values, in any FMI version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// `Real`, `Float64`, `Float32`.
    Real,
    /// `Integer`, and FMI 3.0's types of 8 to 64 bits.
    Integer,
    /// `Boolean`.
    Boolean,
    /// `String`.
    String,
    /// `Enumeration`.
    Enumeration,
    /// `Binary`, `Clock`.
    Other,
}

impl FmuVariable {
    /// Reads a variable; `types` are the declared ones.
    pub(crate) fn read<'d>(
        element: xml::Element<'d>,
        types: &HashMap<&str, xml::Element<'d>>,
    ) -> io::Result<Self> {
        // FMI 3.0: the element itself is the type.
        let typed = match element.tag_name().name() {
            "ScalarVariable" => children(element).next().unwrap_or(element),
            _ => element,
        };
        let declared = typed.attribute("declaredType").and_then(|name| types.get(name));
        let inherited =
            |name| typed.attribute(name).or_else(|| declared?.attribute(name)).unwrap_or_default();
        // FMI 3.0: texts are elements, one per array element.
        let texts: Vec<_> = named(typed, "Start").map(|start| text(start, "value")).collect();
        let dimensions = named(element, "Dimension").map(|dimension| {
            Ok(match dimension.attribute("valueReference") {
                Some(reference) => Dimension::Variable(reference.to_owned()),
                None => Dimension::Fixed(number(dimension, "start")?.unwrap_or(1)),
            })
        });
        Ok(Self {
            name: text(element, "name"),
            value_reference: text(element, "valueReference"),
            data_type: typed.tag_name().name().to_owned(),
            declared_type: text(typed, "declaredType"),
            causality: text(element, "causality"),
            variability: text(element, "variability"),
            initial: text(element, "initial"),
            derivative: text(typed, "derivative"),
            interval_variability: text(typed, "intervalVariability"),
            unit: inherited("unit").to_owned(),
            display_unit: inherited("displayUnit").to_owned(),
            start: typed.attribute("start").map_or_else(|| texts.join("\n"), str::to_owned),
            min: inherited("min").to_owned(),
            max: inherited("max").to_owned(),
            description: text(element, "description"),
            dimensions: dimensions.collect::<io::Result<_>>()?,
            aliases: named(element, "Alias")
                .map(|alias| (text(alias, "name"), text(alias, "description")))
                .collect(),
            element: None,
        })
    }

    /// Whether its value changes at events only.
    #[must_use]
    pub fn is_discrete(&self) -> bool {
        self.variability == "discrete" || self.value_type() != ValueType::Real
    }

    /// The type of its values.
    #[must_use]
    pub fn value_type(&self) -> ValueType {
        match self.data_type.as_str() {
            "Real" | "Float64" | "Float32" => ValueType::Real,
            "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" => {
                ValueType::Integer
            }
            "Boolean" => ValueType::Boolean,
            "String" => ValueType::String,
            "Enumeration" => ValueType::Enumeration,
            _ => ValueType::Other,
        }
    }

    /// An element of this array with the given sizes.
    pub(crate) fn element(&self, sizes: &[usize], element: Element) -> Self {
        let mut rest = element.position;
        let mut indices: Vec<_> = sizes
            .iter()
            .rev()
            .map(|size| {
                let index = rest % size + 1;
                rest /= size;
                index.to_string()
            })
            .collect();
        indices.reverse();
        // One start value for all, or one each.
        let starts: Vec<_> = match self.value_type() {
            ValueType::String => self.start.split('\n').collect(),
            _ => self.start.split_whitespace().collect(),
        };
        let start = if starts.len() == 1 { starts.first() } else { starts.get(element.position) };
        Self {
            name: format!("{}[{}]", self.name, indices.join(",")),
            start: start.copied().unwrap_or_default().to_owned(),
            dimensions: vec![],
            element: Some(element),
            ..self.clone()
        }
    }

    /// Smallest and largest value as numbers; infinite if undeclared.
    ///
    /// # Errors
    /// When one is not a number; the message names variable and text.
    pub fn range(&self) -> io::Result<(f64, f64)> {
        let bound = |text: &str, none: f64| match text {
            "" => Ok(none),
            text => text
                .trim()
                .parse()
                .map_err(|_| broken(format!("a bound of {} is '{text}', which is not a number", self.name))),
        };
        Ok((bound(&self.min, f64::NEG_INFINITY)?, bound(&self.max, f64::INFINITY)?))
    }

    /// Whether an importer may set it before initialization (FMI 2.0.5, section 2.2.7).
    #[must_use]
    pub fn is_settable(&self) -> bool {
        let is_set_by_default = matches!(self.causality.as_str(), "input" | "parameter");
        self.variability != "constant"
            && self.causality != "independent"
            && (is_set_by_default || matches!(self.initial.as_str(), "exact" | "approx"))
    }
}
