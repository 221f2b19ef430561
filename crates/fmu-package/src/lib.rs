//! The files that models and systems are exchanged in, for commands.
//!
//! Written: [`Fmu`], [`SystemPackage`], [`PlatformList`]. Read, of any maker: [`archive::open`],
//! [`FmuDescription`] and [`Library`]; [`validation`] finds what is wrong in an FMU. Both: [`ParameterSet`], which [fits](ParameterSet::fit) an FMU or does not,
//! and FMUs that are [`Merged`].
//!
//! How files are read and written, and what of them is printed, is the same for all commands: [`reading`], [`writing`],
//! [`temporary`] and [`terminal`].

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
mod system_structure;
pub mod temporary;
pub mod terminal;
mod units;
pub mod validation;
pub mod writing;

pub use fmu::Fmu;
pub use library::Library;
pub use likeness::like;
pub use merge::{Merged, Part};
pub use model_description::{Enumeration, FmuDescription, FmuVariable};
pub use parameter_set::{Parameter, ParameterSet, Value};
pub use platform::Platform;
pub use platform_list::PlatformList;
pub use system_structure::{
    Connection, Connector, End, Kind, Placement, System, SystemComponent, SystemPackage, SystemStructure,
};
pub use units::{BaseUnit, DisplayUnit, Linear, Unit};
