//! The functions of FMI 2.0 and 3.0, from the exporter's tables of calls; but the states in which they are allowed, which
//! the tests check, are listed here, from the standards' text, each by its [letter](crate::State).

use std::ffi::{c_char, c_int, c_void};
use std::mem;

use fmu_terms::Interface;

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
    /// The parameters after the instance.
    pub parameters: &'static [(&'static str, Kind)],
    /// Calls the function with an address.
    ///
    /// # Safety
    /// The address is that of this function; the arguments are those of its parameters.
    pub call: unsafe fn(*const c_void, *mut c_void, &[Raw]) -> c_int,
}

impl Function {
    /// The letters of the states in which it is allowed.
    pub fn states(&self) -> &'static str {
        let (version, name) = self.name.split_at(4);
        let table = if version == "fmi3" { STATES_OF_FMI3 } else { STATES_OF_FMI2 };
        let states = table.iter().find(|(_, names)| names.split(' ').any(|other| other == name));
        states.unwrap_or_else(|| panic!("{} is not in the list of states", self.name)).0
    }

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

/// The functions of FMI 2.0 allowed in states, by their letters (FMI 2.0.5, sections 3.2.3 and 4.2.4).
const STATES_OF_FMI2: &[(&str, &str)] = &[
    (
        "INSFECATX",
        "SetDebugLogging Reset GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize \
         SerializeFMUstate DeSerializeFMUstate",
    ),
    ("I", "SetupExperiment EnterInitializationMode"),
    ("N", "ExitInitializationMode"),
    ("SFEC", "Terminate"),
    ("NSFECTX", "GetReal GetInteger GetBoolean GetString GetDirectionalDerivative"),
    ("INSEC", "SetReal SetInteger SetBoolean SetString"),
    ("EC", "EnterEventMode"),
    ("E", "NewDiscreteStates EnterContinuousTimeMode"),
    ("C", "CompletedIntegratorStep SetTime SetContinuousStates"),
    ("NECTX", "GetDerivatives GetEventIndicators GetContinuousStates"),
    ("INECTX", "GetNominalsOfContinuousStates"),
    ("INS", "SetRealInputDerivatives"),
    ("SFTX", "GetRealOutputDerivatives"),
    ("S", "DoStep"),
    ("", "CancelStep"),
    ("SFT", "GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus"),
];

/// The functions of FMI 3.0 allowed in states (FMI 3.0.2, sections 2.3, 3.2, 4.2 and 5.2), of those that the test models have.
const STATES_OF_FMI3: &[(&str, &str)] = &[
    (
        "INSFECATX",
        "SetDebugLogging Reset GetFloat32 GetFloat64 GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32 \
         GetUInt32 GetInt64 GetUInt64 GetBoolean GetString GetBinary GetFMUState SetFMUState FreeFMUState \
         SerializedFMUStateSize SerializeFMUState DeserializeFMUState",
    ),
    ("I", "EnterInitializationMode"),
    ("N", "ExitInitializationMode GetShiftDecimal GetShiftFraction SetShiftDecimal SetShiftFraction"),
    ("SC", "EnterEventMode"),
    ("SFECA", "Terminate"),
    ("EA", "GetClock"),
    (
        "INSECA",
        "SetFloat32 SetFloat64 SetInt8 SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64 \
         SetBoolean SetString SetBinary",
    ),
    ("E", "SetClock EvaluateDiscreteStates UpdateDiscreteStates EnterContinuousTimeMode EnterStepMode"),
    (
        "",
        "GetNumberOfVariableDependencies GetVariableDependencies EnterConfigurationMode \
         ExitConfigurationMode",
    ),
    ("NSFECATX", "GetDirectionalDerivative GetAdjointDerivative"),
    ("NEA", "GetIntervalDecimal GetIntervalFraction SetIntervalDecimal SetIntervalFraction"),
    ("C", "CompletedIntegratorStep SetTime SetContinuousStates"),
    (
        "NECTX",
        "GetContinuousStateDerivatives GetEventIndicators GetContinuousStates \
         GetNominalsOfContinuousStates",
    ),
    ("IE", "GetNumberOfEventIndicators GetNumberOfContinuousStates"),
    ("SFTX", "GetOutputDerivatives"),
    ("S", "DoStep"),
    ("A", "ActivateModelPartition"),
];

/// Declares the functions of a version's table that take an instance, with the types in scope.
macro_rules! functions {
    (@interface All) => { None };
    (@interface $interface:ident) => { Some(Interface::$interface) };
    ($table:ident Library $library:tt $($interface:ident {
        $($name:ident($($parameter:ident: $type:ty),* $(,)?): $phases:tt;)*
    })*) => {
        #[doc = concat!("The functions of ", stringify!($table), ".")]
        #[allow(unused_mut, unused_variables, reason = "some functions have no arguments")]
        pub static $table: &[Function] = &[$($(Function {
            name: stringify!($name),
            interface: functions!(@interface $interface),
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

/// FMI 2.0.
mod fmi2 {
    use super::{EventInfo, Function, Interface, Passed, Reference, State, Text, c_int, c_void, mem};

    type Boolean = i32;
    type Integer = i32;
    type Enumeration = i32;
    type Byte = u8;
    type String = Text;
    type ValueReference = Reference;
    type FmuState = State;

    fmu_abi::fmi2_calls!(functions, FMI2);
}

/// FMI 3.0.
mod fmi3 {
    use super::{Binary, Function, Interface, Passed, Reference, State, Text, c_int, c_void, mem};

    type Boolean = u8;
    type Clock = u8;
    type Enumeration = i32;
    type Byte = u8;
    type String = Text;
    type ValueReference = Reference;
    type FmuState = State;

    fmu_abi::fmi3_calls!(functions, FMI3);
}

pub use fmi2::FMI2;
pub use fmi3::FMI3;
