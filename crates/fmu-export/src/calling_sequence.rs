//! The order in which an importer may call: the state machines of FMI 2.0.5, sections 3.2.3 and 4.2.4, as data.
//!
//! The standard's states `stepInProgress` and `stepCanceled` do not occur, since steps are not asynchronous, and neither
//! does `fatal`, since an error never affects another instance.

use core::fmt;

use crate::error;
use crate::persistence::{Archive, Persistent};

/// The interfaces of FMI 2.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// The model steps by itself.
    CoSimulation,
    /// The importer integrates the model's states.
    ModelExchange,
}

impl fmt::Display for Interface {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::CoSimulation => "Co-Simulation",
            Self::ModelExchange => "Model Exchange",
        })
    }
}

/// The states of an instance, first those in which values can be set: one comparison finds them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    InitializationMode,
    /// Between steps of co-simulation.
    StepComplete,
    /// Model Exchange: at an event.
    EventMode,
    /// Model Exchange: between events.
    ContinuousTimeMode,
    /// After a step in which the model asked for the end.
    StepFailed,
    /// After `fmi2Terminate`.
    Terminated,
    /// After a failed step or a panic, when the model's state is undefined.
    Error,
}

impl fmt::Display for Phase {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Instantiated => "instantiated",
            Self::InitializationMode => "Initialization Mode",
            Self::StepComplete => "stepComplete",
            Self::StepFailed => "stepFailed",
            Self::EventMode => "Event Mode",
            Self::ContinuousTimeMode => "Continuous-Time Mode",
            Self::Terminated => "terminated",
            Self::Error => "error",
        })
    }
}

impl Phase {
    /// The interface whose instances alone have the state.
    pub(crate) const fn interface(self) -> Option<Interface> {
        match self {
            StepComplete | StepFailed => Some(Interface::CoSimulation),
            EventMode | ContinuousTimeMode => Some(Interface::ModelExchange),
            Instantiated | InitializationMode | Terminated | Error => None,
        }
    }
}

impl Persistent for Phase {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), error::Error> {
        let mut number = *self as u8;
        number.persist(archive)?;
        let known = ANY.iter().find(|&&phase| phase as u8 == number);
        *self = *known.ok_or_else(|| error::Error::new(format!("{number} is not a state of an instance")))?;
        Ok(())
    }
}

use Phase::{
    ContinuousTimeMode, Error, EventMode, InitializationMode, Instantiated, StepComplete, StepFailed,
    Terminated,
};

/// Any state.
const ANY: &[Phase] = &[
    Instantiated,
    InitializationMode,
    StepComplete,
    EventMode,
    ContinuousTimeMode,
    StepFailed,
    Terminated,
    Error,
];
/// The states in which values can be read.
const READABLE: &[Phase] =
    &[InitializationMode, StepComplete, StepFailed, EventMode, ContinuousTimeMode, Terminated, Error];
/// The states in which values can be set; the standard restricts the variables further.
const WRITABLE: &[Phase] = &[Instantiated, InitializationMode, StepComplete, EventMode, ContinuousTimeMode];
/// The states in which the status of a step can be asked for.
const STEPPED: &[Phase] = &[StepComplete, StepFailed, Terminated];
/// The states in which what a solver needs can be read.
const SOLVABLE: &[Phase] = &[InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error];

/// Declares the functions that take an instance: the interface that each belongs to, if only one has it, and the states
/// in which it may be called.
macro_rules! functions {
    ($($interface:expr => { $($name:ident: $phases:expr,)* })*) => {
        /// A function of the standard that takes an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub enum Function {
            $($($name,)*)*
        }

        impl Function {
            /// Every function.
            pub const ALL: &[Self] = &[$($(Self::$name,)*)*];

            /// The name in the standard.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $($(Self::$name => concat!("fmi2", stringify!($name)),)*)*
                }
            }

            /// The interface whose instances alone have the function.
            #[must_use]
            pub const fn interface(self) -> Option<Interface> {
                match self {
                    $($(Self::$name => $interface,)*)*
                }
            }

            /// The states in which it may be called.
            #[must_use]
            pub const fn phases(self) -> &'static [Phase] {
                match self {
                    $($(Self::$name => $phases,)*)*
                }
            }
        }
    };
}

functions! {
    None => {
        SetDebugLogging: ANY,
        SetupExperiment: &[Instantiated],
        EnterInitializationMode: &[Instantiated],
        ExitInitializationMode: &[InitializationMode],
        Terminate: &[StepComplete, StepFailed, EventMode, ContinuousTimeMode],
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
        SetRealInputDerivatives: &[Instantiated, InitializationMode, StepComplete],
        GetRealOutputDerivatives: &[StepComplete, StepFailed, Terminated, Error],
        DoStep: &[StepComplete],
        CancelStep: &[],
        GetStatus: STEPPED,
        GetRealStatus: STEPPED,
        GetIntegerStatus: STEPPED,
        GetBooleanStatus: STEPPED,
        GetStringStatus: STEPPED,
    }
    Some(Interface::ModelExchange) => {
        EnterEventMode: &[EventMode, ContinuousTimeMode],
        NewDiscreteStates: &[EventMode],
        EnterContinuousTimeMode: &[EventMode],
        CompletedIntegratorStep: &[ContinuousTimeMode],
        // In Event Mode that of a model without states, which need not leave it.
        SetTime: &[EventMode, ContinuousTimeMode],
        SetContinuousStates: &[ContinuousTimeMode],
        GetDerivatives: SOLVABLE,
        GetEventIndicators: SOLVABLE,
        GetContinuousStates: SOLVABLE,
        GetNominalsOfContinuousStates:
            &[Instantiated, InitializationMode, EventMode, ContinuousTimeMode, Terminated, Error],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_of_an_interface_are_called_in_its_states() {
        for function in Function::ALL {
            for phase in function.phases() {
                let (of_function, of_phase) = (function.interface(), phase.interface());
                assert!(
                    of_function.is_none() || of_phase.is_none() || of_function == of_phase,
                    "{function:?} in {phase}"
                );
            }
        }
    }
}
