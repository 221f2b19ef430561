//! The feedforward from the change of engine speed.
//!
//! While engine speed rises with the valves held, the shafts lag behind, and boost is below its value at rest by
//! about S times the rate of change: the schedule's `speed_sensitivity`. So the duty that holds a pressure on the way
//! is the one that holds a pressure higher by that at rest.

use super::day::Day;
use super::off_schedule;
use super::variables::Parameters;
use crate::elementary::{larger, smaller};

/// How often the shift of the pressure is computed anew at the shifted pressure. The map is smooth: the third
/// iteration would change less than the map is accurate to.
const ITERATIONS: usize = 2;

/// The range of the shifted pressure (Pa), that of the measurement: maps with absurd values stay finite.
const PRESSURES: (f64, f64) = (0.0, 1e6);

/// The engine speed (rpm) whose sensitivity counts while the bypass is open: that at which it would be open so far at
/// rest, since it lags behind engine speed.
pub fn speed_of_bypass(parameters: &Parameters, engine_speed: f64, bypass: f64) -> f64 {
    let allocation = &parameters.allocation;
    let (shut, free) = (allocation.bypass_shut_below, allocation.bypass_free_above);
    if engine_speed < free && bypass > 0.0 {
        larger(engine_speed, shut + bypass * (free - shut))
    } else {
        engine_speed
    }
}

/// The virtual duty (%) that holds a boost pressure (Pa) while engine speed (rpm) changes at a rate (rpm/s); none where
/// it does not change.
pub fn holding_duty(
    parameters: &Parameters,
    day: &Day,
    boost_pressure: f64,
    engine_speed: f64,
    rate: f64,
    bypass: f64,
) -> Option<f64> {
    if rate == 0.0 {
        return None;
    }
    let schedule = &parameters.range_schedule;
    let of_bypass = speed_of_bypass(parameters, engine_speed, bypass);
    let sensitive = day.operating_point(parameters, boost_pressure, of_bypass);
    let share = off_schedule::sensitivity_share(parameters, day);
    let shift = |pressure| {
        let sensitivity = sensitive.at_pressure(pressure).interpolate(&schedule.speed_sensitivity);
        share * sensitivity * rate
    };
    let mut shifted = boost_pressure + shift(boost_pressure);
    for _ in 0..ITERATIONS {
        shifted = boost_pressure + shift(shifted);
    }
    let (least, most) = PRESSURES;
    let shifted = smaller(larger(shifted, least), most);
    let here = day.operating_point(parameters, boost_pressure, engine_speed);
    let asked = here.extrapolated_feedforward(shifted);
    if !day.is_other {
        return Some(asked);
    }
    // Where the low-pressure wastegate is held shut, more duty than the one at which it begins to open only takes speed
    // from the high-pressure shaft, which is missing when engine speed no longer falls. On the schedule's own day the
    // sensitivity holds, and the law is as it was identified.
    let allocation = &parameters.allocation;
    let start = larger(allocation.low_pressure_start, here.feedforward());
    let beyond = larger(asked - start, 0.0);
    Some(asked - (1.0 - allocation.low_pressure_share(engine_speed)) * beyond)
}
