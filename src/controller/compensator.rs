//! The compensator of the supply voltage: paper, section 5.
//!
//! The plunger of the solenoid valve follows the mean of the magnetic field, hence duty times voltage, so a
//! duty found at nominal voltage acts the same at another one when it is multiplied by their ratio.

use super::variables::Parameters;
use crate::elementary::{larger, smaller};

/// The least supply voltage (V) that is compensated for: below it the duty does not grow further.
const LEAST_VOLTAGE: f64 = 6.0;

/// The largest duty there is (%).
const FULL_DUTY: f64 = 100.0;

/// The compensation at a supply voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensator {
    /// Duty at this voltage by duty at nominal voltage: paper, eq. (9).
    pub factor: f64,
}

impl Compensator {
    /// The compensation at a measured supply voltage (V).
    #[must_use]
    pub fn new(parameters: &Parameters, supply_voltage: f64) -> Self {
        let factor = if parameters.compensate_voltage {
            parameters.nominal_voltage / larger(supply_voltage, LEAST_VOLTAGE)
        } else {
            1.0
        };
        Self { factor }
    }

    /// The limits of a duty at nominal voltage: those given (%), and what full duty amounts to.
    #[must_use]
    pub fn limits(self, least: f64, most: f64) -> Limits {
        Limits { least, most: smaller(most, FULL_DUTY / self.factor) }
    }

    /// The duty (%) at this voltage that acts like one at nominal voltage.
    #[must_use]
    pub fn compensate(self, duty: f64) -> f64 {
        smaller(duty * self.factor, FULL_DUTY)
    }
}

/// Limits of a duty at nominal voltage (%).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    least: f64,
    most: f64,
}

impl Limits {
    /// Whether a duty is within the limits.
    #[must_use]
    pub fn contain(self, duty: f64) -> bool {
        duty >= self.least && duty <= self.most
    }

    /// The nearest duty within the limits. At low voltage the upper one can fall below the lower one: it
    /// is the one that physics sets, so it wins.
    #[must_use]
    pub fn clip(self, duty: f64) -> f64 {
        smaller(larger(duty, self.least), self.most)
    }
}
