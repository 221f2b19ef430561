//! The functions and the allowed order of calls: the state machines of FMI 2.0.5, sections 3.2.3 and 4.2.4, as data.
//!
//! The states `stepInProgress` and `stepCanceled` of the standard do not occur, because steps are never asynchronous.
//! The state `fatal` does not occur, because an error never affects another instance.

use fmu_terms::Interface;

use crate::calling_sequence::{Conventions, Function, Phase, Phases, functions};

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

/// The functions of FMI 2.0.5, with the parameters' names of fmi2FunctionTypes.h: those of the library, then those
/// of an instance, in all interfaces or one, with the states in which they may be called.
///
/// `fmi2_calls!(name)` passes the table to the macro `name`, `fmi2_calls!(name, tokens)` after these tokens. Types are
/// those in scope there.
#[macro_export]
macro_rules! fmi2_calls {
    ($macro:path $(, $($tokens:tt)*)?) => { $macro! { $($($tokens)*)?
        Library {
            fmi2GetTypesPlatform() -> String;
            fmi2GetVersion() -> String;
            fmi2Instantiate(
                instanceName: String, fmuType: Enumeration, fmuGUID: String, fmuResourceLocation: String,
                functions: *const CallbackFunctions, visible: Boolean, loggingOn: Boolean,
            ) -> Component;
            fmi2FreeInstance(c: Component);
        }
        All {
            fmi2SetDebugLogging(loggingOn: Boolean, nCategories: usize, categories: *const String): ANY;
            fmi2SetupExperiment(
                toleranceDefined: Boolean, tolerance: f64, startTime: f64, stopTimeDefined: Boolean, stopTime: f64,
            ): [Instantiated];
            fmi2EnterInitializationMode(): [Instantiated];
            fmi2ExitInitializationMode(): [InitializationMode];
            fmi2Terminate(): [StepComplete, StepFailed, EventMode, ContinuousTimeMode];
            fmi2Reset(): ANY;
            fmi2GetReal(vr: *const ValueReference, nvr: usize, value: *mut f64): READABLE;
            fmi2GetInteger(vr: *const ValueReference, nvr: usize, value: *mut Integer): READABLE;
            fmi2GetBoolean(vr: *const ValueReference, nvr: usize, value: *mut Boolean): READABLE;
            fmi2GetString(vr: *const ValueReference, nvr: usize, value: *mut String): READABLE;
            fmi2SetReal(vr: *const ValueReference, nvr: usize, value: *const f64): WRITABLE;
            fmi2SetInteger(vr: *const ValueReference, nvr: usize, value: *const Integer): WRITABLE;
            fmi2SetBoolean(vr: *const ValueReference, nvr: usize, value: *const Boolean): WRITABLE;
            fmi2SetString(vr: *const ValueReference, nvr: usize, value: *const String): WRITABLE;
            fmi2GetFMUstate(FMUstate: *mut FmuState): ANY;
            fmi2SetFMUstate(FMUstate: FmuState): ANY;
            fmi2FreeFMUstate(FMUstate: *mut FmuState): ANY;
            fmi2SerializedFMUstateSize(FMUstate: FmuState, size: *mut usize): ANY;
            fmi2SerializeFMUstate(FMUstate: FmuState, serializedState: *mut Byte, size: usize): ANY;
            fmi2DeSerializeFMUstate(serializedState: *const Byte, size: usize, FMUstate: *mut FmuState): ANY;
            fmi2GetDirectionalDerivative(
                vUnknown_ref: *const ValueReference, nUnknown: usize, vKnown_ref: *const ValueReference,
                nKnown: usize, dvKnown: *const f64, dvUnknown: *mut f64,
            ): READABLE;
        }
        CoSimulation {
            fmi2SetRealInputDerivatives(
                vr: *const ValueReference, nvr: usize, order: *const Integer, value: *const f64,
            ): [Instantiated, InitializationMode, StepComplete];
            fmi2GetRealOutputDerivatives(
                vr: *const ValueReference, nvr: usize, order: *const Integer, value: *mut f64,
            ): [StepComplete, StepFailed, Terminated, Error];
            fmi2DoStep(
                currentCommunicationPoint: f64, communicationStepSize: f64, noSetFMUStatePriorToCurrentPoint: Boolean,
            ): [StepComplete];
            fmi2CancelStep(): [];
            fmi2GetStatus(s: Enumeration, value: *mut Enumeration): STEPPED;
            fmi2GetRealStatus(s: Enumeration, value: *mut f64): STEPPED;
            fmi2GetIntegerStatus(s: Enumeration, value: *mut Integer): STEPPED;
            fmi2GetBooleanStatus(s: Enumeration, value: *mut Boolean): STEPPED;
            fmi2GetStringStatus(s: Enumeration, value: *mut String): STEPPED;
        }
        ModelExchange {
            fmi2EnterEventMode(): [EventMode, ContinuousTimeMode];
            fmi2NewDiscreteStates(fmi2eventInfo: *mut EventInfo): [EventMode];
            fmi2EnterContinuousTimeMode(): [EventMode];
            fmi2CompletedIntegratorStep(
                noSetFMUStatePriorToCurrentPoint: Boolean, enterEventMode: *mut Boolean,
                terminateSimulation: *mut Boolean,
            ): [ContinuousTimeMode];
            // Event Mode is for a model without states, which need not leave it.
            fmi2SetTime(time: f64): [EventMode, ContinuousTimeMode];
            fmi2SetContinuousStates(x: *const f64, nx: usize): [ContinuousTimeMode];
            fmi2GetDerivatives(derivatives: *mut f64, nx: usize): SOLVABLE;
            fmi2GetEventIndicators(eventIndicators: *mut f64, ni: usize): SOLVABLE;
            fmi2GetContinuousStates(x: *mut f64, nx: usize): SOLVABLE;
            fmi2GetNominalsOfContinuousStates(x_nominal: *mut f64, nx: usize):
                [Instantiated, InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error];
        }
    } };
}

/// What the functions of FMI 2.0 share.
pub static CONVENTIONS: Conventions =
    Conventions { value_references: "vr", values: "value", after_error: None };

fmi2_calls! { functions, &CONVENTIONS, }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_of_an_interface_are_called_in_its_states() {
        crate::calling_sequence::check_interfaces(ALL);
    }

    #[test]
    fn the_functions_are_those_of_the_headers() {
        let of = |interface| ALL.iter().filter(|function| function.interface == interface).count();
        let interfaces = [None, Some(Interface::CoSimulation), Some(Interface::ModelExchange)];
        // GetTypesPlatform, GetVersion, Instantiate and FreeInstance take no part in the calling sequence.
        assert_eq!(interfaces.map(of), [25 - 4, 9, 10]);
    }
}
