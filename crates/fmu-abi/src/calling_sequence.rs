//! The states of an instance, and in which of them each function may be called. The tables are in the modules of the
//! versions.

use core::fmt;

use fmu_terms::Interface;

/// Declares the states: their names, and the only interface whose instances have them, if there is just one.
macro_rules! phases {
    ($($(#[$attribute:meta])* $phase:ident: $name:literal, $interface:expr;)*) => {
        /// The states of an instance, first those of FMI 2.0.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Phase {
            $($(#[$attribute])* $phase,)*
        }

        impl fmt::Display for Phase {
            fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str(match self {
                    $(Self::$phase => $name,)*
                })
            }
        }

        impl Phase {
            /// Every state.
            pub const ALL: &[Self] = &[$(Self::$phase,)*];

            /// The state of a number, its place in the order.
            #[must_use]
            pub fn numbered(number: u8) -> Option<Self> {
                Self::ALL.get(usize::from(number)).copied()
            }

            /// The only interface whose instances have the state, if there is just one.
            #[must_use]
            pub const fn interface(self) -> Option<Interface> {
                match self {
                    $(Self::$phase => $interface,)*
                }
            }
        }
    };
}

phases! {
    /// After instantiation or a reset.
    Instantiated: "instantiated", None;
    /// While initial values are computed.
    InitializationMode: "Initialization Mode", None;
    /// Co-Simulation: between steps.
    StepComplete: "stepComplete", Some(Interface::CoSimulation);
    /// Model Exchange: at an event.
    EventMode: "Event Mode", Some(Interface::ModelExchange);
    /// Model Exchange: between events.
    ContinuousTimeMode: "Continuous-Time Mode", Some(Interface::ModelExchange);
    /// After a step in which the model requested the end.
    StepFailed: "stepFailed", Some(Interface::CoSimulation);
    /// After the simulation.
    Terminated: "terminated", None;
    /// After a failed step or a panic, when the model's state is undefined.
    Error: "error", None;
    /// Co-Simulation with Event Mode: at an event.
    StepEventMode: "Event Mode", Some(Interface::CoSimulation);
    /// Scheduled Execution: between activations.
    ClockActivationMode: "Clock Activation Mode", Some(Interface::ScheduledExecution);
    /// Co-Simulation of FMI 3.0: between two internal steps of a communication step.
    IntermediateUpdateMode: "Intermediate Update Mode", Some(Interface::CoSimulation);
    /// FMI 3.0: while structural parameters are set.
    ConfigurationMode: "Configuration Mode", None;
}

/// A set of states, one bit each.
#[derive(Clone, Copy, Debug)]
pub struct Phases(u16);

impl Phases {
    /// Every state.
    pub const ALL: Self = Self::of(Phase::ALL);

    /// The states of a list.
    #[must_use]
    pub const fn of(phases: &[Phase]) -> Self {
        match phases {
            [] => Self(0),
            [first, others @ ..] => Self::of(others).and(*first),
        }
    }

    /// The set with one more state.
    #[must_use]
    pub const fn and(self, phase: Phase) -> Self {
        Self(self.0 | 1 << phase as u16)
    }

    /// The set without a state.
    #[must_use]
    pub const fn without(self, phase: Phase) -> Self {
        Self(self.0 & !(1 << phase as u16))
    }

    /// Whether the set contains a state.
    #[must_use]
    #[inline]
    pub const fn contains(self, phase: Phase) -> bool {
        self.0 & 1 << phase as u16 != 0
    }
}

/// A function of the standard that takes an instance.
#[derive(Debug)]
pub struct Function {
    /// The name in the standard.
    pub name: &'static str,
    /// The only interface whose instances have the function, if there is just one.
    pub interface: Option<Interface>,
    /// The states in which the function may be called.
    pub phases: Phases,
    /// What the function shares with the others of its version.
    pub version: &'static Conventions,
}

/// What the functions of a version share.
#[derive(Debug)]
pub struct Conventions {
    /// The standard's name for the array of value references of getters and setters, for messages.
    pub value_references: &'static str,
    /// The standard's name for the array of values of getters and setters, for messages.
    pub values: &'static str,
    /// The state after an error, unless the standard lets the importer continue.
    pub after_error: Option<Phase>,
}

/// Declares the functions of a version's table that take an instance: their interface, if only one has them, and the
/// states in which they may be called, in brackets or as a set.
macro_rules! functions {
    (@interface All) => { None };
    (@interface $interface:ident) => { Some(Interface::$interface) };
    (@phases [$($phase:expr),*]) => { Phases::of(&[$($phase),*]) };
    (@phases $phases:ident) => { $phases };
    ($conventions:expr, Library $library:tt $($interface:ident { $($name:ident $parameters:tt: $phases:tt;)* })*) => {
        $($(
            #[doc = concat!("`", stringify!($name), "`.")]
            #[allow(non_upper_case_globals, reason = "the standard's names")]
            pub const $name: Function = Function {
                name: stringify!($name),
                interface: functions!(@interface $interface),
                phases: functions!(@phases $phases),
                version: $conventions,
            };
        )*)*

        /// Every function.
        #[cfg(test)]
        const ALL: &[&Function] = &[$($(&$name,)*)*];
    };
}

pub(crate) use functions;

/// Declares the types of the functions in a version's table. `Status` and the parameters' types are in scope.
#[macro_export]
macro_rules! function_types {
    (Library { $($library:ident($($argument:ident: $of:ty),* $(,)?) $(-> $result:ty)?;)* }
        $($interface:ident { $($name:ident($($parameter:ident: $type:ty),* $(,)?): $phases:tt;)* })*) => {
        $(
            #[doc = concat!("`", stringify!($library), "`.")]
            #[allow(non_camel_case_types, non_snake_case, reason = "the standard's names")]
            pub type $library = unsafe extern "C" fn($($argument: $of),*) $(-> $result)?;
        )*
        $($(
            #[doc = concat!("`", stringify!($name), "`.")]
            #[allow(non_camel_case_types, non_snake_case, reason = "the standard's names")]
            pub type $name =
                unsafe extern "C" fn(instance: *mut ::core::ffi::c_void, $($parameter: $type),*) -> Status;
        )*)*
    };
}

/// Checks that a table lists functions of an interface in its states only.
#[cfg(test)]
pub(crate) fn check_interfaces(functions: &[&Function]) {
    for &&Function { name, interface: of_function, phases, .. } in functions {
        for phase in Phase::ALL.iter().filter(|&&phase| phases.contains(phase)) {
            let of_phase = phase.interface();
            assert!(
                of_function.is_none() || of_phase.is_none() || of_function == of_phase,
                "{name} in {phase}"
            );
        }
    }
}
