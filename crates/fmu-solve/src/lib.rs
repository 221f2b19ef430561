#![doc = include_str!("../README.md")]
// The equations of models may one day run without the standard library.
#![warn(clippy::std_instead_of_core)]

// The modules, of which each uses only those below it, as `tests/circles` checks:
//
//   integration                           how the equations of a model are integrated
//   event_loop, steady_state              from event to event, and starts at rest
//   tape                                  numbers with the derivatives of one result by many
//   integrator, stops                     the integrator, and where a communication step stops
//   search                                the first event in a step of the integrator
//   events                                when and why a model has an event
//   table, space                          tables for equations, and vectors and rotations
//   number                                numbers with derivatives
//   time                                  when two times are the same
//   persistence                           the bytes of a saved state
//   error, display
//   chosen                                constants by experiment

#[macro_use]
mod chosen;

pub mod display;
mod error;
pub mod event_loop;
mod events;
mod integration;
pub mod integrator;
mod number;
pub mod persistence;
pub mod search;
pub mod space;
pub mod steady_state;
mod stops;
pub mod table;
mod tape;
pub mod time;

pub use error::Error;
pub use events::{Event, Events, MOST_ITERATIONS, endless};
pub use integration::{DEFAULT_TOLERANCE, Integration};
pub use number::{Dual, Number};
pub use persistence::Persistent;
pub use stops::{EventsLeft, Stop, Stops, due_until};
pub use tape::{Recorded, Tape};
