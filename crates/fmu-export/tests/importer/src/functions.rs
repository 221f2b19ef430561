//! The tables of calls: the functions of FMI 2.0.5 (fmi2FunctionTypes.h) and FMI 3.0.2 (fmi3FunctionTypes.h), with the
//! names of the headers, and the states in which they are allowed (FMI 2.0.5, sections 3.2.3 and 4.2.4; FMI 3.0.2,
//! sections 2.3, 3.2, 4.2 and 5.2), each by its [letter](crate::State).

use std::ffi::{c_char, c_int, c_void};
use std::mem;

/// What an instance is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Model Exchange.
    ModelExchange,
    /// Co-Simulation.
    CoSimulation,
    /// Co-Simulation with Event Mode (FMI 3.0).
    EventMode,
    /// Scheduled Execution (FMI 3.0).
    ScheduledExecution,
}

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Number,
    /// A Boolean or an enumeration.
    Whole,
    /// The number of an array's elements.
    Count,
    /// A value reference.
    Reference,
    /// A saved state.
    State,
    /// The address of what is read.
    In(Element),
    /// The address of what is written.
    Out(Element),
}

/// What is at an address, with its size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// A floating-point number.
    Float(usize),
    /// A whole number, Boolean or enumeration.
    Whole(usize),
    /// A value reference.
    Reference,
    /// The address of a string.
    Text,
    /// The address of a binary.
    Binary,
    /// A saved state.
    State,
    /// `fmi2EventInfo`.
    EventInfo,
}

impl Element {
    /// Its size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::Float(size) | Self::Whole(size) => size,
            Self::Reference => size_of::<Reference>(),
            Self::Text | Self::Binary | Self::State => size_of::<*const c_void>(),
            Self::EventInfo => size_of::<EventInfo>(),
        }
    }
}

/// A value reference.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Reference(u32);

/// `fmi2FMUstate`, `fmi3FMUState`.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct State(*mut c_void);

type Text = *const c_char;

/// `fmi3Binary`.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct Binary(*const u8);

/// `fmi2EventInfo`.
#[derive(Clone, Copy)]
#[repr(C)]
struct EventInfo {
    flags: [c_int; 5],
    next_event_time: f64,
}

/// An argument as it is passed.
#[derive(Clone, Copy, Debug)]
pub enum Raw {
    /// A number.
    Number(f64),
    /// Anything whole.
    Whole(u64),
    /// An address, or a handle.
    Address(*mut c_void),
}

/// A type of parameters.
trait Passed {
    const KIND: Kind;

    fn of(raw: Option<&Raw>) -> Self;
}

macro_rules! passed {
    ($($type:ty: $kind:expr, $variant:ident($value:ident) => $of:expr;)*) => {$(
        impl Passed for $type {
            const KIND: Kind = $kind;

            #[allow(clippy::cast_possible_truncation, reason = "any value will do")]
            fn of(raw: Option<&Raw>) -> Self {
                match raw {
                    Some(&Raw::$variant($value)) => $of,
                    other => panic!("{other:?} for {}", stringify!($type)),
                }
            }
        }
    )*};
}

passed! {
    f64: Kind::Number, Number(value) => value;
    i32: Kind::Whole, Whole(value) => value as Self;
    u8: Kind::Whole, Whole(value) => value as Self;
    usize: Kind::Count, Whole(value) => value as Self;
    Reference: Kind::Reference, Whole(value) => Self(value as u32);
    State: Kind::State, Address(value) => Self(value);
}

/// A type at addresses.
trait AtAddress {
    const ELEMENT: Element;
}

macro_rules! at_address {
    ($($type:ty: $element:expr;)*) => {$(
        impl AtAddress for $type {
            const ELEMENT: Element = $element;
        }
    )*};
}

at_address! {
    f64: Element::Float(8); f32: Element::Float(4);
    i8: Element::Whole(1); u8: Element::Whole(1); i16: Element::Whole(2); u16: Element::Whole(2);
    i32: Element::Whole(4); u32: Element::Whole(4); i64: Element::Whole(8); u64: Element::Whole(8);
    usize: Element::Whole(size_of::<usize>());
    Reference: Element::Reference; Text: Element::Text; Binary: Element::Binary; State: Element::State;
    EventInfo: Element::EventInfo;
}

impl<T: AtAddress> Passed for *const T {
    const KIND: Kind = Kind::In(T::ELEMENT);

    fn of(raw: Option<&Raw>) -> Self {
        <*mut T>::of(raw).cast_const()
    }
}

impl<T: AtAddress> Passed for *mut T {
    const KIND: Kind = Kind::Out(T::ELEMENT);

    fn of(raw: Option<&Raw>) -> Self {
        match raw {
            Some(Raw::Address(address)) => address.cast(),
            other => panic!("{other:?} for an address"),
        }
    }
}

/// A function that takes an instance and returns a status.
pub struct Function {
    /// As the library exports it.
    pub name: &'static str,
    /// The only interface that has it.
    pub interface: Option<Interface>,
    /// The letters of the states in which it is allowed.
    pub states: &'static str,
    /// The parameters after the instance.
    pub parameters: &'static [(&'static str, Kind)],
    /// Calls the function with an address.
    ///
    /// # Safety
    /// The address is that of this function; the arguments are those of its parameters.
    pub call: unsafe fn(*const c_void, *mut c_void, &[Raw]) -> c_int,
}

impl Function {
    /// Whether a parameter holds value references.
    pub fn has_references(kind: Kind) -> bool {
        matches!(kind, Kind::Reference | Kind::In(Element::Reference))
    }

    /// The type of the variables whose value references it takes, if of one type.
    pub fn data_type(&self) -> Option<&'static str> {
        let (version, name) = self.name.split_at(4);
        let kind = name.strip_prefix("Get").or(name.strip_prefix("Set")).unwrap_or(name);
        let is_of_clocks = ["Clock", "Interval", "Shift", "Activate"].iter().any(|of| kind.starts_with(of));
        let takes_some = self.parameters.iter().any(|&(_, kind)| Self::has_references(kind));
        if !takes_some || kind.ends_with("Dependencies") {
            None
        } else if is_of_clocks {
            Some("Clock")
        } else if kind.contains("Derivative") {
            Some(if version == "fmi3" { "Float64" } else { "Real" })
        } else {
            Some(kind)
        }
    }
}

macro_rules! functions {
    ($table:ident: $($interface:expr => {
        $($name:ident($($parameter:ident: $type:ty),*), $states:literal;)*
    })*) => {
        #[doc = concat!("The functions of ", stringify!($table), ".")]
        #[allow(unused_mut, unused_variables, reason = "some functions have no arguments")]
        pub static $table: &[Function] = &[$($(Function {
            name: stringify!($name),
            interface: $interface,
            states: $states,
            parameters: &[$((stringify!($parameter), <$type as Passed>::KIND)),*],
            call: |address, instance, arguments| {
                type Called = unsafe extern "C" fn(*mut c_void $(, $type)*) -> c_int;
                // SAFETY: the caller's promise.
                let function = unsafe { mem::transmute::<*const c_void, Called>(address) };
                let mut arguments = arguments.iter();
                // SAFETY: the caller's promise.
                unsafe { function(instance $(, <$type as Passed>::of(arguments.next()))*) }
            },
        },)*)*];
    };
}

functions! { FMI2:
    None => {
        fmi2SetDebugLogging(loggingOn: i32, nCategories: usize, categories: *const Text), "INSFECATX";
        fmi2SetupExperiment(toleranceDefined: i32, tolerance: f64, startTime: f64, stopTimeDefined: i32, stopTime: f64), "I";
        fmi2EnterInitializationMode(), "I";
        fmi2ExitInitializationMode(), "N";
        fmi2Terminate(), "SFEC";
        fmi2Reset(), "INSFECATX";
        fmi2GetReal(vr: *const Reference, nvr: usize, value: *mut f64), "NSFECTX";
        fmi2GetInteger(vr: *const Reference, nvr: usize, value: *mut i32), "NSFECTX";
        fmi2GetBoolean(vr: *const Reference, nvr: usize, value: *mut i32), "NSFECTX";
        fmi2GetString(vr: *const Reference, nvr: usize, value: *mut Text), "NSFECTX";
        fmi2SetReal(vr: *const Reference, nvr: usize, value: *const f64), "INSEC";
        fmi2SetInteger(vr: *const Reference, nvr: usize, value: *const i32), "INSEC";
        fmi2SetBoolean(vr: *const Reference, nvr: usize, value: *const i32), "INSEC";
        fmi2SetString(vr: *const Reference, nvr: usize, value: *const Text), "INSEC";
        fmi2GetFMUstate(FMUstate: *mut State), "INSFECATX";
        fmi2SetFMUstate(FMUstate: State), "INSFECATX";
        fmi2FreeFMUstate(FMUstate: *mut State), "INSFECATX";
        fmi2SerializedFMUstateSize(FMUstate: State, size: *mut usize), "INSFECATX";
        fmi2SerializeFMUstate(FMUstate: State, serializedState: *mut u8, size: usize), "INSFECATX";
        fmi2DeSerializeFMUstate(serializedState: *const u8, size: usize, FMUstate: *mut State), "INSFECATX";
        fmi2GetDirectionalDerivative(vUnknown_ref: *const Reference, nUnknown: usize, vKnown_ref: *const Reference, nKnown: usize, dvKnown: *const f64, dvUnknown: *mut f64), "NSFECTX";
    }
    Some(Interface::ModelExchange) => {
        fmi2EnterEventMode(), "EC";
        fmi2NewDiscreteStates(fmi2eventInfo: *mut EventInfo), "E";
        fmi2EnterContinuousTimeMode(), "E";
        fmi2CompletedIntegratorStep(noSetFMUStatePriorToCurrentPoint: i32, enterEventMode: *mut i32, terminateSimulation: *mut i32), "C";
        fmi2SetTime(time: f64), "C";
        fmi2SetContinuousStates(x: *const f64, nx: usize), "C";
        fmi2GetDerivatives(derivatives: *mut f64, nx: usize), "NECTX";
        fmi2GetEventIndicators(eventIndicators: *mut f64, ni: usize), "NECTX";
        fmi2GetContinuousStates(x: *mut f64, nx: usize), "NECTX";
        fmi2GetNominalsOfContinuousStates(x_nominal: *mut f64, nx: usize), "INECTX";
    }
    Some(Interface::CoSimulation) => {
        fmi2SetRealInputDerivatives(vr: *const Reference, nvr: usize, order: *const i32, value: *const f64), "INS";
        fmi2GetRealOutputDerivatives(vr: *const Reference, nvr: usize, order: *const i32, value: *mut f64), "SFTX";
        fmi2DoStep(currentCommunicationPoint: f64, communicationStepSize: f64, noSetFMUStatePriorToCurrentPoint: i32), "S";
        fmi2CancelStep(), "";
        fmi2GetStatus(s: i32, value: *mut i32), "SFT";
        fmi2GetRealStatus(s: i32, value: *mut f64), "SFT";
        fmi2GetIntegerStatus(s: i32, value: *mut i32), "SFT";
        fmi2GetBooleanStatus(s: i32, value: *mut i32), "SFT";
        fmi2GetStringStatus(s: i32, value: *mut Text), "SFT";
    }
}
functions! { FMI3:
    None => {
        fmi3SetDebugLogging(loggingOn: u8, nCategories: usize, categories: *const Text), "INSFECATX";
        fmi3EnterInitializationMode(toleranceDefined: u8, tolerance: f64, startTime: f64, stopTimeDefined: u8, stopTime: f64), "I";
        fmi3ExitInitializationMode(), "N";
        fmi3EnterEventMode(), "SC";
        fmi3Terminate(), "SFECA";
        fmi3Reset(), "INSFECATX";
        fmi3GetFloat32(valueReferences: *const Reference, nValueReferences: usize, values: *mut f32, nValues: usize), "INSFECATX";
        fmi3GetFloat64(valueReferences: *const Reference, nValueReferences: usize, values: *mut f64, nValues: usize), "INSFECATX";
        fmi3GetInt8(valueReferences: *const Reference, nValueReferences: usize, values: *mut i8, nValues: usize), "INSFECATX";
        fmi3GetUInt8(valueReferences: *const Reference, nValueReferences: usize, values: *mut u8, nValues: usize), "INSFECATX";
        fmi3GetInt16(valueReferences: *const Reference, nValueReferences: usize, values: *mut i16, nValues: usize), "INSFECATX";
        fmi3GetUInt16(valueReferences: *const Reference, nValueReferences: usize, values: *mut u16, nValues: usize), "INSFECATX";
        fmi3GetInt32(valueReferences: *const Reference, nValueReferences: usize, values: *mut i32, nValues: usize), "INSFECATX";
        fmi3GetUInt32(valueReferences: *const Reference, nValueReferences: usize, values: *mut u32, nValues: usize), "INSFECATX";
        fmi3GetInt64(valueReferences: *const Reference, nValueReferences: usize, values: *mut i64, nValues: usize), "INSFECATX";
        fmi3GetUInt64(valueReferences: *const Reference, nValueReferences: usize, values: *mut u64, nValues: usize), "INSFECATX";
        fmi3GetBoolean(valueReferences: *const Reference, nValueReferences: usize, values: *mut u8, nValues: usize), "INSFECATX";
        fmi3GetString(valueReferences: *const Reference, nValueReferences: usize, values: *mut Text, nValues: usize), "INSFECATX";
        fmi3GetBinary(valueReferences: *const Reference, nValueReferences: usize, valueSizes: *mut usize, values: *mut Binary, nValues: usize), "INSFECATX";
        fmi3GetClock(valueReferences: *const Reference, nValueReferences: usize, values: *mut u8), "EA";
        fmi3SetFloat32(valueReferences: *const Reference, nValueReferences: usize, values: *const f32, nValues: usize), "INSECA";
        fmi3SetFloat64(valueReferences: *const Reference, nValueReferences: usize, values: *const f64, nValues: usize), "INSECA";
        fmi3SetInt8(valueReferences: *const Reference, nValueReferences: usize, values: *const i8, nValues: usize), "INSECA";
        fmi3SetUInt8(valueReferences: *const Reference, nValueReferences: usize, values: *const u8, nValues: usize), "INSECA";
        fmi3SetInt16(valueReferences: *const Reference, nValueReferences: usize, values: *const i16, nValues: usize), "INSECA";
        fmi3SetUInt16(valueReferences: *const Reference, nValueReferences: usize, values: *const u16, nValues: usize), "INSECA";
        fmi3SetInt32(valueReferences: *const Reference, nValueReferences: usize, values: *const i32, nValues: usize), "INSECA";
        fmi3SetUInt32(valueReferences: *const Reference, nValueReferences: usize, values: *const u32, nValues: usize), "INSECA";
        fmi3SetInt64(valueReferences: *const Reference, nValueReferences: usize, values: *const i64, nValues: usize), "INSECA";
        fmi3SetUInt64(valueReferences: *const Reference, nValueReferences: usize, values: *const u64, nValues: usize), "INSECA";
        fmi3SetBoolean(valueReferences: *const Reference, nValueReferences: usize, values: *const u8, nValues: usize), "INSECA";
        fmi3SetString(valueReferences: *const Reference, nValueReferences: usize, values: *const Text, nValues: usize), "INSECA";
        fmi3SetBinary(valueReferences: *const Reference, nValueReferences: usize, valueSizes: *const usize, values: *const Binary, nValues: usize), "INSECA";
        fmi3SetClock(valueReferences: *const Reference, nValueReferences: usize, values: *const u8), "E";
        fmi3GetNumberOfVariableDependencies(valueReference: Reference, nDependencies: *mut usize), "";
        fmi3GetVariableDependencies(dependent: Reference, elementIndicesOfDependent: *mut usize, independents: *mut Reference, elementIndicesOfIndependents: *mut usize, dependencyKinds: *mut i32, nDependencies: usize), "";
        fmi3GetFMUState(FMUState: *mut State), "INSFECATX";
        fmi3SetFMUState(FMUState: State), "INSFECATX";
        fmi3FreeFMUState(FMUState: *mut State), "INSFECATX";
        fmi3SerializedFMUStateSize(FMUState: State, size: *mut usize), "INSFECATX";
        fmi3SerializeFMUState(FMUState: State, serializedState: *mut u8, size: usize), "INSFECATX";
        fmi3DeserializeFMUState(serializedState: *const u8, size: usize, FMUState: *mut State), "INSFECATX";
        fmi3GetDirectionalDerivative(unknowns: *const Reference, nUnknowns: usize, knowns: *const Reference, nKnowns: usize, seed: *const f64, nSeed: usize, sensitivity: *mut f64, nSensitivity: usize), "NSFECATX";
        fmi3GetAdjointDerivative(unknowns: *const Reference, nUnknowns: usize, knowns: *const Reference, nKnowns: usize, seed: *const f64, nSeed: usize, sensitivity: *mut f64, nSensitivity: usize), "NSFECATX";
        fmi3EnterConfigurationMode(), "";
        fmi3ExitConfigurationMode(), "";
        fmi3GetIntervalDecimal(valueReferences: *const Reference, nValueReferences: usize, intervals: *mut f64, qualifiers: *mut i32), "NEA";
        fmi3GetIntervalFraction(valueReferences: *const Reference, nValueReferences: usize, counters: *mut u64, resolutions: *mut u64, qualifiers: *mut i32), "NEA";
        fmi3GetShiftDecimal(valueReferences: *const Reference, nValueReferences: usize, shifts: *mut f64), "N";
        fmi3GetShiftFraction(valueReferences: *const Reference, nValueReferences: usize, counters: *mut u64, resolutions: *mut u64), "N";
        fmi3SetIntervalDecimal(valueReferences: *const Reference, nValueReferences: usize, intervals: *const f64), "NEA";
        fmi3SetIntervalFraction(valueReferences: *const Reference, nValueReferences: usize, counters: *const u64, resolutions: *const u64), "NEA";
        fmi3SetShiftDecimal(valueReferences: *const Reference, nValueReferences: usize, shifts: *const f64), "N";
        fmi3SetShiftFraction(valueReferences: *const Reference, nValueReferences: usize, counters: *const u64, resolutions: *const u64), "N";
        fmi3EvaluateDiscreteStates(), "E";
        fmi3UpdateDiscreteStates(discreteStatesNeedUpdate: *mut u8, terminateSimulation: *mut u8, nominalsOfContinuousStatesChanged: *mut u8, valuesOfContinuousStatesChanged: *mut u8, nextEventTimeDefined: *mut u8, nextEventTime: *mut f64), "E";
    }
    Some(Interface::ModelExchange) => {
        fmi3EnterContinuousTimeMode(), "E";
        fmi3CompletedIntegratorStep(noSetFMUStatePriorToCurrentPoint: u8, enterEventMode: *mut u8, terminateSimulation: *mut u8), "C";
        fmi3SetTime(time: f64), "C";
        fmi3SetContinuousStates(continuousStates: *const f64, nContinuousStates: usize), "C";
        fmi3GetContinuousStateDerivatives(derivatives: *mut f64, nContinuousStates: usize), "NECTX";
        fmi3GetEventIndicators(eventIndicators: *mut f64, nEventIndicators: usize), "NECTX";
        fmi3GetContinuousStates(continuousStates: *mut f64, nContinuousStates: usize), "NECTX";
        fmi3GetNominalsOfContinuousStates(nominals: *mut f64, nContinuousStates: usize), "NECTX";
        fmi3GetNumberOfEventIndicators(nEventIndicators: *mut usize), "IE";
        fmi3GetNumberOfContinuousStates(nContinuousStates: *mut usize), "IE";
    }
    Some(Interface::CoSimulation) => {
        fmi3EnterStepMode(), "E";
        fmi3GetOutputDerivatives(valueReferences: *const Reference, nValueReferences: usize, orders: *const i32, values: *mut f64, nValues: usize), "SFTX";
        fmi3DoStep(currentCommunicationPoint: f64, communicationStepSize: f64, noSetFMUStatePriorToCurrentPoint: u8, eventHandlingNeeded: *mut u8, terminateSimulation: *mut u8, earlyReturn: *mut u8, lastSuccessfulTime: *mut f64), "S";
    }
    Some(Interface::ScheduledExecution) => {
        fmi3ActivateModelPartition(clockReference: Reference, activationTime: f64), "A";
    }
}
