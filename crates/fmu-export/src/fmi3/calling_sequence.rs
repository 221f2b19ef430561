//! The allowed order of calls: the state machines of FMI 3.0.2, sections 2.3, 3.2 and 4.2, as data.
//!
//! Reconfiguration Mode does not occur: there are no tunable structural parameters.

use crate::calling_sequence::{Interface, Phase, Phases, functions};

use Phase::{
    ClockActivationMode, ConfigurationMode, ContinuousTimeMode, Error, EventMode, InitializationMode,
    Instantiated, IntermediateUpdateMode, StepComplete, StepEventMode, StepFailed, Terminated,
};

/// Any state but Intermediate Update Mode, which lasts for one callback of the importer.
const ANY: Phases = Phases::ALL.without(IntermediateUpdateMode);
/// The states in which values can be read; in the first, these are start values.
const READABLE: Phases = ANY;
/// The states in which continuous variables can be read.
const READABLE_NUMBERS: Phases = Phases::ALL;
/// The states in which values can be set; the standard restricts the variables further.
const WRITABLE: Phases = Phases::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    EventMode,
    ContinuousTimeMode,
    StepEventMode,
    ClockActivationMode,
]);
/// The states in which continuous variables can be set.
const WRITABLE_NUMBERS: Phases = WRITABLE.and(IntermediateUpdateMode);
/// The states in which values of the type of structural parameters can be set.
const CONFIGURABLE: Phases = WRITABLE.and(ConfigurationMode);
/// The states in which derivatives can be read.
const DIFFERENTIABLE: Phases = Phases::of(&[
    InitializationMode,
    StepComplete,
    StepFailed,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
    StepEventMode,
    ClockActivationMode,
]);
/// The states in which a solver can read what it needs.
const SOLVABLE: Phases = Phases::of(&[InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error]);
/// The states in which the sizes of solver data can be read.
const COUNTABLE: Phases = Phases::of(&[Instantiated, EventMode]);
/// The states in which clock intervals can be read and set.
const TIMED: Phases = Phases::of(&[InitializationMode, EventMode, StepEventMode, ClockActivationMode]);
/// Event Mode of all interfaces.
const AT_EVENTS: Phases = Phases::of(&[EventMode, StepEventMode]);

functions! {
    "fmi3";
    None => {
        SetDebugLogging: ANY,
        EnterInitializationMode: [Instantiated],
        ExitInitializationMode: [InitializationMode],
        EnterEventMode: [StepComplete, ContinuousTimeMode],
        Terminate: [StepComplete, StepFailed, EventMode, ContinuousTimeMode, StepEventMode, ClockActivationMode],
        Reset: ANY,
        GetFloat32: READABLE,
        GetFloat64: READABLE_NUMBERS,
        GetInt8: READABLE,
        GetUInt8: READABLE,
        GetInt16: READABLE,
        GetUInt16: READABLE,
        GetInt32: READABLE,
        GetUInt32: READABLE,
        GetInt64: READABLE,
        GetUInt64: READABLE,
        GetBoolean: READABLE,
        GetString: READABLE,
        GetBinary: READABLE,
        // In Scheduled Execution it belongs in Clock Update Mode, but Reference-FMUs' scs_synchronous.c calls it
        // afterwards.
        GetClock: [EventMode, StepEventMode, ClockActivationMode],
        SetFloat32: WRITABLE,
        SetFloat64: WRITABLE_NUMBERS,
        SetInt8: WRITABLE,
        SetUInt8: WRITABLE,
        SetInt16: WRITABLE,
        SetUInt16: WRITABLE,
        SetInt32: WRITABLE,
        SetUInt32: WRITABLE,
        SetInt64: WRITABLE,
        SetUInt64: CONFIGURABLE,
        SetBoolean: WRITABLE,
        SetString: WRITABLE,
        SetBinary: WRITABLE,
        SetClock: AT_EVENTS,
        GetNumberOfVariableDependencies: ANY,
        GetVariableDependencies: ANY,
        GetFMUState: ANY,
        SetFMUState: ANY,
        FreeFMUState: ANY,
        SerializedFMUStateSize: ANY,
        SerializeFMUState: ANY,
        DeserializeFMUState: ANY,
        GetDirectionalDerivative: DIFFERENTIABLE,
        GetAdjointDerivative: DIFFERENTIABLE,
        EnterConfigurationMode: [Instantiated],
        ExitConfigurationMode: [ConfigurationMode],
        GetIntervalDecimal: TIMED,
        GetIntervalFraction: TIMED,
        GetShiftDecimal: [InitializationMode],
        GetShiftFraction: [InitializationMode],
        SetIntervalDecimal: TIMED,
        SetIntervalFraction: TIMED,
        SetShiftDecimal: [InitializationMode],
        SetShiftFraction: [InitializationMode],
        EvaluateDiscreteStates: AT_EVENTS,
        UpdateDiscreteStates: AT_EVENTS,
    }
    Some(Interface::ModelExchange) => {
        EnterContinuousTimeMode: [EventMode],
        CompletedIntegratorStep: [ContinuousTimeMode],
        SetTime: [ContinuousTimeMode],
        SetContinuousStates: [ContinuousTimeMode],
        GetContinuousStateDerivatives: SOLVABLE,
        GetEventIndicators: SOLVABLE,
        GetContinuousStates: SOLVABLE,
        GetNominalsOfContinuousStates: SOLVABLE,
        GetNumberOfEventIndicators: COUNTABLE,
        GetNumberOfContinuousStates: COUNTABLE,
    }
    Some(Interface::CoSimulation) => {
        EnterStepMode: [StepEventMode],
        GetOutputDerivatives: [StepComplete, StepFailed, Terminated, Error, IntermediateUpdateMode],
        DoStep: [StepComplete],
    }
    Some(Interface::ScheduledExecution) => {
        ActivateModelPartition: [ClockActivationMode],
    };
    const VALUE_REFERENCES: &'static str = "valueReferences";
    const VALUES: &'static str = "values";
    // Section 2.2.4: the simulation must not be continued.
    const AFTER_ERROR: Option<Phase> = Some(Error);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_of_an_interface_are_called_in_its_states() {
        crate::calling_sequence::check_interfaces(Function::ALL);
    }

    #[test]
    fn there_are_75_functions() {
        // GetVersion, three instantiation functions and FreeInstance take no part in the calling sequence.
        assert_eq!(Function::ALL.len() + 5, 75);
    }
}
