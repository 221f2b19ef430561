//! The modelDescription.xml of FMI 2.0, in the order of fmi2ModelDescription.xsd.

use std::io;

use quick_xml::events::{BytesText, Event};

use super::{
    causality, given, initial, start, variability, write_experiment, write_log_categories, write_units,
};
use crate::declaration::Declaration;
use crate::dependencies::{Structure, Unknown};
use crate::model::{DataType, Model, Scalar};
use fmu_xml::{Attributes, XmlWriter, document, element, empty, float};

pub(super) fn write(model: &Model<'_>, structure: &Structure, guid: &str) -> String {
    let declaration = model.declaration;
    let mut attributes = super::identity(model, "2.0", ("guid", guid));
    if model.fmi.interfaces.model_exchange() {
        attributes.push(("numberOfEventIndicators", declaration.event_indicators.len().to_string()));
    }
    document(|writer| {
        element(writer, "fmiModelDescription", attributes, |writer| {
            if model.fmi.interfaces.model_exchange() {
                write_model_exchange(writer, model)?;
            }
            if model.fmi.interfaces.co_simulation() {
                write_co_simulation(writer, model)?;
            }
            write_units(writer, model)?;
            write_types(writer, declaration)?;
            write_log_categories(writer, model)?;
            write_experiment(writer, declaration)?;
            element(writer, "ModelVariables", vec![], |writer| {
                (0..model.scalars.len()).try_for_each(|position| write_variable(writer, model, position))
            })?;
            write_structure(writer, structure)
        })
    })
}

/// What the interfaces share is declared alike in both.
fn write_model_exchange(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let capabilities = &model.declaration.capabilities;
    let attributes = vec![
        ("modelIdentifier", model.identifier.clone()),
        ("needsExecutionTool", false.to_string()),
        // The runtime does nothing in it.
        ("completedIntegratorStepNotNeeded", true.to_string()),
        ("canBeInstantiatedOnlyOncePerProcess", false.to_string()),
        ("canNotUseMemoryManagementFunctions", true.to_string()),
        ("canGetAndSetFMUstate", capabilities.get_and_set_state.to_string()),
        ("canSerializeFMUstate", capabilities.serializes_state().to_string()),
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
        ("canSerializeFMUstate", capabilities.serializes_state().to_string()),
        ("providesDirectionalDerivative", capabilities.directional_derivatives.to_string()),
    ];
    empty(writer, "CoSimulation", attributes)
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
                element(writer, "Enumeration", vec![], |writer| super::write_items(writer, enumeration))
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

/// The element named after a variable's type, with its attributes in the order of the schema.
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
            // The checks allow only integers here, and `Display` prints them without a fraction.
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
        DataType::Float32 | DataType::Whole(_) | DataType::Binary | DataType::Clock => {
            unreachable!("the checks refuse types that FMI 2.0 does not have")
        }
    };
    attributes.extend(scalar.start.as_ref().map(|value| ("start", start(value))));
    attributes.extend(scalar.state.map(|state| ("derivative", index(state).to_string())));
    // The standard has it for Model Exchange only (section 2.2.7).
    if scalar.reinit && model.fmi.interfaces.model_exchange() {
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
        // The schema has no empty lists.
        lists.into_iter().filter(|(_, unknowns)| !unknowns.is_empty()).try_for_each(|(name, unknowns)| {
            element(writer, name, vec![], |writer| {
                unknowns.iter().try_for_each(|unknown| write_unknown(writer, unknown))
            })
        })
    })
}

/// An empty dependency list is written, too: without one the variable depends on everything.
fn write_unknown(writer: &mut XmlWriter, unknown: &Unknown) -> io::Result<()> {
    let indices = |positions: &[usize]| {
        let indices: Vec<_> = positions.iter().map(|&position| index(position).to_string()).collect();
        indices.join(" ")
    };
    let attributes = [
        ("index", Some(index(unknown.scalar).to_string())),
        ("dependencies", unknown.dependencies.as_deref().map(indices)),
    ];
    empty(writer, "Unknown", given(attributes))
}

/// FMI numbers variables from 1 in `ModelStructure`, whatever their value references.
fn index(position: usize) -> usize {
    position + 1
}
