//! The map from another tool's FMU variables to the interface: a JSON file, written by `check` as a template for the
//! user to edit.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail};
use fmu_io::reading;
use fmu_io::terminal::number;
use fmu_package::{FmuDescription, Linear, Unit};
use serde::{Deserialize, Serialize};

use crate::{Interface, Port, Role};

/// The content of a map's file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NameMap {
    /// The role of the FMU.
    #[serde(rename = "as")]
    pub role: Role,
    /// The FMU's `modelName`.
    pub fmu: String,
    /// By the name in the interface: the FMU's variable, or null to leave it unconnected.
    pub variables: BTreeMap<String, Option<Entry>>,
}

/// One of the FMU's variables.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its name; empty in a template.
    pub name: String,
    /// Its unit, if the FMU declares none or a wrong one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Instead of a unit: value in the interface = factor · value in the FMU + offset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<f64>,
    /// See `factor`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Similar names, most similar first, if `name` is a proposal; for the user who edits the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<String>,
}

/// An entry's conversion to the interface.
pub enum Meaning {
    /// None: the FMU's declaration applies.
    Declared,
    /// The unit of the FMU's values.
    Unit(Unit),
    /// The function from the FMU's values to the interface's.
    Function(Linear),
}

impl NameMap {
    /// Reads a file.
    ///
    /// # Errors
    /// When it cannot be read, is not a map, names a variable that the interface does not have, or leaves a name open.
    pub fn read(interface: &Interface, path: &Path) -> Result<Self> {
        let shown = path.display();
        let text = reading::text(path)?;
        let map: Self =
            serde_json::from_str(&text).with_context(|| format!("the map {shown} is not valid"))?;
        let ports: Vec<_> = interface.ports(map.role).map(|port| port.name()).collect();
        for (name, entry) in &map.variables {
            if !ports.contains(&name.as_str()) {
                bail!(
                    "the map {shown} names {name}, which is not a variable of a {}: there are {}",
                    map.role.name(),
                    ports.join(", ")
                );
            }
            if let Some(entry) = entry
                && entry.name.is_empty()
            {
                bail!(
                    "the map {shown} leaves the name for {name} open; fill it in, or put null in the \
                     entry's place to leave {name} unconnected"
                );
            }
        }
        Ok(map)
    }

    /// The interface's names for which the map proposes a similar name of the FMU.
    pub fn proposed(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().filter_map(|(name, entry)| {
            entry.as_ref().is_some_and(|entry| !entry.candidates.is_empty()).then_some(name.as_str())
        })
    }

    /// The file's content.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn to_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self).context("cannot write the map")? + "\n")
    }
}

impl Entry {
    /// The conversion that the entry gives for a port; its unit is one of the interface or of the FMU.
    ///
    /// # Errors
    /// When it contradicts itself, or its unit is not known.
    pub fn meaning(&self, port: &Port<'_>, fmu: &FmuDescription) -> Result<Meaning, String> {
        match (&self.unit, self.factor, self.offset) {
            (Some(_), Some(_), _) | (Some(_), _, Some(_)) => {
                Err("the map gives both a unit and a factor or offset".to_owned())
            }
            (Some(unit), None, None) => port
                .unit()
                .with_display_units()
                .find(|known| known.name == *unit)
                .or_else(|| fmu.unit(unit))
                .or_else(|| port.interface.unit(unit))
                .map(Meaning::Unit)
                .ok_or_else(|| {
                    format!("the map's unit {unit} is not known; give a factor and an offset instead")
                }),
            (None, None, None) => Ok(Meaning::Declared),
            (None, factor, offset) => {
                let function = Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) };
                if function.factor == 0.0 || !function.factor.is_finite() || !function.offset.is_finite() {
                    return Err(format!(
                        "the map's factor {} and offset {} are not a conversion",
                        number(function.factor),
                        number(function.offset)
                    ));
                }
                Ok(Meaning::Function(function))
            }
        }
    }
}
