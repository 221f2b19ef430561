//! The modelDescription.xml, written element by element in the order of fmi2ModelDescription.xsd.
//!
//! The same model gives the same bytes: nothing depends on the time or on the order of a hash map, so
//! the GUID, a hash of these bytes, changes exactly when the interface does.

use std::io;

use quick_xml::events::{BytesText, Event};
use uuid::Uuid;

use super::dependencies::{Structure, Unknown};
use super::json::{self, Causality, Initial, Variability};
use super::resolve::{DataType, Resolved, Role, Start, Variable};
use fmu_xml::{Attributes, XmlWriter, conversion, document, element, empty, float};

/// What made the FMU.
pub(crate) const GENERATION_TOOL: &str = concat!("fmu-export ", env!("CARGO_PKG_VERSION"));

/// A modelDescription.xml and the GUID in it.
pub(crate) struct Description {
    pub(crate) guid: String,
    pub(crate) text: String,
}

impl Description {
    pub(crate) fn new(model: &Resolved<'_>, structure: &Structure) -> Self {
        let without_guid = write(model, structure, "");
        let guid = format!("{{{}}}", Uuid::new_v5(&Uuid::NAMESPACE_OID, without_guid.as_bytes()));
        let text = write(model, structure, &guid);
        Self { guid, text }
    }
}

fn write(resolved: &Resolved<'_>, structure: &Structure, guid: &str) -> String {
    let model = resolved.model;
    let attributes = vec![
        ("fmiVersion", "2.0".to_owned()),
        ("modelName", model.model_identifier.clone()),
        ("guid", guid.to_owned()),
        ("description", model.description.clone()),
        ("author", model.author.clone()),
        ("version", resolved.version.to_owned()),
        ("copyright", model.copyright.clone()),
        ("license", model.license.clone()),
        ("generationTool", GENERATION_TOOL.to_owned()),
        ("variableNamingConvention", "structured".to_owned()),
    ];
    document(|writer| {
        element(writer, "fmiModelDescription", attributes, |writer| {
            write_co_simulation(writer, model)?;
            write_units(writer, resolved)?;
            write_types(writer, model)?;
            element(writer, "LogCategories", vec![], |writer| {
                model
                    .log_categories
                    .iter()
                    .try_for_each(|category| empty(writer, "Category", described(category)))
            })?;
            let experiment = &model.default_experiment;
            let attributes = vec![
                ("startTime", float(experiment.start_time)),
                ("stopTime", float(experiment.stop_time)),
                ("stepSize", float(experiment.step_size)),
            ];
            empty(writer, "DefaultExperiment", attributes)?;
            element(writer, "ModelVariables", vec![], |writer| {
                (0..resolved.variables.len())
                    .try_for_each(|position| write_variable(writer, resolved, position))
            })?;
            write_structure(writer, structure)
        })
    })
}

fn write_co_simulation(writer: &mut XmlWriter, model: &json::Model) -> io::Result<()> {
    let capabilities = &model.capabilities;
    let attributes = vec![
        ("modelIdentifier", model.model_identifier.clone()),
        ("needsExecutionTool", false.to_string()),
        ("canHandleVariableCommunicationStepSize", capabilities.variable_communication_step_size.to_string()),
        ("canInterpolateInputs", capabilities.interpolate_inputs.to_string()),
        ("maxOutputDerivativeOrder", u8::from(capabilities.directional_derivatives).to_string()),
        ("canRunAsynchronuously", false.to_string()),
        ("canBeInstantiatedOnlyOncePerProcess", false.to_string()),
        ("canNotUseMemoryManagementFunctions", true.to_string()),
        ("canGetAndSetFMUstate", capabilities.get_and_set_state.to_string()),
        ("canSerializeFMUstate", capabilities.serialize_state.to_string()),
        ("providesDirectionalDerivative", capabilities.directional_derivatives.to_string()),
    ];
    empty(writer, "CoSimulation", attributes)
}

fn write_units(writer: &mut XmlWriter, model: &Resolved<'_>) -> io::Result<()> {
    element(writer, "UnitDefinitions", vec![], |writer| {
        for unit in &model.units {
            let name = vec![("name", unit.name.clone())];
            if unit.base.is_none() && unit.display_units.is_empty() {
                empty(writer, "Unit", name)?;
                continue;
            }
            element(writer, "Unit", name, |writer| {
                if let Some(base) = &unit.base {
                    let exponents = base.iter().filter(|(_, exponent)| **exponent != 0);
                    let mut attributes: Attributes =
                        exponents.map(|(unit, exponent)| (unit.symbol(), exponent.to_string())).collect();
                    attributes.extend(conversion(unit.factor, unit.offset));
                    empty(writer, "BaseUnit", attributes)?;
                }
                // Also those that no variable asks for: importers let their users choose among them.
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

fn write_types(writer: &mut XmlWriter, model: &json::Model) -> io::Result<()> {
    if model.enumerations.is_empty() {
        return Ok(());
    }
    element(writer, "TypeDefinitions", vec![], |writer| {
        model.enumerations.iter().try_for_each(|enumeration| {
            let attributes =
                vec![("name", enumeration.name.clone()), ("description", enumeration.description.clone())];
            element(writer, "SimpleType", attributes, |writer| {
                element(writer, "Enumeration", vec![], |writer| {
                    enumeration.items.iter().zip(1..).try_for_each(|(item, value): (_, i32)| {
                        let attributes = vec![
                            ("name", item.name.clone()),
                            ("value", value.to_string()),
                            ("description", item.description.clone()),
                        ];
                        empty(writer, "Item", attributes)
                    })
                })
            })
        })
    })
}

fn write_variable(writer: &mut XmlWriter, model: &Resolved<'_>, position: usize) -> io::Result<()> {
    let variable = &model.variables[position];
    writer.write_event(Event::Comment(BytesText::new(&format!(" index {} ", index(position)))))?;
    let mut attributes = vec![
        ("name", variable.name.clone()),
        ("valueReference", position.to_string()),
        ("description", variable.description.clone()),
        ("causality", causality(variable.role).to_owned()),
        ("variability", variability(variable.variability).to_owned()),
    ];
    attributes.extend(variable.initial.map(|value| ("initial", initial(value).to_owned())));
    element(writer, "ScalarVariable", attributes, |writer| {
        let (name, attributes) = type_element(model, variable);
        empty(writer, name, attributes)
    })
}

/// The element that names a variable's type, with its attributes in the order of the schema.
fn type_element(model: &Resolved<'_>, variable: &Variable) -> (&'static str, Attributes) {
    let mut attributes = Vec::new();
    let name = match variable.data_type {
        DataType::Real => {
            attributes.extend(variable.unit.clone().map(|unit| ("unit", unit)));
            attributes.extend(variable.display_unit.clone().map(|unit| ("displayUnit", unit)));
            attributes.extend(variable.min.map(|min| ("min", float(min))));
            attributes.extend(variable.max.map(|max| ("max", float(max))));
            attributes.extend(variable.nominal.map(|nominal| ("nominal", float(nominal))));
            "Real"
        }
        DataType::Integer => {
            // The checks let whole numbers through only, and `Display` prints them without a fraction.
            attributes.extend(variable.min.map(|min| ("min", min.to_string())));
            attributes.extend(variable.max.map(|max| ("max", max.to_string())));
            "Integer"
        }
        DataType::Boolean => "Boolean",
        DataType::String => "String",
        DataType::Enumeration(enumeration) => {
            attributes.push(("declaredType", model.model.enumerations[enumeration].name.clone()));
            "Enumeration"
        }
    };
    attributes.extend(variable.start.as_ref().map(|value| ("start", start(value))));
    attributes.extend(variable.state.map(|state| ("derivative", index(state).to_string())));
    (name, attributes)
}

fn write_structure(writer: &mut XmlWriter, structure: &Structure) -> io::Result<()> {
    let lists = [
        ("Outputs", &structure.outputs),
        ("Derivatives", &structure.derivatives),
        ("InitialUnknowns", &structure.initial_unknowns),
    ];
    element(writer, "ModelStructure", vec![], |writer| {
        // The schema knows no empty list.
        lists.into_iter().filter(|(_, unknowns)| !unknowns.is_empty()).try_for_each(|(name, unknowns)| {
            element(writer, name, vec![], |writer| {
                unknowns.iter().try_for_each(|unknown| write_unknown(writer, unknown))
            })
        })
    })
}

/// An empty list of dependencies is written as well: without it the variable would depend on all.
fn write_unknown(writer: &mut XmlWriter, unknown: &Unknown) -> io::Result<()> {
    let dependencies: Vec<_> =
        unknown.dependencies.iter().map(|&position| index(position).to_string()).collect();
    let attributes =
        vec![("index", index(unknown.variable).to_string()), ("dependencies", dependencies.join(" "))];
    empty(writer, "Unknown", attributes)
}

/// FMI counts variables from 1 in `ModelStructure`, whatever their value references.
fn index(position: usize) -> usize {
    position + 1
}

pub(crate) fn start(start: &Start) -> String {
    match start {
        Start::Real(value) => float(*value),
        Start::Integer(value) => value.to_string(),
        Start::Boolean(value) => value.to_string(),
        Start::String(value) => value.clone(),
        Start::Item(item) => (item + 1).to_string(),
    }
}

fn causality(role: Role) -> &'static str {
    match role.causality() {
        None => "independent",
        Some(Causality::Parameter) => "parameter",
        Some(Causality::CalculatedParameter) => "calculatedParameter",
        Some(Causality::Input) => "input",
        Some(Causality::Output) => "output",
        Some(Causality::Local) => "local",
    }
}

pub(crate) fn variability(variability: Variability) -> &'static str {
    match variability {
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

fn described(described: &json::Described) -> Attributes {
    vec![("name", described.name.clone()), ("description", described.description.clone())]
}
