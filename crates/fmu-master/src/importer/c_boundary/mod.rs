//! The C boundary: the functions of an FMU's library and the calls to them, with all `unsafe` code of the crate.
//!
//! A library is foreign code and cannot be verified. This module fulfills the importer's obligations in FMI: signatures
//! as declared by each version, valid pointers with their lengths, callbacks that outlive the instance (FMUs keep
//! pointers to them), no call after a fatal error, and no instance in two threads. A status is a plain number, because
//! a careless FMU may return any.
//!
//! What an instance can be asked for is in `interfaces`; `fmi2` and `fmi3` ask it by the functions of their version.
#![allow(unsafe_code)]

mod component;
mod fmi2;
mod fmi3;
mod interfaces;
mod last_call;
mod library;
mod live;
mod loaded;
mod logger;
pub mod process;
mod types;

pub use self::component::{Component, NotMade, Saved, UseOfEvents};
pub use self::interfaces::{
    Clocks, CoSimulation, Common, Dependency, EventHandling, Experiment, Handle, ModelExchange, Vector,
};
pub use self::live::when_an_fmu_exits;
pub use self::loaded::Loaded;
