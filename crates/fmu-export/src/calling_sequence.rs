//! The order in which an importer may call: the state machine of FMI 2.0.5, section 4.2.4, as data.
//!
//! The standard's states `stepInProgress`, `stepFailed` and `stepCanceled` do not occur, since steps are neither
//! asynchronous nor discarded, and neither does `fatal`, since an error never affects another instance.

use std::fmt;

use crate::error;
use crate::persistence::{Archive, Persistent};

/// The states of a co-simulation slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    InitializationMode,
    /// Between steps.
    StepComplete,
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
            Self::Terminated => "terminated",
            Self::Error => "error",
        })
    }
}

impl Persistent for Phase {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), error::Error> {
        let mut number = *self as u8;
        number.persist(archive)?;
        let known = ANY.iter().find(|&&phase| phase as u8 == number);
        *self = *known.ok_or_else(|| error::Error::new(format!("{number} is not a state of a slave")))?;
        Ok(())
    }
}

use Phase::{Error, InitializationMode, Instantiated, StepComplete, Terminated};

/// Any state.
const ANY: &[Phase] = &[Instantiated, InitializationMode, StepComplete, Terminated, Error];
/// The states in which values can be read.
const READABLE: &[Phase] = &[InitializationMode, StepComplete, Terminated, Error];
/// The states in which values can be set; section 4.2.4 restricts the variables further.
const WRITABLE: &[Phase] = &[Instantiated, InitializationMode, StepComplete];

/// Declares the functions that take an instance, each with the states in which it may be called.
macro_rules! functions {
    ($($name:ident: $phases:expr,)*) => {
        /// A function of the standard that takes an instance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)]
        pub enum Function {
            $($name,)*
        }

        impl Function {
            /// Every function.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// The name in the standard.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => concat!("fmi2", stringify!($name)),)*
                }
            }

            /// The states in which it may be called.
            #[must_use]
            pub const fn phases(self) -> &'static [Phase] {
                match self {
                    $(Self::$name => $phases,)*
                }
            }
        }
    };
}

functions! {
    SetDebugLogging: ANY,
    SetupExperiment: &[Instantiated],
    EnterInitializationMode: &[Instantiated],
    ExitInitializationMode: &[InitializationMode],
    Terminate: &[StepComplete],
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
    SetRealInputDerivatives: WRITABLE,
    GetRealOutputDerivatives: &[StepComplete, Terminated, Error],
    DoStep: &[StepComplete],
    CancelStep: &[],
    GetStatus: &[StepComplete, Terminated],
    GetRealStatus: &[StepComplete, Terminated],
    GetIntegerStatus: &[StepComplete, Terminated],
    GetBooleanStatus: &[StepComplete, Terminated],
    GetStringStatus: &[StepComplete, Terminated],
}
