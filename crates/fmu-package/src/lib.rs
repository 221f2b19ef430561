//! Files for exchanging models and systems.
//!
//! Written: [`Fmu`], [`SystemPackage`], [`PlatformList`]. Read, from any tool: [`archive::open`], [`FmuDescription`],
//! [`SystemDescription`] and [`Library`]; [`validation`] finds errors in an FMU. Both: [`ParameterSet`],
//! [checked](ParameterSet::fit) against an FMU, and [`Merged`] FMUs.
//!
//! Shared by all commands: [`reading`], [`writing`], [`temporary`] and [`terminal`].

pub mod archive;
mod fmu;
pub mod library;
mod likeness;
mod merge;
mod model_description;
mod parameter_fit;
mod parameter_set;
mod platform;
mod platform_list;
pub mod reading;
mod system_description;
mod system_structure;
pub mod temporary;
pub mod terminal;
mod translation;
mod units;
pub mod validation;
pub mod writing;

pub use fmu::Fmu;
pub use library::Library;
pub use likeness::like;
pub use merge::{Merged, Part};
pub use model_description::{
    Dimension, Element, Enumeration, FmuDescription, FmuVariable, ValueType, is_identifier,
};
pub use parameter_set::{Parameter, ParameterSet, Value};
pub use platform::Platform;
pub use platform_list::PlatformList;
pub use system_description::{
    ComponentDescription, ConnectionDescription, ConnectorDescription, SystemDescription,
};
pub use system_structure::{
    Connection, Connector, End, Kind, Placement, System, SystemComponent, SystemPackage, SystemStructure,
};
pub use translation::Translation;
pub use units::{BaseUnit, DisplayUnit, Linear, Unit};
