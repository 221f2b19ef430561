//! The high-pressure shaft speed limit, at rest and while boost rises.
//!
//! At rest the reference limit keeps the shaft within its speed. The schedule holds it for the nominal plant. If the
//! speed is measured, it is corrected for the plant and ambient conditions: to the measured pressure, extrapolated over
//! the remaining speed margin, which is exact at zero margin. The limit is raised wherever that pressure is higher, but
//! lowered only above the speed at rest, since far below it the extrapolation falls short.
//!
//! While boost pressure rises, the slow low-pressure stage lags and the high-pressure stage compensates with more
//! speed. If the speed is measured, the virtual duty is at least the one that holds the limit at rest, more above it
//! and less below it, by the predicted speed. This overrides the duty alone: reference model and integral term do not
//! follow, or boost would fall too far when the limit releases, or oscillate with the shaft. With 0.001 %/rpm and a lead
//! of 0.3 s, duty and speed oscillate at 3 Hz at 85 kPa.
//!
//! Near the maximum speed, even at rest, the bypass shuts, and the low-pressure wastegate waits until the high-pressure
//! one is fully open. An open bypass unloads the shaft: in the cold at 5500 rpm and 120 kPa to 219 krpm, where 178 krpm
//! would be possible with it shut (a search over all valves). The low-pressure wastegate lowers boost but hardly slows
//! the shaft: so with the high-pressure wastegate fully open, the limit is not below the pressure there.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::day::Day;
use super::lag::Lag;
use super::schedule;
use super::variables::{Inputs, Parameters, RangeScheduleParameters, Real, ShaftSpeedLimitParameters};
use crate::elementary::{larger, smaller};

/// The lowest speed (rpm) that is a measurement: below it, the limit is out of reach.
const LEAST_MEASUREMENT: Real = 1e3;

/// The excess speeds (rpm) at which the bypass starts to shut and is shut: with 209.1 krpm, at 201.1 and 205.1 krpm.
/// Closer to the maximum speed it would stay partly open on a shaft that turns too fast.
const BYPASS_SHUTS: (Real, Real) = (-8e3, -4e3);

/// The excess speeds (rpm) at which the other valves start to wait for the high-pressure wastegate, and wait until it
/// is open: with 209.1 krpm, at 205.1 and 207.1 krpm.
const OTHERS_WAIT: (Real, Real) = (-4e3, -2e3);

/// The filter of the rate of change (s): a fraction of `lead_time`.
const RATE_FILTER: Real = 0.05;

/// The margin below the speed at rest (rpm) that counts as near. There boost is extrapolated with the contribution of
/// the high-pressure shaft alone, which follows at once: with more, the limit oscillates.
const NEAR_LIMIT: Real = 5e3;

/// Boost per speed of the high-pressure shaft at rest over that at once, as the low-pressure shaft adds to boost, too:
/// what boost gains up to the limit from far below it, and loses on the way back from above.
const BOTH_SHAFTS: Real = 4.0;

/// The largest correction of the pressure limit (Pa): a stuck sensor must not disable it.
const LARGEST_CORRECTION: Real = 60e3;

/// The lowest boost pressure limit (Pa) beyond the schedule's columns.
const LEAST_LIMIT: Real = 50e3;

/// A speed (rpm) that is a measurement.
fn measured(speed: Real) -> Option<Real> {
    (speed >= LEAST_MEASUREMENT).then_some(speed)
}

/// The schedule's boost pressure limit for the shaft at rest (Pa, at reference conditions) at an engine speed (rpm).
pub fn scheduled_limit(parameters: &Parameters, engine_speed: Real) -> Real {
    let maps = &parameters.range_schedule;
    schedule::interpolate(&maps.engine_speed, &maps.boost_limit, engine_speed)
}

/// The schedule's boost pressure limit for a measured shaft (Pa), which `boost_limit` need not protect.
///
/// Where the schedule has the absolute limit instead, and beyond its columns, it is extrapolated from the nearest two
/// columns.
fn uncapped_limit(parameters: &Parameters, engine_speed: Real) -> Real {
    let RangeScheduleParameters { engine_speed: speeds, boost_limit: limits, .. } =
        &parameters.range_schedule;
    let columns = speeds.len();
    let first = limits.iter().position(|&limit| limit < parameters.boost_limit).unwrap_or(columns);
    let left = if first + 1 < columns && engine_speed < speeds[first] {
        first
    } else if first + 1 < columns && engine_speed > speeds[columns - 1] {
        columns - 2
    } else {
        return scheduled_limit(parameters, engine_speed);
    };
    let slope = (limits[left + 1] - limits[left]) / (speeds[left + 1] - speeds[left]);
    larger(limits[left] + slope * (engine_speed - speeds[left]), LEAST_LIMIT)
}

/// The boost pressure margin (Pa) to the speed at rest, from the measured speed (rpm); or if larger, the margin to the
/// high-pressure wastegate fully open, from the virtual duty (%) and its gain (Pa/%), minus the excess over the maximum
/// speed.
fn margin(parameters: &Parameters, speed: Real, virtual_duty: Real, gain: Real) -> Real {
    let &ShaftSpeedLimitParameters { speed: most, speed_at_rest, boost_per_speed, .. } =
        &parameters.shaft_speed_limit;
    let left = speed_at_rest - speed;
    let by_speed = boost_per_speed * (left + (BOTH_SHAFTS - 1.0) * larger(left - NEAR_LIMIT, 0.0));
    let too_fast = BOTH_SHAFTS * boost_per_speed * larger(speed - most, 0.0);
    larger(by_speed, gain * (parameters.pwm_max - virtual_duty) - too_fast)
}

/// The memory of the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ShaftSpeedLimit {
    speed: Lag,
    /// The correction of the schedule's pressure limit (Pa).
    correction: Real,
}

impl ShaftSpeedLimit {
    /// The limit of the reference (Pa, at reference conditions), if the shaft's speed is measured, from the virtual duty at
    /// the last sample (%) and its gain (Pa/%). A rising limit is taken at the engine speed to come (rpm).
    pub fn of_reference(
        &mut self,
        parameters: &Parameters,
        day: &Day,
        inputs: &Inputs,
        speed_to_come: Real,
        (virtual_duty, gain): (Real, impl Fn() -> Real),
    ) -> Option<Real> {
        let shaft_speed = measured(inputs.hp_turbo_speed)?;
        let at = |speed| day.limit_of_shaft(speed, |speed| uncapped_limit(parameters, speed));
        let here = at(inputs.engine_speed);
        let to_come = at(larger(speed_to_come, 0.0));
        let margin = margin(parameters, shaft_speed, virtual_duty, gain());
        let above = day.scheduled_pressure(inputs.boost_pressure) + margin - here;
        Some(larger(here, to_come) + self.correct(parameters, above, shaft_speed))
    }

    /// Updates the correction of the schedule's pressure limit (Pa), from the excess of the boost pressure allowed by
    /// the shaft (Pa) and the measured speed (rpm).
    fn correct(&mut self, parameters: &Parameters, above: Real, speed: Real) -> Real {
        let &ShaftSpeedLimitParameters { speed: most, speed_at_rest, correction_time, .. } =
            &parameters.shaft_speed_limit;
        let asked = if above < 0.0 {
            above * ramp(speed, speed_at_rest, larger(most, speed_at_rest + 1.0))
        } else {
            above
        };
        let asked = smaller(larger(asked, -LARGEST_CORRECTION), LARGEST_CORRECTION);
        let sample_time = parameters.sample_time;
        self.correction += sample_time / larger(correction_time, sample_time) * (asked - self.correction);
        self.correction
    }

    /// The excess of the predicted speed over the maximum (rpm), if the speed (rpm) is measured.
    pub fn excess(&mut self, parameters: &Parameters, speed: Real) -> Option<Real> {
        let speed = measured(speed)?;
        let &ShaftSpeedLimitParameters { speed: most, lead_time, .. } = &parameters.shaft_speed_limit;
        let rate = self.speed.rate(parameters.sample_time, RATE_FILTER, speed);
        Some(speed + lead_time * rate - most)
    }
}

/// The minimum virtual duty (%) at an excess speed (rpm), from the duty that holds the maximum speed at rest; at most
/// the one that fully opens the high-pressure wastegate.
pub fn least_duty(parameters: &Parameters, excess: Real, holding_duty: Real) -> Real {
    smaller(holding_duty + parameters.shaft_speed_limit.gain * excess, parameters.pwm_max)
}

/// The share of the bypass that stays open at an excess speed (rpm), since an open bypass unloads the shaft.
pub fn bypass_share(excess: Real) -> Real {
    let (begin, end) = BYPASS_SHUTS;
    1.0 - ramp(excess, begin, end)
}

/// The virtual duty (%) for the other valves at an excess speed (rpm): near the limit the high-pressure wastegate opens
/// fully before they start to, since opening them lowers boost but hardly slows the shaft.
pub fn duty_of_other_valves(parameters: &Parameters, excess: Real, virtual_duty: Real) -> Real {
    let &Parameters { pwm_max, ref allocation, .. } = parameters;
    let (start, open) = (allocation.low_pressure_start, allocation.low_pressure_open());
    let (begin, end) = OTHERS_WAIT;
    let later = start + ramp(excess, begin, end) * (smaller(pwm_max, open) - start);
    if virtual_duty <= later || later >= open {
        return smaller(virtual_duty, start);
    }
    start + (virtual_duty - later) * (open - start) / (open - later)
}
