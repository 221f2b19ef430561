//! The feedback: a gain-scheduled PID controller with λ-tuning, filtered derivative of the measurement and tracking
//! anti-windup (paper, section 6).

use fmu_export::{Float, Persistent};

use super::schedule::LocalModel;
use super::variables::Real;
use crate::elementary::{Power, larger};

/// The minimum tracking time in samples. The paper's `T_tr = √(T_i T_d)` goes to 0 with the delay, and a tracking time
/// below one sample makes the integral term oscillate; four keep it well damped.
const LEAST_TRACKING_SAMPLES: Real = 4.0;

/// The settings of the PID controller at an operating point: paper, eq. (12).
///
/// The paper prints eq. (11) as the product of a PI and a PD term, but the settings of eq. (12) belong to the sum
/// `K (1 + 1/(s T_i) + s T_d)`, used here: its numerator `1 + s T_i + s² T_i T_d = (1 + s T) (1 + s L/2)` cancels the
/// local model with a Padé approximation of its delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedbackSettings {
    /// K (%/Pa).
    pub gain: Real,
    /// `K / T_i` (%/(Pa s)).
    pub integral_gain: Real,
    /// `T_i` (s).
    pub integral_time: Real,
    /// `T_d` (s).
    pub derivative_time: Real,
}

impl FeedbackSettings {
    /// λ-tuning for a local model; λ (s) is the desired closed-loop time constant.
    #[must_use]
    pub fn new(model: &LocalModel, lambda: Real) -> Self {
        let half_delay = model.delay / 2.0;
        let integral_time = model.time_constant + half_delay;
        let integral_gain = 1.0 / ((half_delay + lambda) * model.gain);
        Self {
            gain: integral_time * integral_gain,
            integral_gain,
            integral_time,
            derivative_time: model.time_constant * model.delay / (model.delay + 2.0 * model.time_constant),
        }
    }

    /// Adds a lead (s) to the derivative term for a lag beyond the local model's delay.
    #[must_use]
    pub fn with_lead(self, lead: Real) -> Self {
        Self { derivative_time: self.derivative_time + lead, ..self }
    }

    /// The tracking time `T_tr` of paper, section 6, at least four samples (s).
    fn tracking_time(&self, sample_time: Real) -> Real {
        larger(Float::sqrt(self.integral_time * self.derivative_time), LEAST_TRACKING_SAMPLES * sample_time)
    }
}

/// The state of the PID controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Pid {
    /// The integral term (%).
    pub integral: Real,
    /// The derivative term (%).
    pub derivative: Real,
    /// The boost pressure at the last sample (Pa).
    measurement: Real,
}

impl Pid {
    /// A controller at rest at a boost pressure (Pa).
    #[must_use]
    pub fn at(measurement: Real) -> Self {
        Self { integral: 0.0, derivative: 0.0, measurement }
    }

    /// Converts all pressures (Pa).
    pub(super) fn convert(&mut self, pressure: impl Fn(Real) -> Real) {
        self.measurement = pressure(self.measurement);
    }

    /// Rescales the integral term for a changed engine gain: by the gain before over that after, to an exponent.
    pub fn rescale(&mut self, ratio: Real, exponent: Real) {
        self.integral *= ratio.power(exponent);
    }

    /// Updates the derivative term with the measurement (Pa) of a new sample.
    ///
    /// The derivative term acts only on the measurement, so reference steps cause no kick, through a filter with the
    /// time constant `T_d / filter`, discretised by backward differences.
    pub fn differentiate(
        &mut self,
        tuning: &FeedbackSettings,
        filter: Real,
        sample_time: Real,
        measurement: Real,
    ) {
        let pole = tuning.derivative_time / (tuning.derivative_time + filter * sample_time);
        let change = measurement - self.measurement;
        self.derivative = pole * self.derivative - tuning.gain * filter * pole * change;
        self.measurement = measurement;
    }

    /// Updates the integral term (%) for the next sample with the error (Pa) and, as anti-windup, the effect of the
    /// limits on the duty (%, limited minus unlimited).
    pub fn integrate(&mut self, tuning: &FeedbackSettings, sample_time: Real, error: Real, cut: Real) {
        self.integral += sample_time * tuning.integral_gain * error
            + sample_time / tuning.tracking_time(sample_time) * cut;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_term_grows_where_the_engine_is_less_sensitive() {
        let integral = |exponent| {
            let mut pid = Pid { integral: -3.0, ..Pid::default() };
            // From -2 to -1 kPa/%.
            pid.rescale(-2000.0 / -1000.0, exponent);
            pid.integral
        };
        // As a duty it stays, as a pressure it doubles; the round-off of `power`.
        assert!((integral(0.0) + 3.0).abs() < 1e-14 * 3.0);
        assert!((integral(1.0) + 6.0).abs() < 1e-14 * 6.0);
        assert!((integral(0.5) + 3.0 * 2_f64.sqrt()).abs() < 1e-13);
    }
}
