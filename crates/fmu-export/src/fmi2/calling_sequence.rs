//! The allowed order of calls: the state machines of FMI 2.0.5, sections 3.2.3 and 4.2.4, as data.
//!
//! The states `stepInProgress` and `stepCanceled` of the standard do not occur, because steps are never asynchronous.
//! The state `fatal` does not occur, because an error never affects another instance.

use crate::calling_sequence::{Interface, Phase, Phases, functions};

use Phase::{
    ContinuousTimeMode, Error, EventMode, InitializationMode, Instantiated, StepComplete, StepFailed,
    Terminated,
};

/// Any state.
const ANY: Phases = Phases::ALL;
/// The states in which values can be read.
const READABLE: Phases = Phases::of(&[
    InitializationMode,
    StepComplete,
    StepFailed,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// The states in which values can be set; the standard restricts the variables further.
const WRITABLE: Phases =
    Phases::of(&[Instantiated, InitializationMode, StepComplete, EventMode, ContinuousTimeMode]);
/// The states in which a step's status can be read.
const STEPPED: Phases = Phases::of(&[StepComplete, StepFailed, Terminated]);
/// The states in which a solver can read what it needs.
const SOLVABLE: Phases = Phases::of(&[InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error]);

functions! {
    "fmi2";
    None => {
        SetDebugLogging: ANY,
        SetupExperiment: [Instantiated],
        EnterInitializationMode: [Instantiated],
        ExitInitializationMode: [InitializationMode],
        Terminate: [StepComplete, StepFailed, EventMode, ContinuousTimeMode],
        Reset: ANY,
        GetReal: READABLE,
        GetInteger: READABLE,
        GetBoolean: READABLE,
        GetString: READABLE,
        SetReal: WRITABLE,
        SetInteger: WRITABLE,
        SetBoolean: WRITABLE,
        SetString: WRITABLE,
        GetFMUstate: ANY,
        SetFMUstate: ANY,
        FreeFMUstate: ANY,
        SerializedFMUstateSize: ANY,
        SerializeFMUstate: ANY,
        DeSerializeFMUstate: ANY,
        GetDirectionalDerivative: READABLE,
    }
    Some(Interface::CoSimulation) => {
        SetRealInputDerivatives: [Instantiated, InitializationMode, StepComplete],
        GetRealOutputDerivatives: [StepComplete, StepFailed, Terminated, Error],
        DoStep: [StepComplete],
        CancelStep: [],
        GetStatus: STEPPED,
        GetRealStatus: STEPPED,
        GetIntegerStatus: STEPPED,
        GetBooleanStatus: STEPPED,
        GetStringStatus: STEPPED,
    }
    Some(Interface::ModelExchange) => {
        EnterEventMode: [EventMode, ContinuousTimeMode],
        NewDiscreteStates: [EventMode],
        EnterContinuousTimeMode: [EventMode],
        CompletedIntegratorStep: [ContinuousTimeMode],
        // Event Mode is for a model without states, which need not leave it.
        SetTime: [EventMode, ContinuousTimeMode],
        SetContinuousStates: [ContinuousTimeMode],
        GetDerivatives: SOLVABLE,
        GetEventIndicators: SOLVABLE,
        GetContinuousStates: SOLVABLE,
        GetNominalsOfContinuousStates: [Instantiated, InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error],
    };
    const VALUE_REFERENCES: &'static str = "vr";
    const VALUES: &'static str = "value";
    const AFTER_ERROR: Option<Phase> = None;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_of_an_interface_are_called_in_its_states() {
        crate::calling_sequence::check_interfaces(Function::ALL);
    }
}
