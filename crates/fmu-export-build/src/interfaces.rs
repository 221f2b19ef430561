//! Which interfaces of FMI 2.0 an FMU offers: a choice of its export, not of its declaration.

use std::env::{self, VarError};
use std::fmt;
use std::str::FromStr;

/// The environment variable that names the interfaces of what [`generate`](crate::generate) generates, as the text of
/// an [`Interfaces`]; co-simulation when it is not set.
pub const INTERFACES_VARIABLE: &str = "FMU_INTERFACES";

/// The interfaces that an FMU offers (FMI 2.0.5, sections 3 and 4). Their texts are `cs`, `me` and `cs,me`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interfaces {
    /// The FMU steps by itself.
    #[default]
    CoSimulation,
    /// The importer integrates the FMU's states.
    ModelExchange,
    /// Both, of which the importer chooses one for each instance.
    Both,
}

impl Interfaces {
    /// Every choice.
    pub const ALL: [Self; 3] = [Self::CoSimulation, Self::ModelExchange, Self::Both];

    /// The text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::CoSimulation => "cs",
            Self::ModelExchange => "me",
            Self::Both => "cs,me",
        }
    }

    /// Whether co-simulation is among them.
    #[must_use]
    pub fn co_simulation(self) -> bool {
        self != Self::ModelExchange
    }

    /// Whether Model Exchange is among them.
    #[must_use]
    pub fn model_exchange(self) -> bool {
        self != Self::CoSimulation
    }

    /// Those that the environment asks for.
    pub(crate) fn of_environment() -> Result<Self, String> {
        match env::var(INTERFACES_VARIABLE) {
            Ok(text) => text.parse().map_err(|reason| format!("{INTERFACES_VARIABLE}: {reason}")),
            Err(VarError::NotPresent) => Ok(Self::default()),
            Err(error) => Err(format!("{INTERFACES_VARIABLE}: {error}")),
        }
    }

    /// The macro of `fmu-export` that makes their functions.
    pub(crate) fn macro_name(self) -> &'static str {
        match self {
            Self::CoSimulation => "fmi2_co_simulation",
            Self::ModelExchange => "fmi2_model_exchange",
            Self::Both => "fmi2_both",
        }
    }

    /// Their names, for people.
    pub(crate) fn names(self) -> &'static str {
        match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "Model Exchange",
            Self::Both => "co-simulation and Model Exchange",
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
            _ => Err(format!("'{text}' is not one of cs, me and cs,me")),
        }
    }
}

impl fmt::Display for Interfaces {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}
