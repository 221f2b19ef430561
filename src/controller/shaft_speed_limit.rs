//! The limit of the high-pressure shaft's speed, at rest and while boost rises.
//!
//! At rest the limit of the reference keeps the shaft within its speed. The schedule has it for the nominal plant. Where
//! the speed is measured, it is corrected for this plant and day: to the measured pressure, extrapolated over what is left
//! of the speed, which is exact where nothing is left. The limit is raised wherever that pressure is higher, and never
//! lowered: far from the speed at rest the extrapolation falls short, and near it the least duty below is the limit.
//!
//! While boost pressure rises the slow low-pressure stage lags behind, and the high-pressure stage makes up for it with
//! more speed. Where the speed is measured, the virtual duty is at least the one that holds the limit at rest, more above
//! it and less below it, by the speed to come: the reference model gets the duty within its limits, so it waits. The bypass
//! shuts near the largest speed, also at rest: open, it takes the load off the shaft, in the cold at 5500 rpm to 219 krpm
//! at 120 kPa, where with it shut 178 krpm would be possible (a search over all valves).

use fmu_export::Persistent;

use super::allocation::ramp;
use super::schedule;
use super::variables::{Parameters, RangeScheduleParameters, ShaftSpeedLimitParameters};
use crate::elementary::{larger, smaller};

/// The least speed (rpm) that is a measurement: below, the limit is out of reach.
const LEAST_MEASUREMENT: f64 = 1e3;

/// The excess of speed (rpm) at which the bypass begins to shut, and that from which on it is shut: with 207 krpm, at 199
/// and 203 krpm. Nearer to the largest speed it would stay partly open on a shaft that turns too fast.
const BYPASS_SHUTS: (f64, f64) = (-8e3, -4e3);

/// The largest correction of the pressure limit (Pa): a stuck sensor must not take it away.
const LARGEST_CORRECTION: f64 = 60e3;

/// The least limit of boost pressure (Pa) beyond the columns of the schedule.
const LEAST_LIMIT: f64 = 50e3;

/// A speed (rpm) that is a measurement.
pub fn measured(speed: f64) -> Option<f64> {
    (speed >= LEAST_MEASUREMENT).then_some(speed)
}

/// The schedule's limit of boost pressure (Pa) for the shaft at an engine speed (rpm).
///
/// Where the schedule has the absolute limit instead, and beyond its columns, the limit goes on with the slope of the
/// nearest two columns.
pub fn uncapped_limit(parameters: &Parameters, engine_speed: f64) -> f64 {
    let RangeScheduleParameters { engine_speed: speeds, boost_limit: limits, .. } =
        &parameters.range_schedule;
    let columns = speeds.len();
    let first = limits.iter().position(|&limit| limit < parameters.boost_limit).unwrap_or(columns);
    let left = if first + 1 < columns && engine_speed < speeds[first] {
        first
    } else if first + 1 < columns && engine_speed > speeds[columns - 1] {
        columns - 2
    } else {
        return schedule::interpolate(speeds, limits, engine_speed);
    };
    let slope = (limits[left + 1] - limits[left]) / (speeds[left + 1] - speeds[left]);
    larger(limits[left] + slope * (engine_speed - speeds[left]), LEAST_LIMIT)
}

/// The memory of the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct ShaftSpeedLimit {
    /// The speed at the last sample (rpm).
    before: Option<f64>,
    /// By how much the pressure limit differs from that of the schedule (Pa).
    correction: f64,
}

impl ShaftSpeedLimit {
    /// By how much the pressure limit differs from that of the schedule (Pa), by the measured speed (rpm) and how far the
    /// measured pressure is above the schedule's limit (Pa).
    pub fn correction(&mut self, parameters: &Parameters, speed: f64, above: f64) -> f64 {
        let &ShaftSpeedLimitParameters { speed_at_rest, boost_per_speed, correction_time, .. } =
            &parameters.shaft_speed_limit;
        let asked = above + boost_per_speed * (speed_at_rest - speed);
        let asked = smaller(larger(asked, 0.0), LARGEST_CORRECTION);
        let sample_time = parameters.sample_time;
        self.correction += sample_time / larger(correction_time, sample_time) * (asked - self.correction);
        self.correction
    }

    /// By how much a speed to come is above the largest (rpm), if the speed (rpm) is measured.
    pub fn excess(&mut self, parameters: &Parameters, speed: f64) -> Option<f64> {
        let speed = measured(speed)?;
        let &ShaftSpeedLimitParameters { speed: most, lead_time, .. } = &parameters.shaft_speed_limit;
        let rate = (speed - self.before.replace(speed).unwrap_or(speed)) / parameters.sample_time;
        Some(speed + lead_time * rate - most)
    }
}

/// The least virtual duty (%) at an excess of speed (rpm), by the duty that holds the largest speed at rest.
///
/// The most it asks for is where the low-pressure wastegate begins to open: beyond, boost falls, but the shaft hardly
/// slows down.
pub fn least_duty(parameters: &Parameters, excess: f64, holding_duty: f64) -> f64 {
    let least = holding_duty + parameters.shaft_speed_limit.gain * excess;
    smaller(least, larger(holding_duty, parameters.allocation.low_pressure_start))
}

/// The share of the bypass that stays open at an excess of speed (rpm): open, it takes the load off the shaft.
pub fn bypass_share(excess: f64) -> f64 {
    let (begin, end) = BYPASS_SHUTS;
    1.0 - ramp(excess, begin, end)
}
