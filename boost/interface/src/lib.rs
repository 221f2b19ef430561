//! The interface of boost control: the variables that plant and controller exchange, the check of an FMU against
//! them, and the FMU's description in the interface's names and units.
//!
//! The descriptions of this repository's `BoostPlant` and `BoostController` define the [`Interface`], a [`Port`] for
//! each variable. An FMU from another tool that replaces one of them may have other names and units;
//! [connections](fmu_package::connection) of the system say which. A [`Compatibility`] is the result of the check, and a
//! [`Translation`] describes the FMU as if it had the interface's names and units.

mod choice;
mod compatibility;
mod connections;
mod likeness;
mod table;
mod translation;
mod units;

use std::io;

use clap::ValueEnum;
use fmu_package::{FmuDescription, FmuVariable, Function, Kind, Unit};

pub use self::compatibility::{Compatibility, Match, Verdict};
pub use self::translation::Translation;

/// Optional variables, which are connected if both FMUs have them.
const OPTIONAL: [&str; 2] = ["hp_turbo_speed", "surge_valve"];

/// The two roles in the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// The engine with its wastegate actuator
    Plant,
    /// What sets the wastegate's duty
    Controller,
}

impl Role {
    /// The opposite role.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Plant => Self::Controller,
            Self::Controller => Self::Plant,
        }
    }

    /// The name of the role in commands and connections.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plant => "plant",
            Self::Controller => "controller",
        }
    }
}

/// What the FMUs in both roles have in common.
#[derive(Clone, Debug)]
pub struct Interface {
    plant: FmuDescription,
    controller: FmuDescription,
}

impl Interface {
    /// The interface of two FMUs, from the texts of their modelDescription.xml.
    ///
    /// # Errors
    /// When one of them is not a description.
    pub fn new(plant: &str, controller: &str) -> io::Result<Self> {
        Ok(Self { plant: FmuDescription::parse(plant)?, controller: FmuDescription::parse(controller)? })
    }

    /// The description of the FMU in a role.
    #[must_use]
    pub fn description(&self, role: Role) -> &FmuDescription {
        match role {
            Role::Plant => &self.plant,
            Role::Controller => &self.controller,
        }
    }

    /// The model identifier of the FMU in a role.
    #[must_use]
    pub fn model_identifier(&self, role: Role) -> &str {
        self.description(role).co_simulation_identifier().unwrap_or_default()
    }

    /// A unit by name.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<Unit> {
        self.plant.unit(name).or_else(|| self.controller.unit(name))
    }

    /// The variables that couple an FMU in a role.
    pub fn ports(&self, role: Role) -> impl Iterator<Item = Port<'_>> {
        let ports = move |kind: Kind, counterpart: Kind| {
            self.description(role).of_causality(kind.causality()).map(move |variable| Port {
                interface: self,
                variable,
                kind,
                counterpart: self
                    .description(role.other())
                    .of_causality(counterpart.causality())
                    .find(|other| other.name == variable.name),
            })
        };
        ports(Kind::Input, Kind::Output).chain(ports(Kind::Output, Kind::Input))
    }
}

/// A variable of the interface, seen from one of the two roles.
#[derive(Clone, Copy, Debug)]
pub struct Port<'i> {
    /// The interface.
    pub interface: &'i Interface,
    /// The variable as our FMU in this role declares it.
    pub variable: &'i FmuVariable,
    /// The variable's kind at the FMU in this role.
    pub kind: Kind,
    /// The connected variable of our FMU in the other role. If there is none, the port connects to the environment of
    /// the system and is optional.
    pub counterpart: Option<&'i FmuVariable>,
}

impl<'i> Port<'i> {
    /// Whether the other FMU has the variable, too.
    #[must_use]
    pub fn couples(&self) -> bool {
        self.counterpart.is_some()
    }

    /// The conversion to the interface's values, by that in the direction of the signal.
    pub(crate) fn to_interface(self, conversion: &Function) -> Function {
        match self.kind {
            Kind::Input => conversion.clone().inverse(),
            Kind::Output => conversion.clone(),
        }
    }

    /// Whether a connection can lead to or from the port.
    #[must_use]
    pub fn is_connectable(&self) -> bool {
        self.couples() || self.kind == Kind::Input
    }

    /// Whether an FMU in this role must have the variable.
    #[must_use]
    pub fn is_required(&self) -> bool {
        self.couples() && !OPTIONAL.contains(&self.name())
    }

    /// The name in the interface.
    #[must_use]
    pub fn name(&self) -> &'i str {
        &self.variable.name
    }

    /// The unit in the interface.
    #[must_use]
    pub fn unit(&self) -> Unit {
        let name = &self.variable.unit;
        self.interface.unit(name).unwrap_or_else(|| Unit::undefined(name))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use fmu_io::document::Document;
    use fmu_package::connection::{self, Connection};

    use super::*;

    /// The interface of this repository's FMUs.
    pub(crate) static INTERFACE: LazyLock<Interface> = LazyLock::new(|| {
        let [plant, controller] = boost_fmu::DESCRIPTIONS;
        Interface::new(plant, controller).unwrap()
    });

    /// Connections, as a list in TOML.
    pub(crate) fn connected(list: &str) -> Vec<Connection> {
        let text = format!("connection = [{list}]");
        let document = Document::parse("loop.toml", &text).unwrap();
        connection::list(&document.root().required("connection", "connections").unwrap()).unwrap()
    }

    #[test]
    fn the_interface_is_what_both_descriptions_have_in_common() {
        let coupled = |role: Role, kind| {
            INTERFACE
                .ports(role)
                .filter(move |port| port.couples() && port.kind == kind)
                .map(|port| port.name())
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
            |role: Role| INTERFACE.ports(role).filter(|port| port.couples() && !port.is_required()).count();
        assert_eq!([Role::Plant, Role::Controller].map(can_be_missing), [OPTIONAL.len(); 2]);
    }
}
