//! The interface of boost control: what a plant and a controller exchange, whether an FMU offers it, and what it
//! is by the interface's names and units.
//!
//! The interface is what the descriptions of this repository's `BoostPlant` and `BoostController` say, a [`Port`]
//! for each variable. An FMU of another maker that takes the place of one of them may have other names and units;
//! a [`NameMap`] says which variable is which. A [`Compatibility`] is what was found of an FMU, and its
//! [`Translation`] is the FMU as its user may see it: like one that has the interface's names and units itself.

mod compatibility;
mod name_map;
mod translation;

use std::sync::LazyLock;

use clap::ValueEnum;
use fmu_package::{FmuDescription, FmuVariable, Kind, Unit};

pub use self::compatibility::{Compatibility, Match, Verdict};
pub use self::name_map::{Entry, Meaning, NameMap};
pub use self::translation::Translation;

/// The two places in the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The engine with its wastegate actuator
    Plant,
    /// What sets the wastegate's duty
    Controller,
}

/// A variable of the interface, seen from one of the two places.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// The variable as our FMU in this place declares it.
    pub variable: &'static FmuVariable,
    /// Whether the FMU in this place takes or gives it.
    pub kind: Kind,
    /// The variable of our FMU in the other place that it comes from or goes to. Where there is none, the
    /// system's environment gives or takes it, and an FMU can do without.
    pub counterpart: Option<&'static FmuVariable>,
}

impl Role {
    /// What our FMU in this place says of itself.
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

    /// The model identifier of our FMU in this place.
    #[must_use]
    pub fn model_identifier(self) -> &'static str {
        self.description().co_simulation_identifier().unwrap_or_default()
    }

    /// The other place.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Plant => Self::Controller,
            Self::Controller => Self::Plant,
        }
    }

    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
        }
    }

    /// The variables by which an FMU in this place is coupled.
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
    /// Whether it comes from, or goes to, the other place.
    #[must_use]
    pub fn couples(&self) -> bool {
        self.counterpart.is_some()
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
        let commands = ["hp_wastegate_pwm", "vacuum_pump", "lp_wastegate", "hp_bypass"];
        let measurements = ["boost_pressure", "tank_pressure", "supply_voltage_measured"];
        assert!(coupled(Role::Plant, Kind::Input).eq(commands));
        assert!(coupled(Role::Controller, Kind::Output).eq(commands));
        // The plant lists its outputs in another order.
        assert!(
            measurements.iter().all(|name| coupled(Role::Plant, Kind::Output).any(|other| other == *name))
        );
        assert_eq!(coupled(Role::Plant, Kind::Output).count(), measurements.len());
        assert!(coupled(Role::Controller, Kind::Input).eq(measurements));
    }
}
