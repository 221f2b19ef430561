//! What makes a deviation evidence of a fault: that it lasts, while engine speed is steady.

use fmu_export::Persistent;

use crate::controller::variables::Real;

/// The time constant (s) of the virtual duty, the reference and engine speed before a demand: longer than the duty's
/// response to a reference step, shorter than the time between a driver's steps.
pub const MEMORY: Real = 1.0;
/// The change of engine speed (rpm) within which the loop is judged: beyond it, the duty moves to hold the pressure.
pub const STEADY_SPEED: Real = 100.0;

/// A condition that changes once it has been observed changed for some time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Confirmed {
    /// Whether the condition holds, as confirmed.
    pub holds: bool,
    /// How long the condition has been observed otherwise (s).
    seen_otherwise: Real,
}

impl Confirmed {
    pub fn sample(&mut self, seen: bool, confirmation_time: Real, sample_time: Real) {
        if seen == self.holds {
            self.seen_otherwise = 0.0;
            return;
        }
        self.seen_otherwise += sample_time;
        if self.seen_otherwise >= confirmation_time {
            *self = Self { holds: seen, seen_otherwise: 0.0 };
        }
    }

    /// Whether neither the condition nor a sign of it has been observed.
    pub fn is_sound(&self) -> bool {
        !self.holds && self.seen_otherwise == 0.0
    }
}
