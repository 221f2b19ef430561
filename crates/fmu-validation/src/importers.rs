//! The table of FMUs that the standard allows but known importers reject, shown in `docs/validation.md`.

use fmu_package::xml::named;
use fmu_terms::{Causality, DataType, Version};

use crate::model::Model;
use crate::report::{Place, Report};
use crate::rules::{
    AMPERE_OR_KELVIN, ARRAY, CLOCK_VARIABLE, ENUMERATION_VARIABLE, Rule, STRUCTURAL_PARAMETER,
    TYPE_DESCRIPTION, UNIT_OF_VARIABLE,
};

/// A tool that imports FMUs.
#[derive(Debug)]
pub struct Importer {
    /// The importer's name.
    pub name: &'static str,
    /// The importer's versions for which this is known.
    pub versions: &'static str,
    /// The evidence.
    pub evidence: &'static str,
    /// The rules that the importer requires beyond the standard, and its behaviour if an FMU breaks them.
    pub refuses: &'static [(&'static Rule, &'static str)],
}

/// All importers with known restrictions.
pub static ALL: &[Importer] = &[
    Importer {
        name: "CasADi",
        versions: "3.8.2",
        evidence: "tried",
        refuses: &[
            (&ARRAY, "`DaeBuilder.create` fails: it passes one value for each variable"),
            (&STRUCTURAL_PARAMETER, "`DaeBuilder` fails: it does not know the causality"),
        ],
    },
    Importer {
        name: "Chrono",
        versions: "of July 2026",
        evidence: "source of fmu-forge",
        refuses: &[
            (&ENUMERATION_VARIABLE, "reading fails: \"Unknown variable type\""),
            (&CLOCK_VARIABLE, "reading fails: \"Unknown variable type\""),
            (&STRUCTURAL_PARAMETER, "reading fails: \"causality is badly formatted\""),
        ],
    },
    Importer {
        name: "fmi",
        versions: "0.8.0",
        evidence: "`unit` and base units tried; source of the crate fmi-schema",
        refuses: &[
            (&AMPERE_OR_KELVIN, "reading fails: it knows these attributes as `a` and `k`"),
            (&UNIT_OF_VARIABLE, "reading fails: it knows these attributes of types alone"),
        ],
    },
    Importer {
        name: "FMI.jl",
        versions: "0.15.0",
        evidence: "source of FMIImport.jl 1.3.1",
        refuses: &[(
            &ARRAY,
            "start values are ignored with a warning; reading fails where a structural parameter sets the size",
        )],
    },
    Importer {
        name: "FMPy",
        versions: "below 0.3.24",
        evidence: "0.3.23 and 0.3.24 tried",
        refuses: &[(&TYPE_DESCRIPTION, "reading fails with a `TypeError`")],
    },
    Importer {
        name: "OMSimulator",
        versions: "of August 2026",
        evidence: "source",
        refuses: &[(&ARRAY, "getting and setting fails: it passes one value for each variable")],
    },
    Importer {
        name: "PyFMI",
        versions: "2.21.0",
        evidence: "source",
        refuses: &[(&ARRAY, "getting and setting fails: it passes one value for each variable")],
    },
];

pub(crate) fn check(model: &Model<'_>, importers: &[&Importer], report: &mut Report) {
    if model.version != Version::Three {
        return;
    }
    let mut note = |rule: &'static Rule, place: Place, what: &str| {
        let asks = |importer: &Importer| importer.refuses.iter().any(|(asked, _)| asked.id == rule.id);
        let refusing = importers.iter().filter(|importer| asks(importer));
        let refusing: Vec<_> =
            refusing.map(|importer| format!("{} {}", importer.name, importer.versions)).collect();
        if !refusing.is_empty() {
            report.add(rule, place, format!("{what}, refused by {}", refusing.join(", ")));
        }
    };
    for [declared, _] in &model.types {
        // FMPy ignores types of Clocks.
        if declared.has_attribute("description") && declared.tag_name().name() != "ClockType" {
            let name = declared.attribute("name").unwrap_or_default();
            note(&TYPE_DESCRIPTION, model.xml.at(*declared), &format!("the type {name} has a description"));
        }
    }
    for unit in &model.units {
        let mut bases = named(*unit, "BaseUnit");
        if bases.any(|base| base.has_attribute("A") || base.has_attribute("K")) {
            let name = unit.attribute("name").unwrap_or_default();
            note(
                &AMPERE_OR_KELVIN,
                model.xml.at(*unit),
                &format!("the unit {name} has the base unit A or K"),
            );
        }
    }
    for variable in &model.variables {
        let of_type = ["unit", "displayUnit", "nominal", "quantity", "relativeQuantity", "unbounded"];
        if let Some(name) = of_type.into_iter().find(|name| variable.element.has_attribute(*name)) {
            note(&UNIT_OF_VARIABLE, model.at(variable), &format!("it has the attribute {name}"));
        }
        if variable.data_type == DataType::Enumeration {
            note(&ENUMERATION_VARIABLE, model.at(variable), "it is an enumeration");
        }
        if variable.data_type == DataType::Clock {
            note(&CLOCK_VARIABLE, model.at(variable), "it is a clock");
        }
        if named(variable.element, "Dimension").next().is_some() {
            note(&ARRAY, model.at(variable), "it is an array");
        }
        if variable.causality == Causality::StructuralParameter {
            note(&STRUCTURAL_PARAMETER, model.at(variable), "it is a structural parameter");
        }
    }
}
