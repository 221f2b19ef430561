//! Reads the modelDescription.xml of an FMU of FMI 2.0 or 3.0 from any tool.
//!
//! Schemas are not checked. Values whose meaning differs between versions remain text, and XML errors are rejected with
//! their line. [`FmuDescription::scalars`] turns arrays and aliases of FMI 3.0 into variables as in FMI 2.0.

use std::collections::BTreeMap;
use std::io::{self, BufReader};
use std::path::Path;

use fmu_io::reading::{self, broken};
use fmu_terms::{Causality, DisplayUnit, Interface, Unit, Version};

use crate::archive;
use crate::declared::Declared;
use crate::elements::{DescriptionElements, StructureElement};
use crate::identifier::{IDENTIFIER, refuse_no_file_name};
use crate::units;
use crate::variable::{Dimension, FmuVariable};
use crate::variables::Variables;
use crate::xml::{self, attributes, listed, named, text};

/// The path of modelDescription.xml in the archive.
pub const MODEL_DESCRIPTION: &str = "modelDescription.xml";

/// The most array elements as variables, and the most event indicators.
const MOST_SCALARS: usize = 2_000_000;

/// An FMU's modelDescription.xml.
#[derive(Clone, Debug, Default)]
pub struct FmuDescription {
    /// The root element's attributes, by name, in file order.
    pub attributes: Vec<(String, String)>,
    /// The interfaces, each with its attributes: identifier and capabilities.
    pub interfaces: Vec<(Interface, Vec<(String, String)>)>,
    /// The source files that interfaces list (FMI 2.0), relative to `sources/`.
    pub source_files: Vec<(Interface, Vec<String>)>,
    /// The attributes of `DefaultExperiment`.
    pub default_experiment: Vec<(String, String)>,
    /// The declared units.
    pub units: Vec<Unit>,
    /// The declared enumerations.
    pub enumerations: Vec<Enumeration>,
    /// The variables, in file order.
    pub variables: Variables,
    /// The derivatives of the continuous states.
    pub derivatives: Vec<Derivative>,
    /// The value references of the event indicators (FMI 3.0).
    pub event_indicators: Vec<Declared<u32>>,
}

/// A derivative in `ModelStructure`. References are positions from 1 on, in FMI 3.0 value references.
#[derive(Clone, Debug)]
pub struct Derivative {
    /// The reference of the derivative's variable.
    pub reference: Declared<u32>,
    /// The references of the variables on which the derivative depends; if not listed, on all.
    pub dependencies: Option<Vec<Declared<u32>>>,
}

impl Derivative {
    fn read(StructureElement { element, reference, .. }: StructureElement<'_>) -> Self {
        let listed = element.attribute("dependencies");
        let listed =
            listed.map(|listed| listed.split_ascii_whitespace().map(|one| Declared::number(Some(one))));
        Self { reference: Declared::number(Some(reference)), dependencies: listed.map(Iterator::collect) }
    }
}

/// An enumeration type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Enumeration {
    /// The type's name.
    pub name: String,
    /// The enumeration's items: name and value.
    pub items: Vec<(String, i32)>,
}

impl FmuDescription {
    /// Reads an FMU's description.
    ///
    /// # Errors
    /// When the file does not exist, is not an FMU, or its description is broken; the message names the file.
    pub fn read(fmu: &Path) -> io::Result<Self> {
        let shown = fmu.display();
        let xml = archive::open(BufReader::new(reading::open(fmu)?))
            .and_then(|mut archive| archive::read_text(&mut archive, MODEL_DESCRIPTION))
            .map_err(|error| broken(format!("{shown} is not an FMU: {error}")))?;
        Self::parse(&xml)
            .map_err(|error| broken(format!("{MODEL_DESCRIPTION} in {shown} cannot be read: {error}")))
    }

    /// Reads the text of a modelDescription.xml.
    ///
    /// # Errors
    /// When it is not XML, or of another kind.
    pub fn parse(xml: &str) -> io::Result<Self> {
        let document = xml::read(xml, "fmiModelDescription")?;
        let root = document.root_element();
        refuse_fmi1(root)?;
        let elements = DescriptionElements::new(root);
        let enumerations = elements.types.iter();
        let enumerations =
            enumerations.map(|[declared, typed]| Enumeration::read(&text(*declared, "name"), *typed));
        let enumerations: Vec<_> = enumerations.collect::<io::Result<_>>()?;
        let source_files = elements.interfaces().map(|(interface, element)| {
            let files = listed(element, "SourceFiles").map(|file| text(file, "name"));
            (interface, files.collect::<Vec<_>>())
        });
        let variables = elements.variables().map(FmuVariable::read);
        let in_list = |list| elements.structure().filter(move |listed| listed.list == list);
        let indicators = in_list("EventIndicator").map(|listed| Declared::number(Some(listed.reference)));
        let description = Self {
            attributes: attributes(root),
            interfaces: elements
                .interfaces()
                .map(|(interface, element)| (interface, attributes(element)))
                .collect(),
            source_files: source_files.filter(|(_, files)| !files.is_empty()).collect(),
            default_experiment: named(root, "DefaultExperiment").next().map(attributes).unwrap_or_default(),
            units: units::read(elements.units())?,
            enumerations: enumerations.into_iter().filter(|known| !known.items.is_empty()).collect(),
            variables: variables.collect::<io::Result<Vec<_>>>()?.into(),
            derivatives: in_list("ContinuousStateDerivative").map(Derivative::read).collect(),
            event_indicators: indicators.collect(),
        };
        description
            .interfaces
            .iter()
            .try_for_each(|(_, attributes)| refuse_no_file_name(text_of(attributes, IDENTIFIER)))?;
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
                    scalars.extend(named.elements(&sizes, size));
                }
            }
        }
        self.variables = scalars.into();
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
                let of = self.with_reference(reference).next();
                of.and_then(|of| of.start.trim().parse().ok())
            }
        };
        let sizes = variable.dimensions.iter().map(size).collect::<Option<_>>();
        sizes.ok_or_else(|| broken(format!("{} has a dimension without a size", variable.name)))
    }

    /// The version of FMI; 2.0 unless it is 3.0.
    #[must_use]
    pub fn version(&self) -> Version {
        Version::declared(self.attribute("fmiVersion")).unwrap_or_default()
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

    /// The attributes of an interface, if offered.
    #[must_use]
    pub fn interface(&self, interface: Interface) -> Option<&[(String, String)]> {
        self.interfaces
            .iter()
            .find(|(known, _)| *known == interface)
            .map(|(_, attributes)| attributes.as_slice())
    }

    /// The identifier of the library for co-simulation, if offered.
    #[must_use]
    pub fn co_simulation_identifier(&self) -> Option<&str> {
        self.identifier(Interface::CoSimulation)
    }

    /// The identifier of the library for an interface, if offered.
    #[must_use]
    pub fn identifier(&self, interface: Interface) -> Option<&str> {
        self.interface(interface).map(|attributes| text_of(attributes, IDENTIFIER))
    }

    /// Whether the FMU declares a capability flag for an interface, such as `canGetAndSetFMUstate`, in FMI 3.0
    /// `canGetAndSetFMUState`. An XML boolean is a word or a digit.
    #[must_use]
    pub fn has_capability(&self, interface: Interface, flag: &str) -> bool {
        self.interface(interface).is_some_and(|attributes| {
            let value = attributes.iter().find(|(name, _)| name.eq_ignore_ascii_case(flag));
            value.and_then(|(_, value)| xml::boolean(value)) == Some(true)
        })
    }

    /// The continuous states with their derivatives, in the order of FMI's functions; array elements one by one in a
    /// description of [scalars](Self::scalars).
    ///
    /// # Errors
    /// When a derivative or its state is missing.
    pub fn continuous_states(&self) -> io::Result<Vec<[&FmuVariable; 2]>> {
        let mut states = vec![];
        for Derivative { reference, .. } in &self.derivatives {
            let derivatives = self.referred(reference);
            let of = derivatives.first().map(|derivative| self.referred(&derivative.derivative));
            let of = of.filter(|of| of.len() == derivatives.len());
            let of = of.ok_or_else(|| {
                broken(format!("the derivative {reference} in its ModelStructure has no state"))
            })?;
            states.extend(of.into_iter().zip(derivatives).map(<[_; 2]>::from));
        }
        Ok(states)
    }

    /// For each derivative in `ModelStructure`, the number of its elements, and the positions of the continuous states on
    /// which they depend; on all if none.
    ///
    /// # Errors
    /// As [`Self::continuous_states`].
    pub fn state_dependencies(&self) -> io::Result<Vec<(usize, Option<Vec<usize>>)>> {
        let mut positions = BTreeMap::<_, Vec<_>>::new();
        for (position, [_, derivative]) in self.continuous_states()?.into_iter().enumerate() {
            positions.entry(derivative.derivative.meaning()).or_default().push(position);
        }
        let of_states = |dependencies: &Vec<Declared<u32>>| {
            let states = dependencies.iter().filter_map(|reference| positions.get(&reference.meaning()));
            states.flatten().copied().collect()
        };
        let of_each = self.derivatives.iter().map(|Derivative { reference, dependencies }| {
            (self.referred(reference).len(), dependencies.as_ref().map(of_states))
        });
        Ok(of_each.collect())
    }

    /// The number of event indicators.
    ///
    /// # Errors
    /// When it is not a number, or above two million.
    pub fn number_of_event_indicators(&self) -> io::Result<usize> {
        if self.version() == Version::Three {
            return Ok(self.event_indicators.iter().map(|reference| self.referred(reference).len()).sum());
        }
        match self.attribute("numberOfEventIndicators") {
            "" => Ok(0),
            text => {
                let number = text.trim().parse();
                let number = number
                    .map_err(|_| broken(format!("its numberOfEventIndicators is '{text}', not a number")))?;
                if number > MOST_SCALARS {
                    return Err(broken(format!(
                        "its numberOfEventIndicators is {number}; at most {MOST_SCALARS} are supported"
                    )));
                }
                Ok(number)
            }
        }
    }

    /// The variable with a position from 1 on, or, in FMI 3.0, with a value reference; all elements if it is an array.
    fn referred(&self, reference: &Declared<u32>) -> Vec<&FmuVariable> {
        if self.version() == Version::Two {
            let position = reference.meaning().and_then(|position| (position as usize).checked_sub(1));
            return position.and_then(|position| self.variables.get(position)).into_iter().collect();
        }
        let mut known = self.with_reference(reference).peekable();
        // Further ones are aliases.
        let size = known.peek().and_then(|first| first.element).map_or(1, |element| element.size);
        known.take(size).collect()
    }

    /// The variables with a value reference.
    fn with_reference(&self, reference: &Declared<u32>) -> impl Iterator<Item = &FmuVariable> {
        reference.meaning().into_iter().flat_map(|reference| self.variables.with_reference(reference))
    }

    /// A variable by name.
    #[must_use]
    pub fn variable(&self, name: &str) -> Option<&FmuVariable> {
        self.variables.named(name)
    }

    /// The elements of an array, in the order of their indices; none if there is no array of this name.
    #[must_use]
    pub fn array(&self, name: &str) -> Vec<&FmuVariable> {
        let mut elements: Vec<_> =
            self.variables.iter().filter(|variable| variable.array() == Some(name)).collect();
        // The order in which FMI 2.0 lists them is free.
        elements.sort_by_key(|variable| variable.place_in_array().map(|(_, indices)| indices));
        elements
    }

    /// The variables of a causality.
    pub fn of_causality(&self, causality: Causality) -> impl Iterator<Item = &FmuVariable> {
        self.variables.iter().filter(move |variable| variable.causality == causality)
    }

    /// A unit by name, among the declared units and their display units.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<Unit> {
        units::find(name, &self.units)
    }

    /// The display unit that a variable's declaration names, without an offset if the values are differences.
    #[must_use]
    pub fn display_unit(&self, variable: &FmuVariable) -> Option<DisplayUnit> {
        let unit = self.units.iter().find(|unit| unit.name == variable.unit)?;
        let display = unit.display_units.iter().find(|display| display.name == variable.display_unit)?;
        let offset = if variable.relative_quantity { 0.0 } else { display.offset };
        Some(DisplayUnit { offset, ..display.clone() })
    }

    /// An enumeration by name.
    #[must_use]
    pub fn enumeration(&self, name: &str) -> Option<&Enumeration> {
        self.enumerations.iter().find(|enumeration| enumeration.name == name)
    }
}

impl Enumeration {
    fn read(name: &str, typed: xml::Element<'_>) -> io::Result<Self> {
        let items = named(typed, "Item").map(|item| {
            let value = xml::number(item, "value")?.ok_or_else(|| xml::wrong(item, "it has no value"))?;
            Ok((text(item, "name"), value))
        });
        Ok(Self { name: name.to_owned(), items: items.collect::<io::Result<_>>()? })
    }
}

/// Rejects an FMU of FMI 1.0, by the root of its description.
///
/// # Errors
/// When it is one.
pub fn refuse_fmi1(root: xml::Element<'_>) -> io::Result<()> {
    if root.attribute("fmiVersion") == Some("1.0") {
        return Err(broken("it is of FMI 1.0, which is not supported here; use FMPy".to_owned()));
    }
    Ok(())
}

fn text_of<'a>(attributes: &'a [(String, String)], name: &str) -> &'a str {
    attributes.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value)
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
            FmuDescription::parse(&xml)
                .unwrap()
                .has_capability(Interface::CoSimulation, "canGetAndSetFMUstate")
        };
        assert!(has(r#"canGetAndSetFMUstate="true""#) && has(r#"canGetAndSetFMUstate="1""#));
        assert!(!has(r#"canGetAndSetFMUstate="false""#) && !has(r#"canGetAndSetFMUstate="0""#) && !has(""));
    }

    #[test]
    fn texts_of_fmi_3_are_read() {
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

    /// The elements are found by their names, in any order.
    #[test]
    fn elements_of_fmi_2_are_an_array() {
        let names = ["b[2,1]", "b[1, 10]", "b[1,2]", "a[1]", "b[x]", "b", "b[1].c[3]", "b[]", "c[-1]"];
        let variables = names.map(|name| format!("<ScalarVariable name=\"{name}\"><Real/></ScalarVariable>"));
        let xml = format!(
            "<fmiModelDescription><ModelVariables>{}</ModelVariables></fmiModelDescription>",
            variables.concat()
        );
        let description = FmuDescription::parse(&xml).unwrap();
        for (array, elements) in [
            ("b", &["b[1,2]", "b[1, 10]", "b[2,1]"][..]),
            ("a", &["a[1]"]),
            ("b[1].c", &["b[1].c[3]"]),
            ("c", &[]),
        ] {
            let found: Vec<_> = description.array(array).into_iter().map(|variable| &variable.name).collect();
            assert_eq!(found, elements, "{array}");
        }
    }

    /// FMI 2.0.5, section 2.2.7; FMI 3.0.2, section 2.4.7.
    #[test]
    fn what_is_not_declared_has_the_default() {
        let of = |variable: &str| {
            let xml = format!(
                "<fmiModelDescription><ModelVariables>{variable}</ModelVariables></fmiModelDescription>"
            );
            let description = FmuDescription::parse(&xml).unwrap();
            let FmuVariable { causality, variability, initial, .. } = &description.variables[0];
            [causality.text(), variability.text(), initial.text()].map(str::to_owned)
        };
        for (variable, expected) in [
            ("<ScalarVariable><Real/></ScalarVariable>", ["local", "continuous", "calculated"]),
            (
                "<ScalarVariable causality=\"output\" variability=\"constant\"><Real/></ScalarVariable>",
                ["output", "constant", "exact"],
            ),
            (
                "<ScalarVariable causality=\"parameter\" variability=\"fixed\"><Real/></ScalarVariable>",
                ["parameter", "fixed", "exact"],
            ),
            ("<ScalarVariable causality=\"input\"><Real/></ScalarVariable>", ["input", "continuous", ""]),
            ("<Float64/>", ["local", "continuous", "calculated"]),
            ("<Int32 causality=\"output\"/>", ["output", "discrete", "calculated"]),
            ("<Float64 causality=\"parameter\"/>", ["parameter", "fixed", "exact"]),
            ("<UInt64 causality=\"structuralParameter\"/>", ["structuralParameter", "fixed", "exact"]),
            ("<Float64 causality=\"input\"/>", ["input", "continuous", "exact"]),
        ] {
            assert_eq!(of(variable), expected, "{variable}");
        }
    }

    #[test]
    fn every_model_identifier_is_checked() {
        for xml in [
            r#"<fmiModelDescription><CoSimulation modelIdentifier="../a"/></fmiModelDescription>"#,
            r#"<fmiModelDescription><ModelExchange modelIdentifier="a"/><CoSimulation modelIdentifier="a/b"/></fmiModelDescription>"#,
            "<fmiModelDescription><CoSimulation/></fmiModelDescription>",
        ] {
            assert!(FmuDescription::parse(xml).is_err(), "{xml}");
        }
    }
}
