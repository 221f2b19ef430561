//! The FMI version and interfaces that an FMU offers: a choice of its export, not its declaration.

use std::env::{self, VarError};
use std::fmt;
use std::str::FromStr;

use crate::declaration::Declaration;

/// The environment variable with the interfaces that [`generate`](crate::generate) generates, as the text of an
/// [`Interfaces`]; co-simulation if unset.
pub const INTERFACES_VARIABLE: &str = "FMU_INTERFACES";

/// The environment variable with the FMI version that [`generate`](crate::generate) generates, as the text of a
/// [`Version`]; 2.0 if unset.
pub const VERSION_VARIABLE: &str = "FMU_FMI_VERSION";

/// The FMI version and interfaces of an FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fmi {
    /// The version of the standard.
    pub version: Version,
    /// Its interfaces.
    pub interfaces: Interfaces,
}

impl From<Interfaces> for Fmi {
    fn from(interfaces: Interfaces) -> Self {
        Self { interfaces, ..Self::default() }
    }
}

impl Fmi {
    /// The environment's choice.
    pub(crate) fn of_environment() -> Result<Self, String> {
        Ok(Self {
            version: of_environment(VERSION_VARIABLE)?,
            interfaces: of_environment(INTERFACES_VARIABLE)?,
        })
    }

    /// Rejects interfaces that the version lacks.
    pub(crate) fn check(self) -> Result<Self, String> {
        if self.version == Version::Two && self.interfaces.scheduled_execution() {
            Err("Scheduled Execution exists in FMI 3.0 only, but the export is for FMI 2.0; use `--fmi 3`"
                .to_owned())
        } else {
            Ok(self)
        }
    }

    /// The macro of `fmu-export` that defines a model's functions.
    pub(crate) fn macro_name(self, declaration: &Declaration) -> &'static str {
        let has_event_mode = declaration.capabilities.event_mode;
        match (self.version, self.interfaces) {
            (_, Interfaces::ScheduledExecution)
                if declaration.clock.is_none() && !declaration.has_clocks() =>
            {
                "fmi3_without_clock"
            }
            (_, Interfaces::ScheduledExecution) => "fmi3_scheduled_execution",
            (Version::Two, Interfaces::CoSimulation) => "fmi2_co_simulation",
            (Version::Two, Interfaces::ModelExchange) => "fmi2_model_exchange",
            (Version::Two, Interfaces::Both) => "fmi2_both",
            (Version::Three, Interfaces::CoSimulation | Interfaces::Both) if has_event_mode => {
                "fmi3_event_mode"
            }
            (Version::Three, Interfaces::CoSimulation) => "fmi3_co_simulation",
            // Every library has all functions.
            (Version::Three, Interfaces::ModelExchange | Interfaces::Both) => "fmi3_model_exchange",
        }
    }
}

/// An environment variable's choice.
fn of_environment<T: Default + FromStr<Err = String>>(variable: &str) -> Result<T, String> {
    match env::var(variable) {
        Ok(text) => text.parse().map_err(|reason| format!("{variable}: {reason}")),
        Err(VarError::NotPresent) => Ok(T::default()),
        Err(error) => Err(format!("{variable}: {error}")),
    }
}

/// An FMI version, with the text `2` or `3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Version {
    /// FMI 2.0.
    #[default]
    Two,
    /// FMI 3.0.
    Three,
}

impl Version {
    /// Every version.
    pub const ALL: [Self; 2] = [Self::Two, Self::Three];

    /// The text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Two => "2",
            Self::Three => "3",
        }
    }
}

impl FromStr for Version {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|version| version.as_str() == text);
        known.ok_or_else(|| format!("'{text}' is not one of 2 and 3"))
    }
}

impl fmt::Display for Version {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

/// The interfaces that an FMU offers, with the texts `cs`, `me`, `cs,me` and `se`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interfaces {
    /// The FMU steps itself.
    #[default]
    CoSimulation,
    /// The importer integrates the FMU's states.
    ModelExchange,
    /// Both; the importer chooses one per instance.
    Both,
    /// The importer schedules the FMU's clock, in FMI 3.0: no other interface, as a clock affects all interfaces of
    /// its FMU (FMI 3.0.2, section 2.5.2).
    ScheduledExecution,
}

impl Interfaces {
    /// Every choice.
    pub const ALL: [Self; 4] =
        [Self::CoSimulation, Self::ModelExchange, Self::Both, Self::ScheduledExecution];

    /// The text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::CoSimulation => "cs",
            Self::ModelExchange => "me",
            Self::Both => "cs,me",
            Self::ScheduledExecution => "se",
        }
    }

    /// Whether they include co-simulation.
    #[must_use]
    pub fn co_simulation(self) -> bool {
        matches!(self, Self::CoSimulation | Self::Both)
    }

    /// Whether they include Model Exchange.
    #[must_use]
    pub fn model_exchange(self) -> bool {
        matches!(self, Self::ModelExchange | Self::Both)
    }

    /// Whether they include Scheduled Execution.
    #[must_use]
    pub fn scheduled_execution(self) -> bool {
        self == Self::ScheduledExecution
    }

    /// Their names, for people.
    pub(crate) fn names(self) -> &'static str {
        match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "Model Exchange",
            Self::Both => "co-simulation and Model Exchange",
            Self::ScheduledExecution => "Scheduled Execution",
        }
    }
}

impl FromStr for Interfaces {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "cs" => Ok(Self::CoSimulation),
            "me" => Ok(Self::ModelExchange),
            "cs,me" | "me,cs" => Ok(Self::Both),
            "se" => Ok(Self::ScheduledExecution),
            _ => Err(format!("'{text}' is not one of cs, me, cs,me and se")),
        }
    }
}

impl fmt::Display for Interfaces {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}
