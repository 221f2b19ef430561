//! The FMI version and interfaces that an FMU offers, and its precision. They are chosen at export, not declared.

use std::env::{self, VarError};
use std::path::Path;
use std::str::FromStr;

use fmu_terms::{INTERFACES_VARIABLE, Interfaces, PRECISION_VARIABLE, Precision, VERSION_VARIABLE, Version};

use crate::declaration::Declaration;
use crate::source::Source;

/// The FMI version and interfaces of an FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fmi {
    /// The version of the standard.
    pub version: Version,
    /// The interfaces of the FMU.
    pub interfaces: Interfaces,
}

impl From<Interfaces> for Fmi {
    fn from(interfaces: Interfaces) -> Self {
        Self { interfaces, ..Self::default() }
    }
}

impl Fmi {
    /// The choice for the model of a declaration: what is given, else that of the environment variables
    /// [`VERSION_VARIABLE`] and [`INTERFACES_VARIABLE`], else the least version with the model's types, for co-simulation.
    ///
    /// # Errors
    /// When an environment variable has none of the values.
    pub fn chosen(
        declaration: &Path,
        version: Option<Version>,
        interfaces: Option<Interfaces>,
    ) -> Result<Self, String> {
        // A file that cannot be read is reported when it is generated from.
        let least = || match Source::read::<Declaration>(declaration) {
            Ok((declaration, _)) if declaration.needs_fmi3() => Version::Three,
            _ => Version::default(),
        };
        let version =
            version.map_or_else(|| of_environment(VERSION_VARIABLE), |version| Ok(Some(version)))?;
        let interfaces = interfaces
            .map_or_else(|| of_environment(INTERFACES_VARIABLE), |interfaces| Ok(Some(interfaces)))?;
        Ok(Self { version: version.unwrap_or_else(least), interfaces: interfaces.unwrap_or_default() })
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

/// The precision: what is given, else that of the environment variable [`PRECISION_VARIABLE`], else double.
///
/// # Errors
/// When the environment variable has none of the values.
pub fn chosen_precision(precision: Option<Precision>) -> Result<Precision, String> {
    precision.map_or_else(|| of_environment(PRECISION_VARIABLE).map(Option::unwrap_or_default), Ok)
}

/// An environment variable's choice, if it is set.
fn of_environment<T: FromStr<Err = String>>(variable: &str) -> Result<Option<T>, String> {
    match env::var(variable) {
        Ok(text) => text.parse().map(Some).map_err(|reason| format!("{variable}: {reason}")),
        Err(VarError::NotPresent) => Ok(None),
        Err(error) => Err(format!("{variable}: {error}")),
    }
}
