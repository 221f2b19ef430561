//! The elements of a modelDescription.xml, wherever FMI 2.0 and 3.0 have them. What a variable does not declare has its
//! default in [`VariableElement`].

use fmu_terms::{Interface, Version, Word};

use crate::variable::{Types, VariableElement};
use crate::xml::{Element, children, listed, named};

/// The lists of the model structure in FMI 2.0, where it has them, and the elements of the same in FMI 3.0.
const LISTS: [[&str; 2]; 5] = [
    ["Outputs", "Output"],
    ["Derivatives", "ContinuousStateDerivative"],
    ["", "ClockedState"],
    ["InitialUnknowns", "InitialUnknown"],
    ["", "EventIndicator"],
];

/// The elements of a description, which may violate the schema.
#[derive(Debug)]
pub struct DescriptionElements<'d> {
    /// The root.
    pub root: Element<'d>,
    /// The declared types: the element with the name, and the one with `min`, `unit` and so on, which is the same in FMI 3.0.
    pub types: Vec<[Element<'d>; 2]>,
    type_by_name: Types<'d>,
}

/// An element of the model structure.
#[derive(Clone, Copy, Debug)]
pub struct StructureElement<'d> {
    /// What its list has, by FMI 3.0's name of the element: `Output`, `ContinuousStateDerivative`, `ClockedState`,
    /// `InitialUnknown` or `EventIndicator`.
    pub list: &'static str,
    /// The element.
    pub element: Element<'d>,
    /// What refers to its variable: its position from 1 on, in FMI 3.0 its value reference; empty if missing.
    pub reference: &'d str,
}

impl<'d> DescriptionElements<'d> {
    /// The elements below a root.
    #[must_use]
    pub fn new(root: Element<'d>) -> Self {
        let is_type = |child: &Element<'_>| !["Item", "Annotations"].contains(&child.tag_name().name());
        let types = listed(root, "TypeDefinitions")
            .map(|declared| [declared, children(declared).find(is_type).unwrap_or(declared)]);
        let types: Vec<_> = types.collect();
        let type_by_name =
            types.iter().filter_map(|[declared, typed]| Some((declared.attribute("name")?, *typed)));
        Self { root, type_by_name: type_by_name.collect(), types }
    }

    /// The version of FMI, if it is one of those that are read here.
    #[must_use]
    pub fn version(&self) -> Option<Version> {
        Version::declared(self.root.attribute("fmiVersion")?)
    }

    /// The interfaces.
    pub fn interfaces(&self) -> impl Iterator<Item = (Interface, Element<'d>)> + use<'d> {
        children(self.root).filter_map(|child| Some((Interface::of(child.tag_name().name())?, child)))
    }

    /// The defined units.
    pub fn units(&self) -> impl Iterator<Item = Element<'d>> + use<'d> {
        listed(self.root, "UnitDefinitions")
    }

    /// The variables.
    pub fn variables(&self) -> impl Iterator<Item = VariableElement<'d>> {
        listed(self.root, "ModelVariables").map(|element| VariableElement::new(element, &self.type_by_name))
    }

    /// The element of a declared type that has `min`, `unit` and so on.
    #[must_use]
    pub fn type_named(&self, name: &str) -> Option<Element<'d>> {
        self.type_by_name.get(name).copied()
    }

    /// The elements of the model structure.
    pub fn structure(&self) -> impl Iterator<Item = StructureElement<'d>> + use<'d> {
        let of = |list, element: Element<'d>, key| StructureElement {
            list,
            element,
            reference: element.attribute(key).unwrap_or_default(),
        };
        let elements = move |child: Element<'d>| {
            let name = child.tag_name().name();
            let of_fmi2 = LISTS.iter().filter(move |[list, _]| *list == name);
            let of_fmi2 = of_fmi2
                .flat_map(move |&[_, list]| children(child).map(move |element| of(list, element, "index")));
            let of_fmi3 = LISTS.iter().filter(move |[_, list]| *list == name);
            of_fmi2.chain(of_fmi3.map(move |&[_, list]| of(list, child, "valueReference")))
        };
        named(self.root, "ModelStructure").flat_map(children).flat_map(elements)
    }
}
