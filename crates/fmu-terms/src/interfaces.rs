//! The FMI version, interfaces and precision of an export, and the environment variables by which a command passes them to
//! build scripts.

use core::fmt;

use crate::words::words;

/// The environment variable with the interfaces for which a build script generates, as the text of an [`Interfaces`];
/// co-simulation if unset.
pub const INTERFACES_VARIABLE: &str = "FMU_INTERFACES";

/// The environment variable with the FMI version for which a build script generates, as the text of a [`Version`]; 2.0
/// if unset.
pub const VERSION_VARIABLE: &str = "FMU_FMI_VERSION";

/// The environment variable with the precision for which a build script generates, as the text of a [`Precision`]; double
/// if unset.
pub const PRECISION_VARIABLE: &str = "FMU_PRECISION";

/// The precision of numbers, with the text `double` or `single`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// `f64`.
    #[default]
    Double,
    /// `f32`, in sampled models; what is integrated or differentiated needs `f64`.
    Single,
}

impl Precision {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Double, Self::Single];

    /// The text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Single => "single",
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
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

    /// The version that an `fmiVersion` in a modelDescription.xml declares, if known: `2.0`, or `3.` and what follows.
    #[must_use]
    pub fn declared(text: &str) -> Option<Self> {
        match text {
            "2.0" => Some(Self::Two),
            text if text == "3" || text.starts_with("3.") => Some(Self::Three),
            _ => None,
        }
    }

    /// The text.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Two => "2",
            Self::Three => "3",
        }
    }
}

impl fmt::Display for Version {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

words! {
    /// An interface of FMI, by the name of its element in modelDescription.xml; parsed from `cs`, `me` and `se`.
    pub enum Interface {
        /// The importer integrates the FMU's states.
        ModelExchange = "ModelExchange",
        /// The FMU steps itself.
        CoSimulation = "CoSimulation",
        /// The importer schedules the FMU's clocks. FMI 3.0 only.
        ScheduledExecution = "ScheduledExecution",
    }
}

impl Interface {
    /// The interface's name, for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ModelExchange => "Model Exchange",
            Self::CoSimulation => "co-simulation",
            Self::ScheduledExecution => "Scheduled Execution",
        }
    }
}

/// What an instance is for: an interface, of FMI 3.0 with the mode in which its importer handles events. Its text is for
/// people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstanceType {
    /// The FMU steps itself.
    CoSimulation,
    /// The FMU steps itself from event to event; the importer handles events (`eventModeUsed` of FMI 3.0).
    CoSimulationWithEvents,
    /// The importer integrates the FMU's states.
    ModelExchange,
    /// The importer schedules the FMU's clocks.
    ScheduledExecution,
}

impl InstanceType {
    /// Every type.
    pub const ALL: [Self; 4] =
        [Self::CoSimulation, Self::CoSimulationWithEvents, Self::ModelExchange, Self::ScheduledExecution];

    /// The interface whose functions instances of this type have.
    #[inline]
    #[must_use]
    pub const fn interface(self) -> Interface {
        match self {
            Self::CoSimulation | Self::CoSimulationWithEvents => Interface::CoSimulation,
            Self::ModelExchange => Interface::ModelExchange,
            Self::ScheduledExecution => Interface::ScheduledExecution,
        }
    }
}

impl fmt::Display for InstanceType {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::CoSimulation => "Co-Simulation",
            Self::CoSimulationWithEvents => "Co-Simulation with Event Mode",
            Self::ModelExchange => "Model Exchange",
            Self::ScheduledExecution => "Scheduled Execution",
        })
    }
}

/// The interfaces that an FMU offers, with the texts `cs`, `me`, `cs,me` and `se`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interfaces {
    /// Co-simulation.
    #[default]
    CoSimulation,
    /// Model Exchange.
    ModelExchange,
    /// Co-simulation and Model Exchange; the importer chooses one per instance.
    Both,
    /// Scheduled Execution alone, as in FMI 3.0 a clock affects all interfaces of its FMU (FMI 3.0.2, section 2.5.2).
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

    /// Whether an interface is included.
    #[must_use]
    pub const fn include(self, interface: Interface) -> bool {
        match interface {
            Interface::CoSimulation => matches!(self, Self::CoSimulation | Self::Both),
            Interface::ModelExchange => matches!(self, Self::ModelExchange | Self::Both),
            Interface::ScheduledExecution => matches!(self, Self::ScheduledExecution),
        }
    }

    /// Whether co-simulation is included.
    #[must_use]
    pub const fn co_simulation(self) -> bool {
        self.include(Interface::CoSimulation)
    }

    /// Whether Model Exchange is included.
    #[must_use]
    pub const fn model_exchange(self) -> bool {
        self.include(Interface::ModelExchange)
    }

    /// Whether Scheduled Execution is included.
    #[must_use]
    pub const fn scheduled_execution(self) -> bool {
        self.include(Interface::ScheduledExecution)
    }

    /// The interfaces' names, for people.
    #[must_use]
    pub fn names(self) -> &'static str {
        match self {
            Self::CoSimulation => Interface::CoSimulation.name(),
            Self::ModelExchange => Interface::ModelExchange.name(),
            Self::Both => "co-simulation and Model Exchange",
            Self::ScheduledExecution => Interface::ScheduledExecution.name(),
        }
    }
}

impl From<Interface> for Interfaces {
    fn from(interface: Interface) -> Self {
        match interface {
            Interface::CoSimulation => Self::CoSimulation,
            Interface::ModelExchange => Self::ModelExchange,
            Interface::ScheduledExecution => Self::ScheduledExecution,
        }
    }
}

impl fmt::Display for Interfaces {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}
