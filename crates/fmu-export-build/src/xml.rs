//! The modelDescription.xml, written element by element in the order of its schema.
//!
//! The same model gives the same bytes: nothing depends on time or a hash map's order, so the GUID, a hash of these
//! bytes, changes exactly when the interface does.

mod fmi2;
mod fmi3;
pub(crate) mod terminals;

use std::fmt::Write as _;
use std::io;

use uuid::Uuid;

use crate::declaration::{Causality, Declaration, Described, EnumerationDeclaration, Initial, Variability};
use crate::dependencies::Structure;
use crate::interfaces::Version;
use crate::model::{Model, Start};
use fmu_xml::{Attributes, XmlWriter, conversion, element, empty, float};

/// The tool that made the FMU.
pub(crate) const GENERATION_TOOL: &str = concat!("fmu-export ", env!("CARGO_PKG_VERSION"));

/// A modelDescription.xml and its GUID, called instantiation token in FMI 3.0.
pub(crate) struct Description {
    pub(crate) guid: String,
    pub(crate) text: String,
}

impl Description {
    pub(crate) fn new(model: &Model<'_>, structure: &Structure) -> Self {
        let write = match model.fmi.version {
            Version::Two => fmi2::write,
            Version::Three => fmi3::write,
        };
        let without_guid = write(model, structure, "");
        let guid = format!("{{{}}}", Uuid::new_v5(&Uuid::NAMESPACE_OID, without_guid.as_bytes()));
        let text = write(model, structure, &guid);
        Self { guid, text }
    }
}

/// The attributes that have a value.
fn given<const N: usize>(attributes: [(&'static str, Option<String>); N]) -> Attributes {
    attributes.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

fn write_units(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    element(writer, "UnitDefinitions", vec![], |writer| {
        for unit in &model.units {
            let name = vec![("name", unit.name.clone())];
            if unit.base.is_none() && unit.display_units.is_empty() {
                empty(writer, "Unit", name)?;
                continue;
            }
            element(writer, "Unit", name, |writer| {
                if let Some(base) = &unit.base {
                    let mut attributes: Attributes =
                        base.iter().map(|(unit, exponent)| (unit.symbol(), exponent.to_string())).collect();
                    attributes.extend(conversion(unit.factor, unit.offset));
                    empty(writer, "BaseUnit", attributes)?;
                }
                // Including those in the file that no variable uses: importers offer them to their users.
                unit.display_units.iter().try_for_each(|display| {
                    let mut attributes = vec![("name", display.name.clone())];
                    attributes.extend(conversion(display.factor, display.offset));
                    empty(writer, "DisplayUnit", attributes)
                })
            })?;
        }
        Ok(())
    })
}

/// The root's attributes: the model's identity, and the version's own attribute for its hash.
fn identity(model: &Model<'_>, version: &str, (hash, value): (&'static str, &str)) -> Attributes {
    given([
        ("fmiVersion", Some(version.to_owned())),
        ("modelName", Some(model.identifier.clone())),
        (hash, Some(value.to_owned())),
        ("description", model.description.clone()),
        ("author", model.author.clone()),
        ("version", Some(model.version.to_owned())),
        ("copyright", model.declaration.copyright.clone()),
        ("license", model.license.clone()),
        ("generationTool", Some(GENERATION_TOOL.to_owned())),
        ("variableNamingConvention", Some("structured".to_owned())),
    ])
}

fn write_items(writer: &mut XmlWriter, enumeration: &EnumerationDeclaration) -> io::Result<()> {
    enumeration.items.iter().zip(1..).try_for_each(|(item, value): (_, i32)| {
        let attributes = vec![
            ("name", item.name.clone()),
            ("value", value.to_string()),
            ("description", item.description.clone()),
        ];
        empty(writer, "Item", attributes)
    })
}

fn write_log_categories(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    element(writer, "LogCategories", vec![], |writer| {
        model.log_categories.iter().try_for_each(|category| empty(writer, "Category", described(category)))
    })
}

fn write_experiment(writer: &mut XmlWriter, declaration: &Declaration) -> io::Result<()> {
    let Some(experiment) = &declaration.default_experiment else { return Ok(()) };
    let attributes = given([
        ("startTime", experiment.start_time.map(float)),
        ("stopTime", experiment.stop_time.map(float)),
        ("stepSize", experiment.step_size.map(float)),
    ]);
    empty(writer, "DefaultExperiment", attributes)
}

pub(crate) fn start(start: &Start) -> String {
    match start {
        Start::Real(value) => float(*value),
        Start::Integer(value) => value.to_string(),
        Start::Boolean(value) => value.to_string(),
        Start::String(value) => value.clone(),
        Start::Binary(bytes) => bytes.iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        }),
        Start::Item(item) => (item + 1).to_string(),
    }
}

pub(crate) fn causality(causality: Option<Causality>) -> &'static str {
    match causality {
        None => "independent",
        Some(Causality::Parameter) => "parameter",
        Some(Causality::StructuralParameter) => "structuralParameter",
        Some(Causality::CalculatedParameter) => "calculatedParameter",
        Some(Causality::Input) => "input",
        Some(Causality::Output) => "output",
        Some(Causality::Local) => "local",
    }
}

pub(crate) fn variability(variability: Variability) -> &'static str {
    match variability {
        Variability::Constant => "constant",
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

pub(crate) fn initial(initial: Initial) -> &'static str {
    match initial {
        Initial::Exact => "exact",
        Initial::Approx => "approx",
        Initial::Calculated => "calculated",
    }
}

fn described(described: &Described) -> Attributes {
    vec![("name", described.name.clone()), ("description", described.description.clone())]
}
