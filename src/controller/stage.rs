//! The stage strategy: which of the two turbochargers works at which engine speed (paper, sections 3.1 and
//! 6), and the control of boost by the low-pressure wastegate when only the low-pressure stage does.
//!
//! At low speed the low-pressure wastegate is shut: the small high-pressure stage gives the boost. Above,
//! the low-pressure wastegate opens with the engine speed. At high speed the high-pressure compressor would
//! choke: it is bypassed, its wastegate is fully open, and boost is limited by the low-pressure wastegate.

use fmu_export::{Error, Persistent};

use super::variables::Parameters;
use crate::elementary::smaller;

/// What the strategy remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Persistent)]
pub struct StageStrategy {
    /// Whether the high-pressure stage is bypassed.
    pub bypassed: bool,
}

impl StageStrategy {
    /// Whether the high-pressure stage is bypassed at an engine speed (rpm): from the limit on, until the
    /// speed has fallen below it by the hysteresis.
    pub fn sample(&mut self, parameters: &Parameters, engine_speed: f64) -> bool {
        let until = parameters.lp_wastegate_open_above;
        let from = if self.bypassed { until - parameters.stage_hysteresis } else { until };
        self.bypassed = engine_speed >= until || engine_speed > from;
        self.bypassed
    }
}

/// The opening of the low-pressure wastegate at an engine speed (rpm) while the high-pressure stage works:
/// shut up to the one limit, fully open at the other, linear between.
pub fn lp_wastegate(parameters: &Parameters, engine_speed: f64) -> f64 {
    let (shut, open) = (parameters.lp_wastegate_close_below, parameters.lp_wastegate_open_above);
    if engine_speed <= shut {
        0.0
    } else if engine_speed >= open {
        1.0
    } else {
        (engine_speed - shut) / (open - shut)
    }
}

/// Control of boost by the low-pressure wastegate: proportional and integral, with tracking against
/// wind-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct LowPressureLoop {
    /// The integral term of the opening; none before the first sample.
    integral: Option<f64>,
}

impl LowPressureLoop {
    /// The opening of the wastegate for a boost pressure above its reference by an error (Pa). It starts
    /// shut.
    pub fn sample(&mut self, parameters: &Parameters, error: f64) -> f64 {
        let proportional = parameters.low_pressure_gain * error;
        let integral = self.integral.unwrap_or(-proportional);
        let unlimited = proportional + integral;
        let opening = unlimited.clamp(0.0, 1.0);
        let share = parameters.sample_time / parameters.low_pressure_integral_time;
        // Tracking in one sample is the fastest there is; a larger share would overshoot, ever further.
        let tracking = smaller(share, 1.0);
        self.integral = Some(integral + share * proportional + tracking * (opening - unlimited));
        opening
    }
}

/// Rejects limits between which the low-pressure wastegate cannot open.
pub fn check(parameters: &Parameters) -> Result<(), Error> {
    let (shut, open) = (parameters.lp_wastegate_close_below, parameters.lp_wastegate_open_above);
    if shut < open {
        return Ok(());
    }
    Err(Error::new(format!(
        "lp_wastegate_close_below is {shut} rpm and lp_wastegate_open_above is {open} rpm, but the low-pressure wastegate must be shut at a lower speed than open"
    )))
}
