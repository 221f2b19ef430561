//! The files that models and systems are exchanged in, for commands.
//!
//! Written: [`Fmu`], [`SystemPackage`]. Read, of any maker: [`archive::open`] and
//! [`ModelDescription`]. Both: [`ParameterSet`].

pub mod archive;
mod fmu;
mod model_description;
mod parameter_set;
mod system_structure;
mod units;

pub use fmu::{Fmu, Platform, documentation};
pub use model_description::{Enumeration, ModelDescription, Variable};
pub use parameter_set::{Parameter, ParameterSet, Value};
pub use system_structure::{
    Component, Connection, Connector, End, Kind, Placement, System, SystemPackage, SystemStructure,
};
pub use units::{BaseUnit, DisplayUnit, Linear, Unit};
