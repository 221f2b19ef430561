//! Loads FMUs of any maker, steps one or a coupled system, and records.

mod importer;
mod master;
pub mod measure;
mod name_map;
pub mod scenario;
pub mod system;

pub use importer::*;
pub use master::{LoadedFmus, Master, Run};
pub use name_map::{NameMap, ReadMap};
