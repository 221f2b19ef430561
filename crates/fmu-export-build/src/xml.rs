//! The modelDescription.xml, written element by element in the order of fmi2ModelDescription.xsd.
//!
//! The same model gives the same bytes: nothing depends on the time or on the order of a hash map, so
//! the GUID, a hash of these bytes, changes exactly when the interface does.

use std::io;

use quick_xml::events::{BytesText, Event};
use uuid::Uuid;

use crate::declaration::{Causality, Declaration, Described, Initial, Variability};
use crate::dependencies::{Structure, Unknown};
use crate::model::{DataType, Model, Scalar, Start};
use fmu_xml::{Attributes, XmlWriter, conversion, document, element, empty, float};

/// What made the FMU.
pub(crate) const GENERATION_TOOL: &str = concat!("fmu-export ", env!("CARGO_PKG_VERSION"));

/// A modelDescription.xml and the GUID in it.
pub(crate) struct Description {
    pub(crate) guid: String,
    pub(crate) text: String,
}

impl Description {
    pub(crate) fn new(model: &Model<'_>, structure: &Structure) -> Self {
        let without_guid = write(model, structure, "");
        let guid = format!("{{{}}}", Uuid::new_v5(&Uuid::NAMESPACE_OID, without_guid.as_bytes()));
        let text = write(model, structure, &guid);
        Self { guid, text }
    }
}

fn write(model: &Model<'_>, structure: &Structure, guid: &str) -> String {
    let declaration = model.declaration;
    let attributes = [
        ("fmiVersion", Some("2.0".to_owned())),
        ("modelName", Some(model.identifier.clone())),
        ("guid", Some(guid.to_owned())),
        ("description", model.description.clone()),
        ("author", model.author.clone()),
        ("version", Some(model.version.to_owned())),
        ("copyright", declaration.copyright.clone()),
        ("license", model.license.clone()),
        ("generationTool", Some(GENERATION_TOOL.to_owned())),
        ("variableNamingConvention", Some("structured".to_owned())),
        (
            "numberOfEventIndicators",
            model.interfaces.model_exchange().then(|| declaration.event_indicators.len().to_string()),
        ),
    ];
    let attributes = given(attributes);
    document(|writer| {
        element(writer, "fmiModelDescription", attributes, |writer| {
            if model.interfaces.model_exchange() {
                write_model_exchange(writer, model)?;
            }
            if model.interfaces.co_simulation() {
                write_co_simulation(writer, model)?;
            }
            write_units(writer, model)?;
            write_types(writer, declaration)?;
            element(writer, "LogCategories", vec![], |writer| {
                model
                    .log_categories
                    .iter()
                    .try_for_each(|category| empty(writer, "Category", described(category)))
            })?;
            if let Some(experiment) = &declaration.default_experiment {
                let attributes = given([
                    ("startTime", experiment.start_time.map(float)),
                    ("stopTime", experiment.stop_time.map(float)),
                    ("stepSize", experiment.step_size.map(float)),
                ]);
                empty(writer, "DefaultExperiment", attributes)?;
            }
            element(writer, "ModelVariables", vec![], |writer| {
                (0..model.scalars.len()).try_for_each(|position| write_variable(writer, model, position))
            })?;
            write_structure(writer, structure)
        })
    })
}

/// The attributes that have a value.
fn given<const N: usize>(attributes: [(&'static str, Option<String>); N]) -> Attributes {
    attributes.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
}

/// What the interfaces have in common is declared alike in both.
fn write_model_exchange(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let capabilities = &model.declaration.capabilities;
    let attributes = vec![
        ("modelIdentifier", model.identifier.clone()),
        ("needsExecutionTool", false.to_string()),
        // The runtime finds nothing out in it.
        ("completedIntegratorStepNotNeeded", true.to_string()),
        ("canBeInstantiatedOnlyOncePerProcess", false.to_string()),
        ("canNotUseMemoryManagementFunctions", true.to_string()),
        ("canGetAndSetFMUstate", capabilities.get_and_set_state.to_string()),
        ("canSerializeFMUstate", capabilities.serialize_state.to_string()),
        ("providesDirectionalDerivative", capabilities.directional_derivatives.to_string()),
    ];
    empty(writer, "ModelExchange", attributes)
}

fn write_co_simulation(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let capabilities = &model.declaration.capabilities;
    let attributes = vec![
        ("modelIdentifier", model.identifier.clone()),
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
                // Also those of the file that no variable asks for: importers let their users choose among them.
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

fn write_types(writer: &mut XmlWriter, declaration: &Declaration) -> io::Result<()> {
    if declaration.enumerations.is_empty() {
        return Ok(());
    }
    element(writer, "TypeDefinitions", vec![], |writer| {
        declaration.enumerations.iter().try_for_each(|enumeration| {
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

fn write_variable(writer: &mut XmlWriter, model: &Model<'_>, position: usize) -> io::Result<()> {
    let scalar = &model.scalars[position];
    writer.write_event(Event::Comment(BytesText::new(&format!(" index {} ", index(position)))))?;
    let attributes = given([
        ("name", Some(scalar.name.clone())),
        ("valueReference", Some(scalar.value_reference.to_string())),
        ("description", scalar.description.clone()),
        ("causality", Some(causality(scalar.causality).to_owned())),
        ("variability", Some(variability(scalar.variability).to_owned())),
        ("initial", scalar.initial.map(|value| initial(value).to_owned())),
    ]);
    element(writer, "ScalarVariable", attributes, |writer| {
        let (name, attributes) = type_element(model, scalar);
        empty(writer, name, attributes)
    })
}

/// The element that names a variable's type, with its attributes in the order of the schema.
fn type_element(model: &Model<'_>, scalar: &Scalar) -> (&'static str, Attributes) {
    let mut attributes = Vec::new();
    let name = match scalar.data_type {
        DataType::Real => {
            attributes.extend(scalar.unit.clone().map(|unit| ("unit", unit)));
            attributes.extend(scalar.display_unit.clone().map(|unit| ("displayUnit", unit)));
            attributes.extend(scalar.min.map(|min| ("min", float(min))));
            attributes.extend(scalar.max.map(|max| ("max", float(max))));
            attributes.extend(scalar.nominal.map(|nominal| ("nominal", float(nominal))));
            "Real"
        }
        DataType::Integer => {
            // The checks let whole numbers through only, and `Display` prints them without a fraction.
            attributes.extend(scalar.min.map(|min| ("min", min.to_string())));
            attributes.extend(scalar.max.map(|max| ("max", max.to_string())));
            "Integer"
        }
        DataType::Boolean => "Boolean",
        DataType::String => "String",
        DataType::Enumeration(enumeration) => {
            attributes.push(("declaredType", model.declaration.enumerations[enumeration].name.clone()));
            "Enumeration"
        }
    };
    attributes.extend(scalar.start.as_ref().map(|value| ("start", start(value))));
    attributes.extend(scalar.state.map(|state| ("derivative", index(state).to_string())));
    // The standard has it for Model Exchange alone (section 2.2.7).
    if scalar.reinit && model.interfaces.model_exchange() {
        attributes.push(("reinit", true.to_string()));
    }
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

/// An empty list of dependencies is written as well: without one the variable depends on all.
fn write_unknown(writer: &mut XmlWriter, unknown: &Unknown) -> io::Result<()> {
    let indices = |positions: &Vec<usize>| {
        let indices: Vec<_> = positions.iter().map(|&position| index(position).to_string()).collect();
        indices.join(" ")
    };
    let attributes = [
        ("index", Some(index(unknown.scalar).to_string())),
        ("dependencies", unknown.dependencies.as_ref().map(indices)),
    ];
    empty(writer, "Unknown", given(attributes))
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

pub(crate) fn causality(causality: Option<Causality>) -> &'static str {
    match causality {
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
