//! The modelDescription.xml, written element by element in the order of its version's schema.
//!
//! The same model gives the same bytes: nothing depends on time or a hash map's order, so the GUID, a hash of these
//! bytes, changes exactly when the interface does.

mod interfaces;
pub(crate) mod terminals;
pub(crate) mod variables;

use std::io;

use fmu_terms::{Precision, Version};
use fmu_xml::{Attributes, XmlWriter, base_unit, conversion, document, element, empty, float, given};
use uuid::Uuid;

use crate::declaration::{Declaration, Described};
use crate::dependencies::Structure;
use crate::model::Model;
use variables::{Variables, real_type_attributes};

/// The tool that made the FMU.
pub(crate) const GENERATION_TOOL: &str = concat!("fmu-export ", env!("CARGO_PKG_VERSION"));

/// A modelDescription.xml and its GUID, called instantiation token in FMI 3.0.
pub(crate) struct Description {
    pub(crate) guid: String,
    pub(crate) text: String,
}

impl Description {
    pub(crate) fn new(model: &Model<'_>, structure: &Structure) -> Self {
        let mut hashed = write(model, structure, "");
        if model.is_single_precision {
            // It computes something else, and its saved states are others.
            hashed.push_str(Precision::Single.as_str());
        }
        let guid = format!("{{{}}}", Uuid::new_v5(&Uuid::NAMESPACE_OID, hashed.as_bytes()));
        let text = write(model, structure, &guid);
        Self { guid, text }
    }
}

fn write(model: &Model<'_>, structure: &Structure, guid: &str) -> String {
    let Model { declaration, fmi, .. } = model;
    let (version, hash) = match fmi.version {
        Version::Two => ("2.0", "guid"),
        Version::Three => ("3.0", "instantiationToken"),
    };
    let counts_indicators = fmi.version == Version::Two && fmi.interfaces.model_exchange();
    let convention = if model.flat_name().is_none() { "structured" } else { "flat" };
    let identity = given([
        ("fmiVersion", Some(version.to_owned())),
        ("modelName", Some(model.identifier.clone())),
        (hash, Some(guid.to_owned())),
        ("description", model.description.clone()),
        ("author", model.author.clone()),
        ("version", Some(model.version.to_owned())),
        ("copyright", declaration.copyright.clone()),
        ("license", model.license.clone()),
        ("generationTool", Some(GENERATION_TOOL.to_owned())),
        ("variableNamingConvention", Some(convention.to_owned())),
        (
            "numberOfEventIndicators",
            counts_indicators.then(|| declaration.event_indicators.len().to_string()),
        ),
    ]);
    let variables = Variables::new(model);
    document(|writer| {
        element(writer, "fmiModelDescription", identity, |writer| {
            interfaces::write(writer, model)?;
            write_units(writer, model)?;
            write_types(writer, model)?;
            write_log_categories(writer, model)?;
            write_experiment(writer, declaration)?;
            element(writer, "ModelVariables", vec![], |writer| variables.write_all(writer))?;
            element(writer, "ModelStructure", vec![], |writer| variables.write_structure(writer, structure))
        })
    })
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
                    empty(writer, "BaseUnit", base_unit(base.powers(), base.factor, base.offset))?;
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

fn write_types(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let Declaration { real_types, enumerations, .. } = model.declaration;
    if real_types.is_empty() && enumerations.is_empty() {
        return Ok(());
    }
    element(writer, "TypeDefinitions", vec![], |writer| {
        real_types.iter().try_for_each(|known| {
            let common =
                given([("name", Some(known.name.clone())), ("description", known.description.clone())]);
            let inherited = real_type_attributes(known);
            match model.fmi.version {
                Version::Two => {
                    element(writer, "SimpleType", common, |writer| empty(writer, "Real", inherited))
                }
                Version::Three => empty(writer, "Float64Type", [common, inherited].concat()),
            }
        })?;
        enumerations.iter().try_for_each(|enumeration| {
            let items = |writer: &mut XmlWriter| {
                enumeration.valued().try_for_each(|(item, value)| {
                    let attributes = given([
                        ("name", Some(item.name.clone())),
                        ("value", Some(value.to_string())),
                        ("description", item.description.clone()),
                    ]);
                    empty(writer, "Item", attributes)
                })
            };
            let (name, description) = (Some(enumeration.name.clone()), enumeration.description.clone());
            let attributes = given([("name", name), ("description", description)]);
            match model.fmi.version {
                Version::Two => element(writer, "SimpleType", attributes, |writer| {
                    element(writer, "Enumeration", vec![], items)
                }),
                Version::Three => element(writer, "EnumerationType", attributes, items),
            }
        })
    })
}

fn write_log_categories(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    element(writer, "LogCategories", vec![], |writer| {
        model.log_categories.iter().try_for_each(|Described { name, description }| {
            empty(writer, "Category", described(name, description))
        })
    })
}

fn write_experiment(writer: &mut XmlWriter, declaration: &Declaration) -> io::Result<()> {
    let Some(experiment) = &declaration.default_experiment else { return Ok(()) };
    let attributes = given([
        ("startTime", experiment.start_time.map(float)),
        ("stopTime", experiment.stop_time.map(float)),
        ("tolerance", experiment.tolerance.map(float)),
        ("stepSize", experiment.step_size.map(float)),
    ]);
    empty(writer, "DefaultExperiment", attributes)
}

fn described(name: &str, description: &str) -> Attributes {
    vec![("name", name.to_owned()), ("description", description.to_owned())]
}
