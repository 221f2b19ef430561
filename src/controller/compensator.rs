//! The supply voltage compensator: paper, section 5.
//!
//! The solenoid valve's plunger follows the mean magnetic field, hence duty times voltage. A duty at nominal voltage
//! therefore has the same effect at another voltage if multiplied by the voltage ratio.

use fmu_export::Persistent;

use super::actuator_inverse::FULL_DUTY;
use super::estimate::{Level, Measured};
use super::variables::{ActiveLimit, ControlMode, FeedbackStructure, Parameters, Real, Strategy};
use crate::elementary::{larger, smaller};

/// The lowest supply voltage (V) compensated for: below it the duty does not grow further.
const LEAST_VOLTAGE: Real = 6.0;

/// The lowest supply voltage (V) of the first measurement: in the starting profiles of ISO 16750-2 cranking lowers a 12
/// V supply to no less than 3 V. Some masters pass zeros to connected inputs at the start.
const LEAST_MEASUREMENT: Real = 3.0;

/// The supply voltage to compensate for, without its noise in the strategy `split_range`, but for the paper's structure:
/// each movement of the wastegate costs vacuum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SupplyVoltage {
    level: Level,
    /// Whether there was a measurement. After the first, a low voltage counts too: the supply fails.
    is_measured: bool,
    /// The last plausible measurement (V), and the one before.
    plausible: Option<[Real; 2]>,
}

impl SupplyVoltage {
    /// Takes an input (V); returns it if there has been a measurement.
    pub fn measured(&mut self, voltage: Real) -> Option<Real> {
        self.is_measured |= voltage >= LEAST_MEASUREMENT;
        self.is_measured.then_some(voltage)
    }

    /// The voltage to compensate for (V), from the measured one, if it is not replaced.
    ///
    /// A supply that fails passes plausible voltages on its way, through the lag of its sensor, which a sensor that fails
    /// does not. So the line through the last two plausible voltages leads to the right one for both, and what is measured
    /// replaces it only on its way back.
    pub fn compensated(
        &mut self,
        parameters: &Parameters,
        measured: Option<Real>,
        is_replaced: bool,
    ) -> Option<Real> {
        let mut voltage = measured?;
        if let Some([last, before]) = self.plausible.filter(|_| is_replaced) {
            let ahead = 2.0 * last - before;
            return Some(if voltage < last { larger(voltage, ahead) } else { smaller(voltage, ahead) });
        }
        if let (ControlMode::Boost, Strategy::SplitRange, FeedbackStructure::ModelReference) =
            (parameters.mode, parameters.strategy, parameters.structure)
        {
            let &Parameters { sample_time, actuator_lag, ref measurement, .. } = parameters;
            let noise = measurement.supply_voltage_noise;
            voltage = self.level.sample(Measured { sample_time, noise, response: actuator_lag }, voltage);
        }
        let before = self.plausible.map_or(voltage, |[last, _]| last);
        self.plausible = Some([voltage, before]);
        Some(voltage)
    }
}

/// The compensation at a supply voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensator {
    /// Duty at this voltage over duty at nominal voltage: paper, eq. (9).
    pub factor: Real,
}

impl Compensator {
    /// The compensation at a measured supply voltage (V); none without a measurement.
    pub fn new(parameters: &Parameters, supply_voltage: Option<Real>) -> Self {
        let factor = match supply_voltage {
            Some(voltage) if parameters.compensate_voltage => {
                parameters.nominal_voltage / larger(voltage, LEAST_VOLTAGE)
            }
            _ => 1.0,
        };
        Self { factor }
    }

    /// The limits of a duty at nominal voltage: those given (%), and the one at which the actual duty is 100 %.
    pub fn limits(self, least: Real, most: Real) -> Limits {
        Limits { least, most: smaller(most, FULL_DUTY / self.factor) }
    }

    /// The duty (%) at this voltage equivalent to one at nominal voltage.
    pub fn compensate(self, duty: Real) -> Real {
        smaller(duty * self.factor, FULL_DUTY)
    }
}

/// Limits of a duty at nominal voltage (%).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    pub least: Real,
    pub most: Real,
}

impl Limits {
    /// Whether a duty is within the limits.
    pub fn contain(self, duty: Real) -> bool {
        duty >= self.least && duty <= self.most
    }

    /// The limit that cuts a duty, if one does.
    pub fn active(self, duty: Real) -> ActiveLimit {
        if duty < self.least {
            ActiveLimit::DutyMin
        } else if duty > self.most {
            ActiveLimit::DutyMax
        } else {
            ActiveLimit::None
        }
    }

    /// The nearest duty within the limits. At low voltage the upper limit can fall below the lower; then the upper,
    /// physical one applies.
    pub fn clip(self, duty: Real) -> Real {
        smaller(larger(duty, self.least), self.most)
    }
}
