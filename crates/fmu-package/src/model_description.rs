//! Reads the modelDescription.xml of an FMU from any tool and of any FMI version.
//!
//! It does not check schemas, which validators do. Values whose meaning differs between versions remain text, and XML
//! errors are rejected with their location. [`FmuDescription::scalars`] turns arrays and aliases of FMI 3.0 into
//! variables as in FMI 2.0.

use std::io::{self, BufReader};
use std::path::Path;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::archive::{self, broken};
use super::fmu::MODEL_DESCRIPTION;
use super::reading;
use super::terminal::in_line;
use super::units::{BaseUnit, DisplayUnit, Unit};

/// The deepest nesting of elements; FMI and SSP schemas need a tenth.
pub(crate) const DEEPEST: usize = 100;
/// The most elements of a document; the largest models have 200,000 variables with three elements each.
pub(crate) const MOST_ELEMENTS: usize = 2_000_000;
/// The most attributes of an element; FMI and SSP schemas need a fifth.
pub(crate) const MOST_ATTRIBUTES: usize = 100;

/// The most array elements as variables.
const MOST_SCALARS: usize = 2_000_000;

/// The attribute with the name of the FMU's library.
const IDENTIFIER: &str = "modelIdentifier";

/// Whether a text may be a model identifier: a C identifier.
#[must_use]
pub fn is_identifier(text: &str) -> bool {
    let is_letter = |byte: u8| byte.is_ascii_alphabetic() || byte == b'_';
    text.bytes().next().is_some_and(is_letter)
        && text.bytes().all(|byte| is_letter(byte) || byte.is_ascii_digit())
}

/// Rejects a model identifier that is not a C identifier (FMI 2.0.5, section 2.2.1): it is used in file names.
pub(crate) fn refuse_no_identifier(text: &str) -> io::Result<()> {
    if is_identifier(text) {
        return Ok(());
    }
    Err(broken(format!("the modelIdentifier '{}' is not a C identifier", in_line(text))))
}

/// An FMU's modelDescription.xml.
#[derive(Clone, Debug, Default)]
pub struct FmuDescription {
    /// The root element's attributes, by name, in file order.
    pub attributes: Vec<(String, String)>,
    /// The interface types (`CoSimulation` …), each with its attributes: identifier and capabilities.
    pub interfaces: Vec<(String, Vec<(String, String)>)>,
    /// The attributes of `DefaultExperiment`.
    pub default_experiment: Vec<(String, String)>,
    /// The declared units.
    pub units: Vec<Unit>,
    /// The declared enumerations.
    pub enumerations: Vec<Enumeration>,
    /// The variables, in file order.
    pub variables: Vec<FmuVariable>,
}

/// An enumeration type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Enumeration {
    /// The type's name.
    pub name: String,
    /// Its items: name and value.
    pub items: Vec<(String, i32)>,
}

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
    /// The unit to show values in, or that of its type.
    pub display_unit: String,
    /// The start value.
    pub start: String,
    /// The smallest value.
    pub min: String,
    /// The largest value.
    pub max: String,
    /// Empty if the FMU gives none.
    pub description: String,
    /// The sizes of an array (FMI 3.0).
    pub dimensions: Vec<Dimension>,
    /// Other names of the variable, each with its description (FMI 3.0).
    pub aliases: Vec<(String, String)>,
    /// Its place in an array, from [`FmuDescription::scalars`].
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

/// A declared type's attributes for its variables.
#[derive(Default)]
struct DeclaredType {
    name: String,
    unit: String,
    display_unit: String,
    min: String,
    max: String,
}

impl FmuDescription {
    /// Reads an FMU's description, and checks the whole archive.
    ///
    /// # Errors
    /// When the file does not exist, is not an FMU, or its description is broken; the message names the file.
    pub fn read(fmu: &Path) -> io::Result<Self> {
        let shown = fmu.display();
        let xml = archive::open(BufReader::new(reading::open(fmu)?))
            .and_then(|mut archive| archive::read_text(&mut archive, MODEL_DESCRIPTION))
            .map_err(|error| broken(format!("{shown} is not an FMU: {error}")))?;
        Self::parse(&xml)
            .map_err(|error| broken(format!("{MODEL_DESCRIPTION} in {shown} is broken: {error}")))
    }

    /// Reads the text of a modelDescription.xml.
    ///
    /// # Errors
    /// When it is not XML, or of another kind.
    pub fn parse(xml: &str) -> io::Result<Self> {
        let mut description = Self::default();
        let mut types: Vec<DeclaredType> = vec![];
        let root = read_elements(xml, |path, name, attributes| {
            match path {
                [] => description.attributes = attributes.0,
                [_] if ["CoSimulation", "ModelExchange", "ScheduledExecution"].contains(&name) => {
                    description.interfaces.push((name.to_owned(), attributes.0));
                }
                [_] if name == "DefaultExperiment" => description.default_experiment = attributes.0,
                [_, "UnitDefinitions"] => description.units.push(Unit {
                    // FMI 1.0 uses another name.
                    name: attributes
                        .get("name")
                        .or_else(|| attributes.get("unit"))
                        .unwrap_or_default()
                        .to_owned(),
                    base: None,
                    display_units: vec![],
                }),
                [_, "UnitDefinitions", _] => {
                    if let Some(unit) = description.units.last_mut() {
                        unit.take(name, &attributes)?;
                    }
                }
                [_, "TypeDefinitions"] => {
                    // FMI 3.0: the element itself is the type.
                    let mut declared =
                        DeclaredType { name: attributes.text("name"), ..DeclaredType::default() };
                    declared.take(&attributes);
                    description.enumerations.push(Enumeration { name: declared.name.clone(), items: vec![] });
                    types.push(declared);
                }
                [_, "TypeDefinitions", _] if name != "Item" => {
                    if let Some(declared) = types.last_mut() {
                        declared.take(&attributes);
                    }
                }
                [_, "TypeDefinitions", ..] if name == "Item" => {
                    if let Some(enumeration) = description.enumerations.last_mut() {
                        // FMI 1.0 counts from 1.
                        let next = enumeration.items.last().map_or(1, |(_, last)| last.saturating_add(1));
                        let value = attributes.number("value", next)?;
                        enumeration.items.push((attributes.text("name"), value));
                    }
                }
                [_, "ModelVariables"] => {
                    let mut variable = FmuVariable::new(&attributes);
                    // FMI 3.0: the element itself is the type.
                    if name != "ScalarVariable" {
                        variable.take_type(name, &attributes, &types);
                    }
                    description.variables.push(variable);
                }
                // FMI 3.0: texts are elements, one per array element.
                [_, "ModelVariables", "String" | "Binary"] if name == "Start" => {
                    if let Some(variable) = description.variables.last_mut() {
                        let before = if variable.start.is_empty() { "" } else { "\n" };
                        variable.start += &format!("{before}{}", attributes.text("value"));
                    }
                }
                [_, "ModelVariables", _] if name == "Dimension" => {
                    if let Some(variable) = description.variables.last_mut() {
                        variable.dimensions.push(match attributes.get("valueReference") {
                            Some(reference) => Dimension::Variable(reference.to_owned()),
                            None => Dimension::Fixed(attributes.number("start", 1)?),
                        });
                    }
                }
                [_, "ModelVariables", _] if name == "Alias" => {
                    if let Some(variable) = description.variables.last_mut() {
                        variable.aliases.push((attributes.text("name"), attributes.text("description")));
                    }
                }
                [_, "ModelVariables", "ScalarVariable"] => {
                    if let Some(variable) = description.variables.last_mut()
                        && variable.data_type.is_empty()
                    {
                        variable.take_type(name, &attributes, &types);
                    }
                }
                _ => {}
            }
            Ok(())
        })?;
        if root != "fmiModelDescription" {
            return Err(broken(format!("the root element is {root}, not fmiModelDescription")));
        }
        // FMI 1.0 has it in the root element.
        let of_root = description.attributes.iter().filter(|(name, _)| name == IDENTIFIER);
        of_root
            .map(|(_, identifier)| identifier.as_str())
            .chain(description.interfaces.iter().map(|(_, attributes)| text_of(attributes, IDENTIFIER)))
            .try_for_each(refuse_no_identifier)?;
        description.enumerations.retain(|enumeration| !enumeration.items.is_empty());
        Ok(description)
    }

    /// The description with a variable per array element, `name[1,1]` and so on, and per alias, as in FMI 2.0.
    /// Structural parameters have their start values.
    ///
    /// # Errors
    /// When a size is unknown, or there are more than two million elements.
    pub fn scalars(mut self) -> io::Result<Self> {
        let mut scalars = vec![];
        for variable in &self.variables {
            let sizes = self.sizes(variable)?;
            let size = sizes.iter().try_fold(1_usize, |product, size| product.checked_mul(*size));
            let size = size.filter(|size| *size <= MOST_SCALARS.saturating_sub(scalars.len()));
            let Some(size) = size else {
                return Err(broken(format!("its arrays have more than {MOST_SCALARS} elements")));
            };
            let own = [(variable.name.clone(), variable.description.clone())];
            for (name, description) in own.into_iter().chain(variable.aliases.iter().cloned()) {
                let named = FmuVariable { name, description, aliases: vec![], ..variable.clone() };
                if sizes.is_empty() {
                    scalars.push(named);
                } else {
                    scalars
                        .extend((0..size).map(|position| named.element(&sizes, Element { position, size })));
                }
            }
        }
        self.variables = scalars;
        Ok(self)
    }

    /// An array's sizes; empty for a scalar.
    ///
    /// # Errors
    /// When one of them has no number.
    pub fn sizes(&self, variable: &FmuVariable) -> io::Result<Vec<usize>> {
        let size = |dimension: &Dimension| match dimension {
            Dimension::Fixed(size) => Some(*size),
            Dimension::Variable(reference) => {
                let of = self.variables.iter().find(|of| of.value_reference == *reference);
                of.and_then(|of| of.start.trim().parse().ok())
            }
        };
        let sizes = variable.dimensions.iter().map(size).collect::<Option<_>>();
        sizes.ok_or_else(|| broken(format!("{} has a dimension without a size", variable.name)))
    }

    /// Whether it is FMI 3.0.
    #[must_use]
    pub fn is_fmi3(&self) -> bool {
        self.attribute("fmiVersion").starts_with("3.")
    }

    /// The model's unique identifier: the GUID, or in FMI 3.0 the instantiation token.
    #[must_use]
    pub fn guid(&self) -> &str {
        match self.attribute("guid") {
            "" => self.attribute("instantiationToken"),
            guid => guid,
        }
    }

    /// An attribute of the root element; empty if missing.
    #[must_use]
    pub fn attribute(&self, name: &str) -> &str {
        text_of(&self.attributes, name)
    }

    /// The attributes of an interface, such as `CoSimulation`.
    #[must_use]
    pub fn interface(&self, name: &str) -> Option<&[(String, String)]> {
        self.interfaces.iter().find(|(known, _)| known == name).map(|(_, attributes)| attributes.as_slice())
    }

    /// The identifier of the library for co-simulation, if offered.
    #[must_use]
    pub fn co_simulation_identifier(&self) -> Option<&str> {
        self.interface("CoSimulation").map(|attributes| text_of(attributes, IDENTIFIER))
    }

    /// Whether the FMU declares a capability flag for co-simulation, such as `canGetAndSetFMUstate`, in FMI 3.0
    /// `canGetAndSetFMUState`. An XML boolean is a word or a digit.
    #[must_use]
    pub fn has_capability(&self, flag: &str) -> bool {
        self.interface("CoSimulation").is_some_and(|attributes| {
            let value = attributes.iter().find(|(name, _)| name.eq_ignore_ascii_case(flag));
            value.is_some_and(|(_, value)| matches!(value.as_str(), "true" | "1"))
        })
    }

    /// A variable by name.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&FmuVariable> {
        self.variables.iter().find(|variable| variable.name == name)
    }

    /// The variables of a causality.
    pub fn of_causality<'a>(&'a self, causality: &'a str) -> impl Iterator<Item = &'a FmuVariable> {
        self.variables.iter().filter(move |variable| variable.causality == causality)
    }

    /// A unit by name, among the declared units and their display units.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<Unit> {
        let declared = self.units.iter().find(|unit| unit.name == name).cloned();
        let shown = || self.units.iter().flat_map(Unit::with_display_units).find(|unit| unit.name == name);
        declared.or_else(shown)
    }

    /// The display unit that a variable's declaration names.
    #[must_use]
    pub fn display_unit(&self, variable: &FmuVariable) -> Option<&DisplayUnit> {
        let unit = self.units.iter().find(|unit| unit.name == variable.unit)?;
        unit.display_units.iter().find(|display| display.name == variable.display_unit)
    }

    /// An enumeration by name.
    #[must_use]
    pub fn enumeration(&self, name: &str) -> Option<&Enumeration> {
        self.enumerations.iter().find(|enumeration| enumeration.name == name)
    }
}

impl FmuVariable {
    fn new(attributes: &Attributes) -> Self {
        Self {
            name: attributes.text("name"),
            value_reference: attributes.text("valueReference"),
            causality: attributes.text("causality"),
            variability: attributes.text("variability"),
            initial: attributes.text("initial"),
            description: attributes.text("description"),
            ..Self::default()
        }
    }

    /// Adopts attributes of a type's element.
    fn take_type(&mut self, name: &str, attributes: &Attributes, types: &[DeclaredType]) {
        name.clone_into(&mut self.data_type);
        self.declared_type = attributes.text("declaredType");
        self.start = attributes.text("start");
        let declared = types.iter().find(|declared| declared.name == self.declared_type);
        let own_or = |name: &str, inherited: Option<&String>| match attributes.get(name) {
            Some(value) => value.to_owned(),
            None => inherited.cloned().unwrap_or_default(),
        };
        self.unit = own_or("unit", declared.map(|declared| &declared.unit));
        self.display_unit = own_or("displayUnit", declared.map(|declared| &declared.display_unit));
        self.min = own_or("min", declared.map(|declared| &declared.min));
        self.max = own_or("max", declared.map(|declared| &declared.max));
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
    fn element(&self, sizes: &[usize], element: Element) -> Self {
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

impl DeclaredType {
    fn take(&mut self, attributes: &Attributes) {
        self.unit = attributes.text("unit");
        self.display_unit = attributes.text("displayUnit");
        self.min = attributes.text("min");
        self.max = attributes.text("max");
    }
}

impl Unit {
    /// Adopts a child element of the unit's.
    pub(crate) fn take(&mut self, name: &str, attributes: &Attributes) -> io::Result<()> {
        let (factor, offset) = (attributes.number("factor", 1.0)?, attributes.number("offset", 0.0)?);
        match name {
            "BaseUnit" => {
                let mut base = BaseUnit { factor, offset, ..BaseUnit::one() };
                for (name, _) in attributes.0.iter().filter(|(name, _)| BaseUnit::is_exponent(name)) {
                    base.set_exponent(name, attributes.number(name, 0)?);
                }
                self.base = Some(base);
            }
            "DisplayUnit" => {
                self.display_units.push(DisplayUnit { name: attributes.text("name"), factor, offset });
            }
            // FMI 1.0.
            "DisplayUnitDefinition" => {
                let (name, factor) = (attributes.text("displayUnit"), attributes.number("gain", 1.0)?);
                self.display_units.push(DisplayUnit { name, factor, offset });
            }
            _ => {}
        }
        Ok(())
    }
}

/// The attributes of an element, unescaped.
pub(crate) struct Attributes(pub(crate) Vec<(String, String)>);

impl Attributes {
    fn of(element: &BytesStart<'_>) -> io::Result<Self> {
        let mut attributes = vec![];
        for attribute in element.attributes() {
            let attribute = attribute.map_err(|error| broken(error.to_string()))?;
            let value = attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|error| broken(error.to_string()))?;
            attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
            if attributes.len() > MOST_ATTRIBUTES {
                return Err(broken(format!("it has more than {MOST_ATTRIBUTES} attributes")));
            }
        }
        Ok(Self(attributes))
    }

    pub(crate) fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    pub(crate) fn text(&self, key: &str) -> String {
        text_of(&self.0, key).to_owned()
    }

    /// A number; `default` if the attribute is missing.
    pub(crate) fn number<T: std::str::FromStr>(&self, key: &str, default: T) -> io::Result<T> {
        match self.get(key) {
            None => Ok(default),
            Some(text) => text
                .trim()
                .parse()
                .map_err(|_| broken(format!("the attribute {key} is '{text}', which is not a valid number"))),
        }
    }
}

fn text_of<'a>(attributes: &'a [(String, String)], name: &str) -> &'a str {
    attributes.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value)
}

/// Calls a function for each element of a document, with the names of the enclosing elements, its name and its
/// attributes, without namespace prefixes. Returns the root's name.
///
/// Document type definitions are rejected, because their entities may expand without bounds.
pub(crate) fn read_elements(
    xml: &str,
    mut take: impl FnMut(&[&str], &str, Attributes) -> io::Result<()>,
) -> io::Result<String> {
    let mut reader = Reader::from_str(xml);
    let mut path: Vec<String> = vec![];
    let mut root = None;
    let mut elements = 0;
    loop {
        let event = reader
            .read_event()
            .map_err(|error| broken(format!("at byte {}: {error}", reader.error_position())))?;
        let (element, is_empty) = match &event {
            Event::Start(element) => (element, false),
            Event::Empty(element) => (element, true),
            Event::End(_) => {
                path.pop();
                continue;
            }
            Event::DocType(_) => return Err(broken("it has a document type definition")),
            Event::Eof => break,
            _ => continue,
        };
        elements += 1;
        if elements > MOST_ELEMENTS {
            return Err(broken(format!("it has more than {MOST_ELEMENTS} elements")));
        }
        let place = reader.buffer_position();
        let name = element.local_name().as_ref().to_owned();
        let parents: Vec<&str> = path.iter().map(String::as_str).collect();
        Attributes::of(element)
            .and_then(|attributes| take(&parents, &name, attributes))
            .map_err(|error| broken(format!("in the element {name} before byte {place}: {error}")))?;
        root.get_or_insert_with(|| name.clone());
        if !is_empty {
            path.push(name);
            if path.len() > DEEPEST {
                return Err(broken(format!("more than {DEEPEST} elements are nested")));
            }
        }
    }
    if let Some(open) = path.last() {
        return Err(broken(format!("it ends within the element {open}")));
    }
    root.ok_or_else(|| broken("it has no root element"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capability_is_declared_by_word_or_digit() {
        let has = |attributes: &str| {
            let xml = format!(
                r#"<fmiModelDescription><CoSimulation modelIdentifier="a" {attributes}/></fmiModelDescription>"#
            );
            FmuDescription::parse(&xml).unwrap().has_capability("canGetAndSetFMUstate")
        };
        assert!(has(r#"canGetAndSetFMUstate="true""#) && has(r#"canGetAndSetFMUstate="1""#));
        assert!(!has(r#"canGetAndSetFMUstate="false""#) && !has(r#"canGetAndSetFMUstate="0""#) && !has(""));
    }

    #[test]
    fn units_of_fmi_1_and_texts_of_fmi_3_are_read() {
        let xml = r#"<fmiModelDescription><UnitDefinitions><BaseUnit unit="K">
            <DisplayUnitDefinition displayUnit="degC" gain="1" offset="-273.15"/>
            </BaseUnit></UnitDefinitions></fmiModelDescription>"#;
        let shown = DisplayUnit { name: "degC".to_owned(), factor: 1.0, offset: -273.15 };
        let unit = Unit { name: "K".to_owned(), base: None, display_units: vec![shown] };
        assert_eq!(FmuDescription::parse(xml).unwrap().units, [unit]);

        let xml = r#"<fmiModelDescription><ModelVariables><String name="a"><Start value="b"/><Start value="c"/>
            </String></ModelVariables></fmiModelDescription>"#;
        assert_eq!(FmuDescription::parse(xml).unwrap().variables[0].start, "b\nc");
    }

    #[test]
    fn arrays_and_aliases_of_fmi_3_become_variables() {
        let scalars = |variables: &str| {
            let xml = format!(
                "<fmiModelDescription><ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
            );
            let scalars =
                FmuDescription::parse(&xml).unwrap().scalars().map_err(|error| error.to_string())?;
            let shown = |variable: &FmuVariable| {
                let element = variable.element.map(|element| (element.position, element.size));
                (variable.name.clone(), variable.start.clone(), variable.description.clone(), element)
            };
            Ok::<_, String>(scalars.variables.iter().map(shown).collect::<Vec<_>>())
        };
        let row = |name: &str, start: &str, description: &str, element| {
            (name.to_owned(), start.to_owned(), description.to_owned(), element)
        };
        let found = scalars(
            r#"<Float64 name="a" start="1 2	3  4 5 6" description="of a"><Dimension valueReference="7"/><Dimension start="3"/>
            <Alias name="b" description="of b"/></Float64><UInt64 name="rows" valueReference="7" start="2"/>
            <String name="texts"><Dimension start="2"/><Start value="one"/><Start value=""/></String>
            <Int32 name="same" start="4"><Dimension start="2"/></Int32>"#,
        )
        .unwrap();
        let mut expected = vec![];
        for array in ["a", "b"] {
            for (position, index) in ["1,1", "1,2", "1,3", "2,1", "2,2", "2,3"].into_iter().enumerate() {
                let start = (position + 1).to_string();
                let name = format!("{array}[{index}]");
                expected.push(row(&name, &start, &format!("of {array}"), Some((position, 6))));
            }
        }
        expected.push(row("rows", "2", "", None));
        expected.push(row("texts[1]", "one", "", Some((0, 2))));
        expected.push(row("texts[2]", "", "", Some((1, 2))));
        expected.push(row("same[1]", "4", "", Some((0, 2))));
        expected.push(row("same[2]", "4", "", Some((1, 2))));
        assert_eq!(found, expected);

        let refusal =
            |dimension: &str| scalars(&format!(r#"<Int8 name="a">{dimension}</Int8>"#)).unwrap_err();
        assert_eq!(refusal(r#"<Dimension valueReference="9"/>"#), "a has a dimension without a size");
        let large = r#"<Dimension start="4000000000"/>"#;
        for dimensions in [large.to_owned(), large.repeat(3)] {
            assert_eq!(refusal(&dimensions), "its arrays have more than 2000000 elements");
        }
    }

    #[test]
    fn a_model_identifier_is_a_c_identifier() {
        for identifier in ["Lag", "_1", "a"] {
            assert!(refuse_no_identifier(identifier).is_ok(), "{identifier}");
        }
        for (identifier, shown) in [
            ("", ""),
            ("1a", "1a"),
            ("a b", "a b"),
            ("../a", "../a"),
            ("\u{e9}", "\u{e9}"),
            ("a\n\u{1b}[2J", r"a\n\u{1b}[2J"),
        ] {
            let refusal = refuse_no_identifier(identifier).unwrap_err().to_string();
            assert_eq!(refusal, format!("the modelIdentifier '{shown}' is not a C identifier"));
        }
        // Of each interface, and of FMI 1.0.
        for xml in [
            r#"<fmiModelDescription modelIdentifier="../a"/>"#,
            r#"<fmiModelDescription><ModelExchange modelIdentifier="a"/><CoSimulation modelIdentifier="a/b"/></fmiModelDescription>"#,
            "<fmiModelDescription><CoSimulation/></fmiModelDescription>",
        ] {
            assert!(FmuDescription::parse(xml).is_err(), "{xml}");
        }
    }

    #[test]
    fn too_many_elements_are_refused() {
        let attributes = (0..200).map(|index| format!(r#"a{index}="" "#)).collect::<Vec<_>>().concat();
        let refusal = |xml: &str| FmuDescription::parse(xml).unwrap_err().to_string();
        let message = refusal(&format!("<fmiModelDescription {attributes}/>"));
        assert!(message.ends_with("it has more than 100 attributes"), "{message}");
        let elements = "<a/>".repeat(MOST_ELEMENTS);
        let message = refusal(&format!("<fmiModelDescription>{elements}</fmiModelDescription>"));
        assert_eq!(message, "it has more than 2000000 elements");
    }
}
