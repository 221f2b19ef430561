//! The content of a description, abstracting from differences between FMI versions.

use std::collections::HashMap;

use fmu_terms::Version;

use super::report::{Place, Report};
use super::rules::Rule;
use super::xml::Xml;
use crate::model_description::INTERFACES;
use crate::xml::{Element, children, listed, named};

/// A description. Parts may be missing where it violates the schema, which is reported separately.
pub(super) struct Model<'d> {
    pub xml: &'d Xml<'d>,
    pub version: Version,
    pub root: Element<'d>,
    /// `ModelExchange`, `CoSimulation` and `ScheduledExecution`.
    pub interfaces: Vec<Element<'d>>,
    /// The declared types: the element with the name, and the one with `min`, `unit` and so on.
    pub types: Vec<(Element<'d>, Element<'d>)>,
    pub units: Vec<Element<'d>>,
    pub variables: Vec<Variable<'d>>,
    pub entries: Vec<Entry<'d>>,
    type_by_name: HashMap<&'d str, Element<'d>>,
    unit_by_name: HashMap<&'d str, Element<'d>>,
    /// The targets of indices (FMI 2) and value references (FMI 3).
    references: HashMap<u32, usize>,
}

/// A variable.
pub(super) struct Variable<'d> {
    pub element: Element<'d>,
    /// The element with `start`, `min` and so on: the same one in FMI 3.
    pub typed: Element<'d>,
    declared: Option<Element<'d>>,
    pub name: &'d str,
    pub causality: &'d str,
    pub variability: &'d str,
    /// As declared, or the standard's default.
    pub initial: Option<&'d str>,
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

/// The values allowed for `initial` with a combination of causality and variability, the default first (FMI 2.0.5,
/// section 2.2.7; FMI 3.0.2, section 2.4.7.5); none if the combination is not allowed.
pub(super) fn initials(
    version: Version,
    causality: &str,
    variability: &str,
) -> Option<&'static [&'static str]> {
    Some(match (causality, variability) {
        ("parameter", "fixed" | "tunable") | ("output" | "local", "constant") => &["exact"],
        ("calculatedParameter" | "local", "fixed" | "tunable") => &["calculated", "approx"],
        ("output" | "local", "discrete" | "continuous") => &["calculated", "exact", "approx"],
        ("structuralParameter", "fixed" | "tunable") | ("input", "discrete" | "continuous")
            if version == Version::Three =>
        {
            &["exact"]
        }
        ("input", "discrete" | "continuous") | ("independent", "continuous") => &[],
        _ => return None,
    })
}

/// Whether a type is floating-point.
pub(super) fn is_float(kind: &str) -> bool {
    matches!(kind, "Real" | "Float32" | "Float64")
}

impl<'d> Model<'d> {
    pub fn new(version: Version, xml: &'d Xml<'d>) -> Self {
        let root = xml.root();
        let below = |name| listed(root, name);
        let interfaces =
            children(root).filter(|child| INTERFACES.contains(&child.tag_name().name())).collect();
        let types: Vec<_> = below("TypeDefinitions")
            .map(|declared| match version {
                Version::Three => (declared, declared),
                Version::Two => (declared, children(declared).next().unwrap_or(declared)),
            })
            .collect();
        let units: Vec<_> = below("UnitDefinitions").collect();
        let by_name = |element: &Element<'d>| element.attribute("name").map(|name| (name, *element));
        let mut model = Self {
            xml,
            version,
            root,
            interfaces,
            type_by_name: types
                .iter()
                .filter_map(|(declared, typed)| Some((declared.attribute("name")?, *typed)))
                .collect(),
            types,
            unit_by_name: units.iter().filter_map(by_name).collect(),
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
        let typed = match self.version {
            Version::Three => element,
            Version::Two => children(element).next().unwrap_or(element),
        };
        let kind = typed.tag_name().name();
        let causality = element.attribute("causality").unwrap_or("local");
        let default = match (self.version, causality) {
            (Version::Three, "parameter" | "calculatedParameter" | "structuralParameter") => "fixed",
            (Version::Three, _) if !is_float(kind) => "discrete",
            _ => "continuous",
        };
        let variability = element.attribute("variability").unwrap_or(default);
        let default =
            initials(self.version, causality, variability).and_then(|allowed| allowed.first().copied());
        Variable {
            element,
            typed,
            declared: typed.attribute("declaredType").and_then(|name| self.type_by_name.get(name).copied()),
            name: element.attribute("name").unwrap_or_default(),
            causality,
            variability,
            initial: element.attribute("initial").or(default),
            derivative: typed.attribute("derivative"),
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
    pub fn interface(&self, name: &str) -> Option<Element<'d>> {
        self.interfaces.iter().find(|interface| interface.tag_name().name() == name).copied()
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

impl<'d> Variable<'d> {
    /// `Real`, `Float64` and so on.
    pub fn kind(&self) -> &'d str {
        self.typed.tag_name().name()
    }

    pub fn is_float(&self) -> bool {
        is_float(self.kind())
    }

    pub fn is_clocked(&self) -> bool {
        self.element.has_attribute("clocks")
    }

    /// An attribute of the variable, or of its declared type.
    pub fn inherited(&self, name: &str) -> Option<&'d str> {
        self.typed.attribute(name).or_else(|| self.declared.and_then(|declared| declared.attribute(name)))
    }

    /// The start values, if any. FMI 3 has elements for texts, which are not parsed here.
    pub fn start(&self) -> Option<&'d str> {
        let element = || named(self.element, "Start").next().map(|_| "");
        self.typed.attribute("start").or_else(element)
    }
}
