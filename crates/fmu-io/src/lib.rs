#![doc = include_str!("../README.md")]

pub mod document;
pub mod exit;
pub mod reading;
pub mod temporary;
pub mod terminal;
pub mod threads;
pub mod writing;
