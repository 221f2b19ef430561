#![doc = include_str!("../README.md")]

pub mod reading;
pub mod temporary;
pub mod terminal;
pub mod writing;
