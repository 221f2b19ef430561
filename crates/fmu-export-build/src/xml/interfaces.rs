//! The interfaces with their capabilities.

use std::io;

use fmu_terms::{Interface, Version, Word};
use fmu_xml::{Attributes, XmlWriter, empty};

use crate::model::Model;

/// What the interfaces share is declared alike in all.
pub(super) fn write(writer: &mut XmlWriter, model: &Model<'_>) -> io::Result<()> {
    let of_version = match model.fmi.version {
        Version::Two => fmi2(model),
        Version::Three => fmi3(model),
    };
    let is_offered = |(interface, _): &(&Interface, _)| model.fmi.interfaces.include(**interface);
    for (interface, capabilities) in Interface::ALL.iter().zip(of_version).filter(is_offered) {
        let mut attributes =
            vec![("modelIdentifier", model.identifier.clone()), ("needsExecutionTool", false.to_string())];
        attributes.extend(capabilities);
        empty(writer, interface.as_str(), attributes)?;
    }
    Ok(())
}

fn flags<const N: usize>(flags: [(&'static str, bool); N]) -> Attributes {
    flags.map(|(name, has)| (name, has.to_string())).into()
}

/// The attributes of Model Exchange and co-simulation in FMI 2.0; the third list, for Scheduled Execution, is empty.
fn fmi2(model: &Model<'_>) -> [Attributes; 3] {
    let has = &model.declaration.capabilities;
    // The runtime does nothing in it.
    let of_model_exchange = flags([("completedIntegratorStepNotNeeded", true)]);
    let of_co_simulation = [
        flags([
            ("canHandleVariableCommunicationStepSize", has.variable_communication_step_size),
            ("canInterpolateInputs", has.interpolate_inputs),
        ]),
        vec![output_derivatives(model)],
        flags([("canRunAsynchronuously", false)]),
    ];
    let common = flags([
        ("canBeInstantiatedOnlyOncePerProcess", false),
        ("canNotUseMemoryManagementFunctions", true),
        ("canGetAndSetFMUstate", has.get_and_set_state),
        ("canSerializeFMUstate", has.serializes_state()),
        ("providesDirectionalDerivative", has.directional_derivatives),
    ]);
    [[of_model_exchange, common.clone()].concat(), [of_co_simulation.concat(), common].concat(), vec![]]
}

/// The attributes of Model Exchange, co-simulation and Scheduled Execution in FMI 3.0.
fn fmi3(model: &Model<'_>) -> [Attributes; 3] {
    let has = &model.declaration.capabilities;
    let common = flags([
        ("canBeInstantiatedOnlyOncePerProcess", false),
        ("canGetAndSetFMUState", has.get_and_set_state),
        ("canSerializeFMUState", has.serializes_state()),
        ("providesDirectionalDerivatives", has.directional_derivatives),
        ("providesAdjointDerivatives", has.adjoint_derivatives),
        ("providesPerElementDependencies", model.has_element_dependencies()),
    ]);
    let has_intermediate_updates = model.declaration.has_intermediate_updates();
    // The runtime does nothing when a step is completed.
    let of_model_exchange = flags([("needsCompletedIntegratorStep", false)]);
    let of_co_simulation = [
        flags([("canHandleVariableCommunicationStepSize", has.variable_communication_step_size)]),
        vec![output_derivatives(model)],
        flags([
            ("mightReturnEarlyFromDoStep", model.declaration.returns_early()),
            ("providesIntermediateUpdate", has_intermediate_updates),
            ("canReturnEarlyAfterIntermediateUpdate", has_intermediate_updates),
            ("hasEventMode", has.event_mode),
        ]),
    ];
    [
        [common.clone(), of_model_exchange].concat(),
        [common.clone(), of_co_simulation.concat()].concat(),
        common,
    ]
}

fn output_derivatives(model: &Model<'_>) -> (&'static str, String) {
    let order = u8::from(model.declaration.capabilities.directional_derivatives);
    ("maxOutputDerivativeOrder", order.to_string())
}
