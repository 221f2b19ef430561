//! Files for exchanging models and systems.
//!
//! Written: [`Fmu`], [`SystemPackage`], [`PlatformList`]. Read, from any tool: [`archive::open`], [`FmuDescription`],
//! [`SystemDescription`] and [`Library`]; [`validation`] finds errors in an FMU. Both: [`ParameterSet`],
//! [checked](ParameterSet::fit) against an FMU, [`Merged`] FMUs, and [`connection`]s between FMUs.

pub mod archive;
pub mod connection;
mod declared;
mod fmu;
mod identifier;
pub mod library;
mod merge;
mod model_description;
mod parameter_fit;
mod parameter_set;
mod platform;
mod platform_list;
mod system_description;
mod system_structure;
mod units;
pub mod validation;
mod variable;
mod variables;
mod xml;

pub use declared::Declared;
pub use fmu::Fmu;
pub use fmu_terms::{BaseUnit, Causality, DisplayUnit, Linear, Unit};
pub use identifier::refuse_no_identifier;
pub use library::Library;
pub use merge::{Merged, Part};
pub use model_description::{Enumeration, FmuDescription};
pub use parameter_set::{Parameter, ParameterSet, Value};
pub use platform::{Architecture, Format, Platform};
pub use platform_list::PlatformList;
pub use system_description::{
    ComponentDescription, ConnectionDescription, ConnectorDescription, SystemDescription,
};
pub use system_structure::{
    Connection, Connector, End, Kind, Placement, System, SystemComponent, SystemPackage, SystemStructure,
};
pub use units::unit_conversion;
pub use variable::{Dimension, Element, FmuVariable, ValueType};
pub use variables::Variables;
