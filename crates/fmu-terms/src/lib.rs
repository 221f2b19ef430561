#![doc = include_str!("../README.md")]

mod interfaces;
mod likeness;
mod units;

pub use interfaces::{INTERFACES_VARIABLE, Interfaces, VERSION_VARIABLE, Version};
pub use likeness::{like, nearest};
pub use units::{BASE_UNITS, BaseUnit, DisplayUnit, Linear, Unit, UnitTable, per_second, spelled};
