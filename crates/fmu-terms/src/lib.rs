#![doc = include_str!("../README.md")]
#![cfg_attr(target_os = "none", no_std)]
#![warn(clippy::std_instead_of_core)]

mod cells;
mod identifier;
mod interfaces;
#[cfg(feature = "units")]
mod likeness;
mod names;
#[cfg(not(target_os = "none"))]
mod parsing;
#[cfg(feature = "units")]
mod units;
mod variables;
mod words;

pub use cells::{CELL, has_cell};
pub use identifier::{is_identifier, is_reserved_by_windows};
pub use interfaces::{
    INTERFACES_VARIABLE, InstanceType, Interface, Interfaces, PRECISION_VARIABLE, Precision,
    VERSION_VARIABLE, Version,
};
#[cfg(feature = "units")]
pub use likeness::{like, nearest};
pub use names::is_structured;
#[cfg(feature = "units")]
pub use units::{BASE_UNITS, BaseUnit, DisplayUnit, Linear, Unit, UnitTable, per_second, spelled};
pub use variables::{Causality, DataType, Initial, IntervalVariability, MatchingRule, Variability};
pub use words::Word;
