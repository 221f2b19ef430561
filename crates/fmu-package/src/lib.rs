//! Files for exchanging models and systems.
//!
//! Written: [`Fmu`], [`SystemPackage`], [`PlatformList`]. Read, from any tool: [`archive::open`], [`FmuDescription`],
//! [`SystemDescription`] and [`Library`]. Both: [`ParameterSet`], [checked](ParameterSet::fit) against an FMU, [`Merged`]
//! FMUs, and [`connection`]s between FMUs.

pub mod archive;
mod build_description;
pub mod connection;
mod declared;
mod domain;
mod elements;
mod firmware;
mod fmu;
mod functions;
mod identifier;
pub mod library;
mod merge;
mod model_description;
mod parameter_fit;
mod parameter_mapping;
mod parameter_set;
mod platform;
mod platform_list;
mod system_description;
mod system_structure;
mod transformation;
mod units;
mod variable;
mod variables;
pub mod xml;

pub use build_description::{BuildConfiguration, SourceFileSet, StaticLibrary};
pub use declared::Declared;
pub use domain::Domain;
pub use elements::{DescriptionElements, StructureElement};
pub use firmware::a2l_of_firmware;
pub use fmu::Fmu;
pub use fmu_terms::{BaseUnit, Causality, DisplayUnit, Linear, Unit, Version};
pub use functions::functions;
pub use identifier::refuse_no_identifier;
pub use library::Library;
pub use merge::{Merged, Part};
pub use model_description::{Enumeration, FmuDescription, MODEL_DESCRIPTION, refuse_fmi1};
pub use parameter_mapping::{MappingEntry, ParameterMapping};
pub use parameter_set::{Parameter, ParameterSet, Value};
pub use platform::{Architecture, Format, Platform};
pub use platform_list::PlatformList;
pub use system_description::{
    ComponentKind, ConnectionDescription, ConnectorDescription, Content, ElementDescription,
    ParameterBinding, Resource, SystemDescription,
};
pub use system_structure::{
    Connection, Connector, DEFAULT_STRUCTURE, End, Kind, Placement, System, SystemComponent, SystemPackage,
    SystemStructure,
};
pub use transformation::{Function, Transformation};
pub use units::{is_known_unit, unit_conversion};
pub use variable::{Dimension, Element, FmuVariable, ValueType, VariableElement};
pub use variables::Variables;
pub use xml::read_xml;
