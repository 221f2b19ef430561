//! Coupling a plant with a controller, ours or others: the system that results, and how it is drawn.

mod layout;
mod system;

pub use self::system::{Member, couple};
