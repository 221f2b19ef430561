//! The functions and the allowed order of calls: the state machines of FMI 3.0.2, sections 2.3, 3.2 and 4.2, as data.
//!
//! Reconfiguration Mode does not occur: there are no tunable structural parameters.

use fmu_terms::Interface;

use crate::calling_sequence::{Conventions, Function, Phase, Phases, functions};

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

/// The functions of FMI 3.0.2, with the parameters' names of fmi3FunctionTypes.h: those of the library, then those
/// of an instance, in all interfaces or one, with the states in which they may be called.
///
/// `fmi3_calls!(name)` passes the table to the macro `name`, `fmi3_calls!(name, tokens)` after these tokens. Types are
/// those in scope there, but for `Option`, which a model may call an enumeration.
#[macro_export]
macro_rules! fmi3_calls {
    ($macro:path $(, $($tokens:tt)*)?) => { $macro! { $($($tokens)*)?
        Library {
            fmi3GetVersion() -> String;
            fmi3FreeInstance(instance: Instance);
            fmi3InstantiateCoSimulation(
                instanceName: String, instantiationToken: String, resourcePath: String, visible: Boolean,
                loggingOn: Boolean, eventModeUsed: Boolean, earlyReturnAllowed: Boolean,
                requiredIntermediateVariables: *const ValueReference, nRequiredIntermediateVariables: usize,
                instanceEnvironment: InstanceEnvironment,
                logMessage: ::core::option::Option<LogMessageCallback>,
                intermediateUpdate: ::core::option::Option<IntermediateUpdateCallback>,
            ) -> Instance;
            fmi3InstantiateModelExchange(
                instanceName: String, instantiationToken: String, resourcePath: String, visible: Boolean,
                loggingOn: Boolean, instanceEnvironment: InstanceEnvironment,
                logMessage: ::core::option::Option<LogMessageCallback>,
            ) -> Instance;
            fmi3InstantiateScheduledExecution(
                instanceName: String, instantiationToken: String, resourcePath: String, visible: Boolean,
                loggingOn: Boolean, instanceEnvironment: InstanceEnvironment,
                logMessage: ::core::option::Option<LogMessageCallback>,
                clockUpdate: ::core::option::Option<ClockUpdateCallback>,
                lockPreemption: ::core::option::Option<PreemptionCallback>,
                unlockPreemption: ::core::option::Option<PreemptionCallback>,
            ) -> Instance;
        }
        All {
            fmi3SetDebugLogging(loggingOn: Boolean, nCategories: usize, categories: *const String): ANY;
            fmi3EnterInitializationMode(
                toleranceDefined: Boolean, tolerance: f64, startTime: f64, stopTimeDefined: Boolean, stopTime: f64,
            ): [Instantiated];
            fmi3ExitInitializationMode(): [InitializationMode];
            fmi3EnterEventMode(): [StepComplete, ContinuousTimeMode];
            fmi3Terminate():
                [StepComplete, StepFailed, EventMode, ContinuousTimeMode, StepEventMode, ClockActivationMode];
            fmi3Reset(): ANY;
            fmi3GetBinary(
                valueReferences: *const ValueReference, nValueReferences: usize, valueSizes: *mut usize,
                values: *mut Binary, nValues: usize,
            ): READABLE;
            fmi3SetBinary(
                valueReferences: *const ValueReference, nValueReferences: usize, valueSizes: *const usize,
                values: *const Binary, nValues: usize,
            ): WRITABLE;
            // In Scheduled Execution it belongs in Clock Update Mode, but Reference-FMUs' scs_synchronous.c calls it
            // afterwards.
            fmi3GetClock(valueReferences: *const ValueReference, nValueReferences: usize, values: *mut Clock):
                [EventMode, StepEventMode, ClockActivationMode];
            fmi3SetClock(valueReferences: *const ValueReference, nValueReferences: usize, values: *const Clock):
                AT_EVENTS;
            fmi3GetNumberOfVariableDependencies(valueReference: ValueReference, nDependencies: *mut usize): ANY;
            fmi3GetVariableDependencies(
                dependent: ValueReference, elementIndicesOfDependent: *mut usize, independents: *mut ValueReference,
                elementIndicesOfIndependents: *mut usize, dependencyKinds: *mut Enumeration, nDependencies: usize,
            ): ANY;
            fmi3GetFMUState(FMUState: *mut FmuState): ANY;
            fmi3SetFMUState(FMUState: FmuState): ANY;
            fmi3FreeFMUState(FMUState: *mut FmuState): ANY;
            fmi3SerializedFMUStateSize(FMUState: FmuState, size: *mut usize): ANY;
            fmi3SerializeFMUState(FMUState: FmuState, serializedState: *mut Byte, size: usize): ANY;
            fmi3DeserializeFMUState(serializedState: *const Byte, size: usize, FMUState: *mut FmuState): ANY;
            fmi3GetDirectionalDerivative(
                unknowns: *const ValueReference, nUnknowns: usize, knowns: *const ValueReference, nKnowns: usize,
                seed: *const f64, nSeed: usize, sensitivity: *mut f64, nSensitivity: usize,
            ): DIFFERENTIABLE;
            fmi3GetAdjointDerivative(
                unknowns: *const ValueReference, nUnknowns: usize, knowns: *const ValueReference, nKnowns: usize,
                seed: *const f64, nSeed: usize, sensitivity: *mut f64, nSensitivity: usize,
            ): DIFFERENTIABLE;
            fmi3EnterConfigurationMode(): [Instantiated];
            fmi3ExitConfigurationMode(): [ConfigurationMode];
            fmi3GetIntervalDecimal(
                valueReferences: *const ValueReference, nValueReferences: usize, intervals: *mut f64,
                qualifiers: *mut Enumeration,
            ): TIMED;
            fmi3GetIntervalFraction(
                valueReferences: *const ValueReference, nValueReferences: usize, counters: *mut u64,
                resolutions: *mut u64, qualifiers: *mut Enumeration,
            ): TIMED;
            fmi3GetShiftDecimal(valueReferences: *const ValueReference, nValueReferences: usize, shifts: *mut f64):
                [InitializationMode];
            fmi3GetShiftFraction(
                valueReferences: *const ValueReference, nValueReferences: usize, counters: *mut u64,
                resolutions: *mut u64,
            ): [InitializationMode];
            fmi3SetIntervalDecimal(
                valueReferences: *const ValueReference, nValueReferences: usize, intervals: *const f64,
            ): TIMED;
            fmi3SetIntervalFraction(
                valueReferences: *const ValueReference, nValueReferences: usize, counters: *const u64,
                resolutions: *const u64,
            ): TIMED;
            fmi3SetShiftDecimal(valueReferences: *const ValueReference, nValueReferences: usize, shifts: *const f64):
                [InitializationMode];
            fmi3SetShiftFraction(
                valueReferences: *const ValueReference, nValueReferences: usize, counters: *const u64,
                resolutions: *const u64,
            ): [InitializationMode];
            fmi3EvaluateDiscreteStates(): AT_EVENTS;
            fmi3UpdateDiscreteStates(
                discreteStatesNeedUpdate: *mut Boolean, terminateSimulation: *mut Boolean,
                nominalsOfContinuousStatesChanged: *mut Boolean, valuesOfContinuousStatesChanged: *mut Boolean,
                nextEventTimeDefined: *mut Boolean, nextEventTime: *mut f64,
            ): AT_EVENTS;
        }
        ModelExchange {
            fmi3EnterContinuousTimeMode(): [EventMode];
            fmi3CompletedIntegratorStep(
                noSetFMUStatePriorToCurrentPoint: Boolean, enterEventMode: *mut Boolean,
                terminateSimulation: *mut Boolean,
            ): [ContinuousTimeMode];
            fmi3SetTime(time: f64): [ContinuousTimeMode];
            fmi3SetContinuousStates(continuousStates: *const f64, nContinuousStates: usize): [ContinuousTimeMode];
            fmi3GetContinuousStateDerivatives(derivatives: *mut f64, nContinuousStates: usize): SOLVABLE;
            fmi3GetEventIndicators(eventIndicators: *mut f64, nEventIndicators: usize): SOLVABLE;
            fmi3GetContinuousStates(continuousStates: *mut f64, nContinuousStates: usize): SOLVABLE;
            fmi3GetNominalsOfContinuousStates(nominals: *mut f64, nContinuousStates: usize): SOLVABLE;
            fmi3GetNumberOfEventIndicators(nEventIndicators: *mut usize): COUNTABLE;
            fmi3GetNumberOfContinuousStates(nContinuousStates: *mut usize): COUNTABLE;
        }
        CoSimulation {
            fmi3EnterStepMode(): [StepEventMode];
            fmi3GetOutputDerivatives(
                valueReferences: *const ValueReference, nValueReferences: usize, orders: *const i32, values: *mut f64,
                nValues: usize,
            ): [StepComplete, StepFailed, Terminated, Error, IntermediateUpdateMode];
            fmi3DoStep(
                currentCommunicationPoint: f64, communicationStepSize: f64, noSetFMUStatePriorToCurrentPoint: Boolean,
                eventHandlingNeeded: *mut Boolean, terminateSimulation: *mut Boolean, earlyReturn: *mut Boolean,
                lastSuccessfulTime: *mut f64,
            ): [StepComplete];
        }
        ScheduledExecution {
            fmi3ActivateModelPartition(clockReference: ValueReference, activationTime: f64): [ClockActivationMode];
        }
        All {
            fmi3GetFloat32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut f32, nValues: usize,
            ): READABLE;
            fmi3SetFloat32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const f32, nValues: usize,
            ): WRITABLE;
            fmi3GetFloat64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut f64, nValues: usize,
            ): READABLE_NUMBERS;
            fmi3SetFloat64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const f64, nValues: usize,
            ): WRITABLE_NUMBERS;
            fmi3GetInt8(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut i8, nValues: usize,
            ): READABLE;
            fmi3SetInt8(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const i8, nValues: usize,
            ): WRITABLE;
            fmi3GetUInt8(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut u8, nValues: usize,
            ): READABLE;
            fmi3SetUInt8(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const u8, nValues: usize,
            ): WRITABLE;
            fmi3GetInt16(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut i16, nValues: usize,
            ): READABLE;
            fmi3SetInt16(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const i16, nValues: usize,
            ): WRITABLE;
            fmi3GetUInt16(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut u16, nValues: usize,
            ): READABLE;
            fmi3SetUInt16(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const u16, nValues: usize,
            ): WRITABLE;
            fmi3GetInt32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut i32, nValues: usize,
            ): READABLE;
            fmi3SetInt32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const i32, nValues: usize,
            ): WRITABLE;
            fmi3GetUInt32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut u32, nValues: usize,
            ): READABLE;
            fmi3SetUInt32(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const u32, nValues: usize,
            ): WRITABLE;
            fmi3GetInt64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut i64, nValues: usize,
            ): READABLE;
            fmi3SetInt64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const i64, nValues: usize,
            ): WRITABLE;
            fmi3GetUInt64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut u64, nValues: usize,
            ): READABLE;
            fmi3SetUInt64(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const u64, nValues: usize,
            ): CONFIGURABLE;
            fmi3GetBoolean(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut Boolean, nValues: usize,
            ): READABLE;
            fmi3SetBoolean(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const Boolean, nValues: usize,
            ): WRITABLE;
            fmi3GetString(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *mut String, nValues: usize,
            ): READABLE;
            fmi3SetString(
                valueReferences: *const ValueReference, nValueReferences: usize, values: *const String, nValues: usize,
            ): WRITABLE;
        }
    } };
}

/// What the functions of FMI 3.0 share.
pub static CONVENTIONS: Conventions = Conventions {
    value_references: "valueReferences",
    values: "values",
    // Section 2.2.4: the simulation must not be continued.
    after_error: Some(Error),
};

fmi3_calls! { functions, &CONVENTIONS, }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_of_an_interface_are_called_in_its_states() {
        crate::calling_sequence::check_interfaces(ALL);
    }

    #[test]
    fn there_are_75_functions() {
        // GetVersion, three instantiation functions and FreeInstance take no part in the calling sequence.
        assert_eq!(ALL.len() + 5, 75);
    }
}
