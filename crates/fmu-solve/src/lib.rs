#![doc = include_str!("../README.md")]
// What a sampled model is written against also runs where there is no operating system, without an allocator.
#![cfg_attr(target_os = "none", no_std)]
#![warn(clippy::std_instead_of_core)]

// The modules, of which each uses only those below it, as `tests/circles` checks:
//
//   integration                           how the equations of a model are integrated
//   event_loop, steady_state              from event to event, and starts at rest
//   tape                                  numbers with the derivatives of one result by many
//   integrator, stops                     the integrator, and where a communication step stops
//   search                                the first event in a step of the integrator
//   events                                when and why a model has an event
//   chosen                                constants by experiment
//   table, space                          tables for equations, and vectors and rotations
//   number                                numbers with derivatives
//   elementary                            the functions that core lacks
//   time                                  when two times are the same
//   persistence                           the bytes of a saved state
//   error
//   display                               numbers in messages
//
// Those from tables on are all there is without an operating system.

#[cfg(not(target_os = "none"))]
#[macro_use]
mod chosen;

pub mod display;
mod elementary;
mod error;
#[cfg(not(target_os = "none"))]
pub mod event_loop;
#[cfg(not(target_os = "none"))]
mod events;
#[cfg(not(target_os = "none"))]
mod integration;
#[cfg(not(target_os = "none"))]
pub mod integrator;
mod number;
pub mod persistence;
#[cfg(not(target_os = "none"))]
pub mod search;
pub mod space;
#[cfg(not(target_os = "none"))]
pub mod steady_state;
#[cfg(not(target_os = "none"))]
mod stops;
pub mod table;
#[cfg(not(target_os = "none"))]
mod tape;
pub mod time;

pub use elementary::Float;
pub use error::Error;
pub use number::{Dual, Number};
pub use persistence::Persistent;
#[cfg(not(target_os = "none"))]
pub use {
    events::{Event, Events, MOST_ITERATIONS, endless},
    integration::{DEFAULT_TOLERANCE, Integration},
    stops::{EventsLeft, Stop, Stops, due_until},
    tape::{Recorded, Tape},
};
