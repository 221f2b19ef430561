//! Couples a plant and a controller, ours or others: the system and its diagram.

mod layout;
mod system;

pub use self::system::{Member, couple, linear};
