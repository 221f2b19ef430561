//! The content of a description, abstracting from differences between FMI versions.

use std::collections::HashMap;
use std::ops::Deref;

use fmu_terms::{Causality, DataType, Initial, Interface, Variability, Version, Word};

use super::report::{Place, Report};
use super::rules::Rule;
use super::xml::Xml;
use crate::declared::Declared;
use crate::model_description::{by_name, declared_types};
use crate::variable::{Types, VariableElement};
use crate::xml::{Element, children, listed, named};

/// A description. Parts may be missing where it violates the schema, which is reported separately.
pub(super) struct Model<'d> {
    pub xml: &'d Xml<'d>,
    pub version: Version,
    pub root: Element<'d>,
    pub interfaces: Vec<Element<'d>>,
    /// The declared types: the element with the name, and the one with `min`, `unit` and so on.
    pub types: Vec<[Element<'d>; 2]>,
    pub units: Vec<Element<'d>>,
    pub variables: Vec<Variable<'d>>,
    pub entries: Vec<Entry<'d>>,
    type_by_name: Types<'d>,
    unit_by_name: HashMap<&'d str, Element<'d>>,
    /// The targets of indices (FMI 2) and value references (FMI 3).
    references: HashMap<u32, usize>,
}

/// A variable.
pub(super) struct Variable<'d> {
    declaration: VariableElement<'d>,
    pub name: &'d str,
    pub data_type: Declared<DataType>,
    // As declared, or the standard's default.
    pub causality: Declared<Causality>,
    pub variability: Declared<Variability>,
    pub initial: Declared<Initial>,
    /// The attribute `derivative`.
    pub derivative: Option<&'d str>,
}

/// An entry of the model structure, in a list with FMI 3's name: `Output` and so on.
pub(super) struct Entry<'d> {
    pub list: &'static str,
    pub element: Element<'d>,
    /// The text that refers to its variable.
    pub reference: &'d str,
    /// The variable, if it exists.
    pub variable: Option<usize>,
    /// The existing variables on which it depends; none if it depends on all.
    pub dependencies: Option<Vec<usize>>,
}

impl<'d> Model<'d> {
    pub fn new(version: Version, xml: &'d Xml<'d>) -> Self {
        let root = xml.root();
        let below = |name| listed(root, name);
        let interfaces =
            children(root).filter(|child| Interface::of(child.tag_name().name()).is_some()).collect();
        let types: Vec<_> = declared_types(root).collect();
        let units: Vec<_> = below("UnitDefinitions").collect();
        let unit_by_name = |unit: &Element<'d>| unit.attribute("name").map(|name| (name, *unit));
        let mut model = Self {
            xml,
            version,
            root,
            interfaces,
            type_by_name: by_name(&types),
            types,
            unit_by_name: units.iter().filter_map(unit_by_name).collect(),
            units,
            variables: vec![],
            entries: vec![],
            references: HashMap::new(),
        };
        model.variables = below("ModelVariables").map(|element| model.variable(element)).collect();
        for (index, variable) in model.variables.iter().enumerate() {
            let reference = match version {
                Version::Three => {
                    variable.element.attribute("valueReference").and_then(|text| text.trim().parse().ok())
                }
                Version::Two => u32::try_from(index + 1).ok(),
            };
            if let Some(reference) = reference {
                model.references.entry(reference).or_insert(index);
            }
        }
        model.entries = model.read_structure();
        model
    }

    fn variable(&self, element: Element<'d>) -> Variable<'d> {
        let declaration = VariableElement::new(element, &self.type_by_name);
        Variable {
            declaration,
            name: element.attribute("name").unwrap_or_default(),
            data_type: declaration.data_type(),
            causality: declaration.causality(),
            variability: declaration.variability(),
            initial: declaration.initial(),
            derivative: declaration.typed.attribute("derivative"),
        }
    }

    fn read_structure(&self) -> Vec<Entry<'d>> {
        let structure = listed(self.root, "ModelStructure");
        let elements: Vec<(&str, Element<'d>)> = match self.version {
            Version::Three => structure.map(|entry| (entry.tag_name().name(), entry)).collect(),
            Version::Two => structure
                .flat_map(|list| children(list).map(move |entry| (list.tag_name().name(), entry)))
                .collect(),
        };
        let key = if self.version == Version::Three { "valueReference" } else { "index" };
        let entry = |(list, element): (&str, Element<'d>)| {
            let list = match list {
                "Outputs" | "Output" => "Output",
                "Derivatives" | "ContinuousStateDerivative" => "ContinuousStateDerivative",
                "InitialUnknowns" | "InitialUnknown" => "InitialUnknown",
                "ClockedState" => "ClockedState",
                "EventIndicator" => "EventIndicator",
                _ => return None,
            };
            let reference = element.attribute(key).unwrap_or_default();
            let dependencies = element.attribute("dependencies").map(|text| {
                text.split_ascii_whitespace().filter_map(|reference| self.resolve(reference)).collect()
            });
            Some(Entry { list, element, reference, variable: self.resolve(reference), dependencies })
        };
        elements.into_iter().filter_map(entry).collect()
    }

    /// The variable of an index (FMI 2) or value reference (FMI 3).
    pub fn resolve(&self, reference: &str) -> Option<usize> {
        self.references.get(&reference.trim().parse().ok()?).copied()
    }

    pub fn type_named(&self, name: &str) -> Option<Element<'d>> {
        self.type_by_name.get(name).copied()
    }

    pub fn unit_named(&self, name: &str) -> Option<Element<'d>> {
        self.unit_by_name.get(name).copied()
    }

    /// An interface, if the FMU has it.
    pub fn interface(&self, wanted: Interface) -> Option<Element<'d>> {
        self.interfaces.iter().find(|interface| interface.tag_name().name() == wanted.as_str()).copied()
    }

    /// The distinct model identifiers.
    pub fn identifiers(&self) -> Vec<&'d str> {
        let mut all: Vec<_> =
            self.interfaces.iter().filter_map(|element| element.attribute("modelIdentifier")).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The entries of a model structure list.
    pub fn list(&self, name: &str) -> impl Iterator<Item = &Entry<'d>> {
        self.entries.iter().filter(move |entry| entry.list == name)
    }

    /// The continuous states, whose derivatives are in the list of derivatives.
    pub fn states(&self) -> impl Iterator<Item = usize> {
        let derivatives = self.list("ContinuousStateDerivative").filter_map(|entry| entry.variable);
        derivatives
            .filter_map(|index| self.variables[index].derivative)
            .filter_map(|state| self.resolve(state))
    }

    /// The location of a variable's declaration.
    pub fn at(&self, variable: &Variable<'d>) -> Place {
        Place { variable: Some(variable.name.to_owned()), ..self.xml.at(variable.element) }
    }

    /// Reports a problem with an element.
    pub fn wrong(
        &self,
        report: &mut Report,
        rule: &'static Rule,
        element: Element<'d>,
        message: impl Into<String>,
    ) {
        report.add(rule, self.xml.at(element), message);
    }
}

impl<'d> Deref for Variable<'d> {
    type Target = VariableElement<'d>;

    fn deref(&self) -> &VariableElement<'d> {
        &self.declaration
    }
}

impl<'d> Variable<'d> {
    pub fn is_float(&self) -> bool {
        self.data_type.meaning().is_some_and(DataType::is_float)
    }

    pub fn is_clocked(&self) -> bool {
        self.element.has_attribute("clocks")
    }

    /// The start values, if any. FMI 3 has elements for texts, which are not parsed here.
    pub fn start(&self) -> Option<&'d str> {
        let element = || named(self.element, "Start").next().map(|_| "");
        self.typed.attribute("start").or_else(element)
    }
}
