//! Versions, interfaces and precisions from the texts that commands and build scripts have.

use core::str::FromStr;

use crate::interfaces::{Interface, Interfaces, Precision, Version};

impl FromStr for Version {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|version| version.as_str() == text);
        known.ok_or_else(|| format!("'{text}' is not one of 2 and 3"))
    }
}

impl FromStr for Interface {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "cs" => Ok(Self::CoSimulation),
            "me" => Ok(Self::ModelExchange),
            "se" => Ok(Self::ScheduledExecution),
            _ => Err(format!("'{text}' is not one of cs, me and se")),
        }
    }
}

impl FromStr for Interfaces {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = if text == "me,cs" { "cs,me" } else { text };
        let known = Self::ALL.into_iter().find(|interfaces| interfaces.as_str() == wanted);
        known.ok_or_else(|| format!("'{text}' is not one of cs, me, cs,me and se"))
    }
}

impl FromStr for Precision {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|precision| precision.as_str() == text);
        known.ok_or_else(|| format!("'{text}' is not one of double and single"))
    }
}
