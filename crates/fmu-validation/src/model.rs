//! The content of a description, abstracting from differences between FMI versions.

use std::collections::HashMap;
use std::ops::Deref;

use fmu_package::xml::{Element, named};
use fmu_package::{Declared, DescriptionElements, StructureElement, VariableElement};
use fmu_terms::{Causality, DataType, Initial, Interface, Variability, Version, Word};

use crate::report::{Place, Report};
use crate::rules::Rule;
use crate::xml::Xml;

/// A description. Parts may be missing where it violates the schema, which is reported separately.
pub(crate) struct Model<'d> {
    pub xml: &'d Xml<'d>,
    pub version: Version,
    pub interfaces: Vec<Element<'d>>,
    pub units: Vec<Element<'d>>,
    pub variables: Vec<Variable<'d>>,
    pub entries: Vec<Entry<'d>>,
    elements: DescriptionElements<'d>,
    unit_by_name: HashMap<&'d str, Element<'d>>,
    /// The targets of indices (FMI 2) and value references (FMI 3).
    references: HashMap<u32, usize>,
}

/// A variable.
pub(crate) struct Variable<'d> {
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

/// An entry of the model structure.
pub(crate) struct Entry<'d> {
    listed: StructureElement<'d>,
    /// The variable, if it exists.
    pub variable: Option<usize>,
    /// The existing variables on which it depends; none if it depends on all.
    pub dependencies: Option<Vec<usize>>,
}

impl<'d> Model<'d> {
    pub fn new(version: Version, xml: &'d Xml<'d>, elements: DescriptionElements<'d>) -> Self {
        let units: Vec<_> = elements.units().collect();
        let unit_by_name = |unit: &Element<'d>| unit.attribute("name").map(|name| (name, *unit));
        let variables: Vec<_> = elements.variables().map(Variable::new).collect();
        let mut references = HashMap::new();
        for (index, variable) in variables.iter().enumerate() {
            let reference = match version {
                Version::Three => {
                    variable.element.attribute("valueReference").and_then(|text| text.trim().parse().ok())
                }
                Version::Two => u32::try_from(index + 1).ok(),
            };
            if let Some(reference) = reference {
                references.entry(reference).or_insert(index);
            }
        }
        let mut model = Self {
            xml,
            version,
            interfaces: elements.interfaces().map(|(_, element)| element).collect(),
            unit_by_name: units.iter().filter_map(unit_by_name).collect(),
            units,
            variables,
            entries: vec![],
            references,
            elements,
        };
        model.entries = model.elements.structure().map(|element| model.entry(element)).collect();
        model
    }

    fn entry(&self, listed: StructureElement<'d>) -> Entry<'d> {
        let dependencies = listed.element.attribute("dependencies").map(|text| {
            text.split_ascii_whitespace().filter_map(|reference| self.resolve(reference)).collect()
        });
        Entry { listed, variable: self.resolve(listed.reference), dependencies }
    }

    /// The variable of an index (FMI 2) or value reference (FMI 3).
    pub fn resolve(&self, reference: &str) -> Option<usize> {
        self.references.get(&reference.trim().parse().ok()?).copied()
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

impl<'d> Deref for Model<'d> {
    type Target = DescriptionElements<'d>;

    fn deref(&self) -> &DescriptionElements<'d> {
        &self.elements
    }
}

impl<'d> Deref for Entry<'d> {
    type Target = StructureElement<'d>;

    fn deref(&self) -> &StructureElement<'d> {
        &self.listed
    }
}

impl<'d> Deref for Variable<'d> {
    type Target = VariableElement<'d>;

    fn deref(&self) -> &VariableElement<'d> {
        &self.declaration
    }
}

impl<'d> Variable<'d> {
    fn new(declaration: VariableElement<'d>) -> Self {
        Self {
            declaration,
            name: declaration.element.attribute("name").unwrap_or_default(),
            data_type: declaration.data_type(),
            causality: declaration.causality(),
            variability: declaration.variability(),
            initial: declaration.initial(),
            derivative: declaration.typed.attribute("derivative"),
        }
    }

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
