//! The FMI version and interfaces that an FMU offers. They are chosen at export, not declared.

use std::env::{self, VarError};
use std::str::FromStr;

use fmu_terms::{INTERFACES_VARIABLE, Interfaces, VERSION_VARIABLE, Version};

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
    pub(crate) fn macro_name(self) -> &'static str {
        match (self.version, self.interfaces) {
            (Version::Two, Interfaces::ModelExchange) => "fmi2_model_exchange",
            (Version::Two, Interfaces::Both) => "fmi2_both",
            (Version::Two, _) => "fmi2_co_simulation",
            // Every library has all functions.
            (Version::Three, _) => "fmi3_functions",
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
