//! The interface of boost control: the variables that plant and controller exchange, the check of an FMU against
//! them, and the FMU's description in the interface's names and units.
//!
//! The descriptions of this repository's `BoostPlant` and `BoostController` define the interface, a [`Port`] for
//! each variable. An FMU from another tool that replaces one of them may have other names and units; a [`NameMap`]
//! maps them. A [`Compatibility`] is the result of the check, and a [`Translation`](fmu_package::Translation) describes the FMU as if it had
//! the interface's names and units.

mod compatibility;
mod name_map;
mod translation;

use std::sync::LazyLock;

use clap::ValueEnum;
use fmu_package::{FmuDescription, FmuVariable, Kind, Unit};

pub use self::compatibility::{Compatibility, Match, Verdict};
pub use self::name_map::{Entry, Meaning, NameMap};

/// Optional variables, coupled if both FMUs have them.
const OPTIONAL: [&str; 2] = ["hp_turbo_speed", "surge_valve"];

/// The two roles in the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The engine with its wastegate actuator
    Plant,
    /// What sets the wastegate's duty
    Controller,
}

/// A variable of the interface, seen from one of the two roles.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// The variable as our FMU in this role declares it.
    pub variable: &'static FmuVariable,
    /// Its kind at the FMU in this role.
    pub kind: Kind,
    /// The connected variable of our FMU in the other role. Without one it connects to the system's environment and is
    /// optional.
    pub counterpart: Option<&'static FmuVariable>,
}

impl Role {
    /// The description of our FMU in this role.
    ///
    /// # Panics
    /// Never: the build generated it.
    #[must_use]
    pub fn description(self) -> &'static FmuDescription {
        static PLANT: LazyLock<FmuDescription> =
            LazyLock::new(|| own(include_str!(concat!(env!("OUT_DIR"), "/BoostPlant/modelDescription.xml"))));
        static CONTROLLER: LazyLock<FmuDescription> = LazyLock::new(|| {
            own(include_str!(concat!(env!("OUT_DIR"), "/BoostController/modelDescription.xml")))
        });
        match self {
            Self::Plant => &PLANT,
            Self::Controller => &CONTROLLER,
        }
    }

    /// The model identifier of our FMU in this role.
    #[must_use]
    pub fn model_identifier(self) -> &'static str {
        self.description().co_simulation_identifier().unwrap_or_default()
    }

    /// The other role.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Plant => Self::Controller,
            Self::Controller => Self::Plant,
        }
    }

    /// The name of the role in commands and maps.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
        }
    }

    /// The variables that couple an FMU in this role.
    pub fn ports(self) -> impl Iterator<Item = Port> {
        let ports = |causality: &'static str, kind, counterpart: &'static str| {
            self.description().of_causality(causality).map(move |variable| Port {
                variable,
                kind,
                counterpart: self
                    .other()
                    .description()
                    .of_causality(counterpart)
                    .find(|other| other.name == variable.name),
            })
        };
        ports("input", Kind::Input, "output").chain(ports("output", Kind::Output, "input"))
    }
}

impl Port {
    /// Whether the other FMU has it too.
    #[must_use]
    pub fn couples(&self) -> bool {
        self.counterpart.is_some()
    }

    /// Whether an FMU in this role must have it.
    #[must_use]
    pub fn is_required(&self) -> bool {
        self.couples() && !OPTIONAL.contains(&self.name())
    }

    /// The name in the interface.
    #[must_use]
    pub fn name(&self) -> &'static str {
        &self.variable.name
    }

    /// The unit in the interface.
    #[must_use]
    pub fn unit(&self) -> Unit {
        [Role::Plant, Role::Controller]
            .iter()
            .find_map(|role| role.description().unit(&self.variable.unit))
            .unwrap_or_else(|| Unit { name: self.variable.unit.clone(), base: None, display_units: vec![] })
    }
}

fn own(xml: &str) -> FmuDescription {
    FmuDescription::parse(xml).expect("the build generated this description")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interface_is_what_both_descriptions_have_in_common() {
        let coupled = |role: Role, kind| {
            role.ports().filter(move |port| port.couples() && port.kind == kind).map(|port| port.name())
        };
        let commands = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass", "surge_valve"];
        let measurements = ["boost_pressure", "tank_pressure", "supply_voltage_measured", "hp_turbo_speed"];
        assert!(coupled(Role::Plant, Kind::Input).eq(commands));
        assert!(coupled(Role::Controller, Kind::Output).eq(commands));
        // The plant lists its outputs in another order.
        assert!(
            measurements.iter().all(|name| coupled(Role::Plant, Kind::Output).any(|other| other == *name))
        );
        assert_eq!(coupled(Role::Plant, Kind::Output).count(), measurements.len());
        assert!(coupled(Role::Controller, Kind::Input).eq(measurements));
        let can_be_missing =
            |role: Role| role.ports().filter(|port| port.couples() && !port.is_required()).count();
        assert_eq!([Role::Plant, Role::Controller].map(can_be_missing), [OPTIONAL.len(); 2]);
    }
}
