//! The allocation of the virtual duty to three valves: the split range.
//!
//! The high-pressure wastegate's valve gets the virtual duty itself, up to its maximum duty. Before that wastegate is
//! fully open, the low-pressure one starts to open, and slightly later the bypass of the high-pressure compressor, both
//! only at engine speeds where the high-pressure stage is too small for the flow. This is the gradual transition
//! between stages of paper, section 3.1, in engine speed and in duty, without switching.

use fmu_export::{Error, Persistent};

use super::compensator::{Compensator, Limits};
use super::variables::{AllocationParameters, Parameters, Real};
use crate::elementary::{larger, smaller};

/// The openings of the other valves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Openings {
    /// The low-pressure wastegate: 0 shut, 1 fully open.
    pub lp_wastegate: Real,
    /// The bypass of the high-pressure compressor.
    pub hp_bypass: Real,
    /// The surge valve.
    pub surge_valve: Real,
}

/// A ramp between two bounds: 0 up to the lower, 1 from the upper.
pub(super) fn ramp(value: Real, from: Real, to: Real) -> Real {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

impl AllocationParameters {
    /// The share of the low-pressure wastegate at an engine speed (rpm).
    pub(super) fn low_pressure_share(&self, engine_speed: Real) -> Real {
        ramp(engine_speed, self.low_pressure_shut_below, self.low_pressure_free_above)
    }

    /// The limits of the virtual duty, up to the low-pressure wastegate fully open where it takes part.
    pub(super) fn limits(
        &self,
        parameters: &Parameters,
        engine_speed: Real,
        compensator: Compensator,
    ) -> Limits {
        let (least, most) = (parameters.pwm_min, parameters.pwm_max);
        if engine_speed > self.low_pressure_shut_below {
            Limits { least, most: self.low_pressure_open() }
        } else {
            compensator.limits(least, most)
        }
    }

    /// The virtual duty (%) at which the low-pressure wastegate is fully open.
    #[must_use]
    pub fn low_pressure_open(&self) -> Real {
        self.low_pressure_start + self.low_pressure_span / (1.0 + self.low_pressure_shape)
    }

    /// The openings at rest for a virtual duty (%) within its limits.
    ///
    /// The low-pressure wastegate follows a hyperbola, since its effect on boost falls as it opens: the gain from
    /// virtual duty to boost pressure hardly changes.
    #[must_use]
    pub fn openings(&self, virtual_duty: Real, engine_speed: Real) -> Openings {
        let (span, beyond) = (self.low_pressure_span, virtual_duty - self.low_pressure_start);
        let curve = if beyond <= 0.0 {
            0.0
        } else if beyond >= span {
            1.0
        } else {
            smaller(self.low_pressure_shape * beyond / (span - beyond), 1.0)
        };
        Openings {
            lp_wastegate: self.low_pressure_share(engine_speed) * curve,
            hp_bypass: ramp(engine_speed, self.bypass_shut_below, self.bypass_free_above)
                * ramp(virtual_duty, self.bypass_start, self.bypass_end),
            surge_valve: 0.0,
        }
    }
}

/// The time constant (s) with which the bypass shuts for least boost: at once, boost would jump by 10 kPa at 4500 rpm; as
/// slow as in normal operation, the high-pressure shaft, which it unloads, would overspeed.
const SHUTS_IN: Real = 0.1;

/// The bypass moves with a lag, since it changes the flow of both compressors at once, before their shafts can follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub(super) struct Bypass {
    /// The opening commanded at the last sample; none before the first.
    opening: Option<Real>,
}

impl Bypass {
    /// The opening commanded at the last sample.
    pub(super) fn opening(self) -> Real {
        self.opening.unwrap_or_default()
    }

    /// The opening at a sample while the bypass shuts for least boost: not before the surge valve has taken its flow.
    pub(super) fn shut(&mut self, parameters: &Parameters) -> Real {
        let opening =
            (1.0 - parameters.sample_time / larger(SHUTS_IN, parameters.sample_time)) * self.opening();
        self.opening = Some(opening);
        opening
    }

    /// The lagged opening at a sample, for a wanted one. It starts at the wanted one.
    pub(super) fn sample(&mut self, parameters: &Parameters, asked: Real, virtual_duty: Real) -> Real {
        let allocation = &parameters.allocation;
        let before = self.opening.unwrap_or(asked);
        let shuts_alone = asked < before && virtual_duty <= allocation.low_pressure_start;
        let lag = if shuts_alone { allocation.bypass_closing_time } else { allocation.bypass_opening_time };
        let opening = before + parameters.sample_time / lag * (asked - before);
        self.opening = Some(opening);
        opening
    }
}

/// Rejects an allocation that does not open its valves in sequence.
pub(super) fn check(parameters: &Parameters) -> Result<(), Error> {
    let of = &parameters.allocation;
    refuse_not_below(
        ("allocation.low_pressure_shut_below", of.low_pressure_shut_below),
        ("allocation.low_pressure_free_above", of.low_pressure_free_above),
        "rpm",
    )?;
    refuse_not_below(
        ("allocation.bypass_shut_below", of.bypass_shut_below),
        ("allocation.bypass_free_above", of.bypass_free_above),
        "rpm",
    )?;
    refuse_not_below(
        ("allocation.low_pressure_start", of.low_pressure_start),
        ("allocation.bypass_start", of.bypass_start),
        "%",
    )?;
    refuse_not_below(
        ("allocation.bypass_start", of.bypass_start),
        ("allocation.bypass_end", of.bypass_end),
        "%",
    )?;
    if parameters.pwm_min >= of.low_pressure_open() {
        return Err(Error::new(format_args!(
            "pwm_min is {} % and must be below the virtual duty at which the low-pressure wastegate is fully open, {} % with allocation.low_pressure_start, low_pressure_span and low_pressure_shape",
            parameters.pwm_min,
            of.low_pressure_open()
        )));
    }
    for (name, value) in [
        ("allocation.bypass_opening_time", of.bypass_opening_time),
        ("allocation.bypass_closing_time", of.bypass_closing_time),
    ] {
        if value < parameters.sample_time {
            return Err(Error::new(format_args!(
                "{name} is {value} s and must be at least sample_time, which is {} s",
                parameters.sample_time
            )));
        }
    }
    Ok(())
}

fn refuse_not_below(lower: (&str, Real), upper: (&str, Real), unit: &str) -> Result<(), Error> {
    if lower.1 < upper.1 {
        return Ok(());
    }
    Err(Error::new(format_args!(
        "{} is {} {unit} and must be below {}, which is {} {unit}",
        lower.0, lower.1, upper.0, upper.1
    )))
}
