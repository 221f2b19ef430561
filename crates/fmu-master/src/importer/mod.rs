//! Imports FMUs for co-simulation and Model Exchange, FMI 2.0 and 3.0, from any tool.
//!
//! An [`Fmu`] is extracted and loaded; it creates [`Instance`]s in any thread, each of which stays in its thread.
//! Variables are addressed by names, resolved once: a [`Selection`] reads or writes numbers of any type together without
//! allocating. Array elements are variables. A failed call is a [`CallFailed`]: the function, the time, and the FMU's
//! messages.
//!
//! Only this module calls FMUs. Of the crates that import FMI, `fmi` needs libclang to build and crashes on messages
//! without a category, and `fmi-rs` (0.3.4) crashes with FMUs that keep the pointer to the callbacks, as many do, and
//! on undefined statuses.

mod c_boundary;
mod calls;
mod columns;
mod derivative_check;
mod differences;
mod event_mode;
mod exchange;
mod fmu;
mod folder;
mod followed;
mod following;
mod instance;
mod linearization;
mod messages;
mod numbers;
mod selection;
mod solver;
mod stepping;
#[cfg(test)]
mod tests;
mod watch;
mod watching;

pub use self::c_boundary::{process, when_an_fmu_exits};
pub use self::fmu::{Fmu, ONLY_ONCE};
pub(crate) use self::folder::extract;
pub(crate) use self::followed::Course;
pub use fmu_terms::Interface;

pub use self::instance::{Instance, SavedState};
pub use self::linearization::Linearization;
pub use self::messages::{CallFailed, Ended, Message, Status};
pub(crate) use self::selection::Misfit;
pub use self::selection::Selection;
pub(crate) use self::watch::EventRow;
