//! An FMU's variables, of any FMI version.

use std::collections::HashMap;
use std::io;

use fmu_io::reading::broken;
use fmu_terms::{Causality, DataType, Initial, IntervalVariability, Variability, Version, Word};

use crate::declared::Declared;
use crate::xml::{self, boolean, children, named, number, text};

/// A variable as declared. What is not declared has the default of the FMI version, or is empty where there is none.
#[derive(Clone, Debug, Default)]
pub struct FmuVariable {
    /// The variable's name, unique in the FMU.
    pub name: String,
    /// The variable's value reference.
    pub value_reference: Declared<u32>,
    /// The variable's type, from the element named after it.
    pub data_type: Declared<DataType>,
    /// The enumeration or another declared type.
    pub declared_type: String,
    /// `causality`.
    pub causality: Declared<Causality>,
    /// `variability`.
    pub variability: Declared<Variability>,
    /// `initial`.
    pub initial: Declared<Initial>,
    /// The variable's unit, or its type's.
    pub unit: String,
    /// The unit in which to show the variable's values, or its type's.
    pub display_unit: String,
    /// Whether the variable's values, or its type's, are differences: their conversion between units ignores offsets.
    pub relative_quantity: bool,
    /// The start value.
    pub start: String,
    /// The smallest value.
    pub min: String,
    /// The largest value.
    pub max: String,
    /// The usual magnitude of the values.
    pub nominal: String,
    /// Empty if the FMU gives none.
    pub description: String,
    /// The variable of which this one is the derivative: its position from 1 on, in FMI 3.0 its value reference.
    pub derivative: Declared<u32>,
    /// `intervalVariability` of a Clock (FMI 3.0).
    pub interval_variability: Declared<IntervalVariability>,
    /// The sizes of an array (FMI 3.0).
    pub dimensions: Vec<Dimension>,
    /// Other names of the variable, each with its description (FMI 3.0).
    pub aliases: Vec<(String, String)>,
    /// The variable's place in an array, from `FmuDescription::scalars`.
    pub element: Option<Element>,
}

/// An array size.
#[derive(Clone, Debug)]
pub enum Dimension {
    /// A number.
    Fixed(usize),
    /// The start value of the structural parameter or constant with this value reference.
    Variable(Declared<u32>),
}

/// An array element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element {
    /// The element's position among the array's values, with the last index varying fastest (FMI 3.0.2, section 2.2.7).
    pub position: usize,
    /// The number of the array's values.
    pub size: usize,
}

/// The type of a variable's values, in any FMI version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
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

/// The declared types by name: each the element with `min`, `unit` and so on.
pub(crate) type Types<'d> = HashMap<&'d str, xml::Element<'d>>;

/// The elements that declare a variable.
#[derive(Clone, Copy, Debug)]
pub struct VariableElement<'d> {
    /// The element with the name.
    pub element: xml::Element<'d>,
    /// The element with `start`, `min` and so on: in FMI 3.0 the one with the name.
    pub typed: xml::Element<'d>,
    /// The variable's declared type.
    declared: Option<xml::Element<'d>>,
    version: Version,
}

impl<'d> VariableElement<'d> {
    pub(crate) fn new(element: xml::Element<'d>, types: &Types<'d>) -> Self {
        let (version, typed) = match element.tag_name().name() {
            "ScalarVariable" => (Version::Two, children(element).next().unwrap_or(element)),
            _ => (Version::Three, element),
        };
        let declared = typed.attribute("declaredType").and_then(|name| types.get(name).copied());
        Self { element, typed, declared, version }
    }

    /// The type of the variable's values.
    #[must_use]
    pub fn data_type(&self) -> Declared<DataType> {
        Declared::read(Some(self.kind()), |name| DataType::of(name, self.version))
    }

    /// `Real`, `Float64` and so on.
    #[must_use]
    pub fn kind(&self) -> &'d str {
        self.typed.tag_name().name()
    }

    /// `causality`, or its default.
    #[must_use]
    pub fn causality(&self) -> Declared<Causality> {
        self.word("causality").unwrap_or(Causality::Local.into())
    }

    /// `variability`, or its default.
    #[must_use]
    pub fn variability(&self) -> Declared<Variability> {
        let is_float = self.data_type().meaning().is_some_and(DataType::is_float);
        let default = Variability::by_default(self.version, self.causality().meaning(), is_float);
        self.word("variability").unwrap_or(default.into())
    }

    /// `initial`, or its default; empty where the variable has none.
    #[must_use]
    pub fn initial(&self) -> Declared<Initial> {
        let default = || {
            let (causality, variability) = (self.causality().meaning()?, self.variability().meaning()?);
            Initial::allowed(self.version, causality, variability)?.first().copied().map(Declared::from)
        };
        self.word("initial").or_else(default).unwrap_or_default()
    }

    /// The word that an attribute of the variable is, if there is one.
    fn word<W: Word>(&self, name: &str) -> Option<Declared<W>> {
        self.element.attribute(name).map(|text| Declared::word(Some(text)))
    }

    /// An attribute of the variable, or of its declared type.
    #[must_use]
    pub fn inherited(&self, name: &str) -> Option<&'d str> {
        self.typed.attribute(name).or_else(|| self.declared?.attribute(name))
    }
}

impl FmuVariable {
    /// Reads a variable.
    pub(crate) fn read(declaration: VariableElement<'_>) -> io::Result<Self> {
        let VariableElement { element, typed, .. } = declaration;
        let inherited = |name| declaration.inherited(name).unwrap_or_default().to_owned();
        // FMI 3.0: texts are elements, one per array element.
        let texts: Vec<_> = named(typed, "Start").map(|start| text(start, "value")).collect();
        let dimensions = named(element, "Dimension").map(|dimension| {
            Ok(match dimension.attribute("valueReference") {
                Some(reference) => Dimension::Variable(Declared::number(Some(reference))),
                None => Dimension::Fixed(number(dimension, "start")?.unwrap_or(1)),
            })
        });
        Ok(Self {
            name: text(element, "name"),
            value_reference: Declared::number(element.attribute("valueReference")),
            data_type: declaration.data_type(),
            declared_type: text(typed, "declaredType"),
            causality: declaration.causality(),
            variability: declaration.variability(),
            initial: declaration.initial(),
            derivative: Declared::number(typed.attribute("derivative")),
            interval_variability: Declared::word(typed.attribute("intervalVariability")),
            unit: inherited("unit"),
            display_unit: inherited("displayUnit"),
            relative_quantity: declaration.inherited("relativeQuantity").and_then(boolean) == Some(true),
            start: typed.attribute("start").map_or_else(|| texts.join("\n"), str::to_owned),
            min: inherited("min"),
            max: inherited("max"),
            nominal: inherited("nominal"),
            description: text(element, "description"),
            dimensions: dimensions.collect::<io::Result<_>>()?,
            aliases: named(element, "Alias")
                .map(|alias| (text(alias, "name"), text(alias, "description")))
                .collect(),
            element: None,
        })
    }

    /// Whether the variable's value changes at events only.
    #[must_use]
    pub fn is_discrete(&self) -> bool {
        matches!(self.variability.meaning(), Some(Variability::Discrete | Variability::Tunable))
            || self.value_type() != ValueType::Real
    }

    /// The type of the variable's values.
    #[must_use]
    pub fn value_type(&self) -> ValueType {
        match self.data_type.meaning() {
            Some(data_type) if data_type.is_float() => ValueType::Real,
            Some(data_type) if data_type.is_integer() => ValueType::Integer,
            Some(DataType::Boolean) => ValueType::Boolean,
            Some(DataType::String) => ValueType::String,
            Some(DataType::Enumeration) => ValueType::Enumeration,
            _ => ValueType::Other,
        }
    }

    /// The name of the array of which it is an element: in FMI 2.0 by its name, which ends with indices (FMI 2.0.5, section
    /// 2.2.9).
    #[must_use]
    pub fn array(&self) -> Option<&str> {
        self.place_in_array().map(|(array, _)| array)
    }

    /// The name of the variable's array, and the variable's indices in it.
    pub(crate) fn place_in_array(&self) -> Option<(&str, Vec<u64>)> {
        let (array, indices) = self.name.strip_suffix(']')?.rsplit_once('[')?;
        let indices: Result<_, _> = indices.split(',').map(|index| index.trim().parse()).collect();
        Some((array, indices.ok()?))
    }

    /// The elements of this array with the given sizes, whose product is `size`.
    pub(crate) fn elements(self, sizes: &[usize], size: usize) -> Vec<Self> {
        // One start value for all, or one each.
        let starts: Vec<_> = match self.value_type() {
            ValueType::String => self.start.split('\n').collect(),
            _ => self.start.split_whitespace().collect(),
        };
        let start = |position: usize| {
            let start = if starts.len() == 1 { starts.first() } else { starts.get(position) };
            start.copied().unwrap_or_default().to_owned()
        };
        let array = Self { start: String::new(), dimensions: vec![], ..self.clone() };
        let element = |position: usize| Self {
            name: element_name(&self.name, position, sizes),
            start: start(position),
            element: Some(Element { position, size }),
            ..array.clone()
        };
        (0..size).map(element).collect()
    }

    /// Smallest and largest value as numbers; infinite if undeclared.
    ///
    /// # Errors
    /// When one is not a number; the message names variable and text.
    pub fn range(&self) -> io::Result<(f64, f64)> {
        let bound = |text, none| self.number("a bound", text).map(|bound| bound.unwrap_or(none));
        Ok((bound(&self.min, f64::NEG_INFINITY)?, bound(&self.max, f64::INFINITY)?))
    }

    /// The nominal as a number; 1 if undeclared (FMI 2.0.5, section 2.2.3).
    ///
    /// # Errors
    /// When it is not a number; the message names variable and text.
    pub fn nominal(&self) -> io::Result<f64> {
        Ok(self.number("the nominal", &self.nominal)?.unwrap_or(1.0))
    }

    /// The number that an attribute is, if it is declared.
    fn number(&self, what: &str, text: &str) -> io::Result<Option<f64>> {
        let not_a_number = |_| broken(format!("{what} of {} is '{text}', which is not a number", self.name));
        (!text.is_empty()).then(|| text.trim().parse().map_err(not_a_number)).transpose()
    }

    /// Whether an importer may set it before initialization (FMI 2.0.5, section 2.2.7).
    #[must_use]
    pub fn is_settable(&self) -> bool {
        let is_set_by_default =
            matches!(self.causality.meaning(), Some(Causality::Input | Causality::Parameter));
        self.variability != Variability::Constant
            && self.causality != Causality::Independent
            && (is_set_by_default || matches!(self.initial.meaning(), Some(Initial::Exact | Initial::Approx)))
    }
}

/// The name of an element of an array with these sizes, by its position in row-major order; without sizes, the name.
pub(crate) fn element_name(name: &str, position: usize, sizes: &[usize]) -> String {
    if sizes.is_empty() {
        return name.to_owned();
    }
    let mut rest = position;
    let index = |size: &usize| {
        let index = rest % size + 1;
        rest /= size;
        index.to_string()
    };
    let mut indices: Vec<_> = sizes.iter().rev().map(index).collect();
    indices.reverse();
    format!("{name}[{}]", indices.join(","))
}

#[cfg(test)]
mod tests {
    use crate::FmuDescription;

    #[test]
    fn a_nominal_is_the_variables_or_its_types_or_one() {
        let fmu = FmuDescription::parse(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="Vessel">
              <TypeDefinitions><SimpleType name="Pressure"><Real nominal="1e5"/></SimpleType></TypeDefinitions>
              <ModelVariables>
                <ScalarVariable name="inlet"><Real declaredType="Pressure"/></ScalarVariable>
                <ScalarVariable name="vacuum"><Real declaredType="Pressure" nominal=" 0.1 "/></ScalarVariable>
                <ScalarVariable name="level"><Real/></ScalarVariable>
                <ScalarVariable name="broken"><Real nominal="one"/></ScalarVariable>
              </ModelVariables></fmiModelDescription>"#,
        )
        .unwrap();
        let nominal = |name: &str| fmu.variable(name).unwrap().nominal().map_err(|error| error.to_string());
        assert_eq!(["inlet", "vacuum", "level"].map(nominal), [Ok(1e5), Ok(0.1), Ok(1.0)]);
        let error = "the nominal of broken is 'one', which is not a number".to_owned();
        assert_eq!(nominal("broken"), Err(error));
    }
}
