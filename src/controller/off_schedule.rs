//! How far the law of the strategy `split_range` relies on its schedule.
//!
//! On the day of the schedule the law is as it was identified: the feedforward of engine speed does most of the work, and
//! the feedback leaves it alone. On another day the schedule is converted, which holds less exactly, and the plant may
//! differ as well. There the feedback does more and the feedforward less:
//!
//! - The feedback's λ is shorter. What limits it is the actuator: until its chamber has filled and its rod has moved, some
//!   0.08 s on the plant model, a wrong course of boost goes on. So the derivative term leads by that lag, as in a Smith
//!   predictor for a plant that integrates: shafts do, for such times. Its filter is slower, or the noise
//!   of boost pressure would move the wastegate so much that the pump could no longer hold the vacuum.
//! - The feedforward takes a part of the schedule's sensitivity. That was identified with a first-order model, in which all
//!   of the wastegate's effect is as slow as the low-pressure shaft. The high-pressure shaft follows several times faster,
//!   so that less duty suffices for ramps of a second, and too much of it costs that shaft its speed when a fall ends.
//!   While engine speed rises still less suffices: the wastegate then nears its stop.
//! - Engine speed is filtered less before its rate is taken: the filter's time is missing when a ramp ends.
//!
//! The firmer feedback acts while engine speed changes and fades within 2 s: at constant speed steps of the reference would
//! overshoot by more. It comes in with engine speed, below where the low-pressure wastegate does. Where the shaft's limit
//! holds the duty, the feedback stays as it was identified: it would work against that limit.

use fmu_export::Persistent;

use super::allocation::ramp;
use super::day::Day;
use super::feedback::Firmness;
use super::variables::Parameters;
use crate::elementary::larger;

/// The actuator's lag (s) that the derivative term makes up for.
const LEAD: f64 = 0.08;

/// Factors of `feedback_lambda`, `derivative_filter` and `speed_feedforward.filter_time`.
const LAMBDA: f64 = 0.6;
const DERIVATIVE_FILTER: f64 = 0.5;
const FILTER_TIME: f64 = 0.5;

/// Factors of `speed_feedforward.share` while engine speed falls and while it rises.
const SHARE_OF_FALLS: f64 = 0.8;
const SHARE_OF_RISES: f64 = 0.5;

/// How far below the engine speeds (rpm) between which the low-pressure wastegate begins to take part.
const EARLIER: f64 = 500.0;

/// The rates of engine speed (rpm/s) from which on it begins to count as changing, and wholly does; for how long (s) after
/// that the firmer feedback fades.
const MOVES: (f64, f64) = (50.0, 150.0);
const FADES_IN: f64 = 2.0;

/// Whether engine speed has changed lately.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Motion {
    /// 1 while it changes; afterwards it fades to 0.
    share: f64,
}

impl Motion {
    /// The share at a sample with a rate of engine speed (rpm/s).
    pub fn sample(&mut self, sample_time: f64, rate: f64) -> f64 {
        let (slow, fast) = MOVES;
        self.share = larger(ramp(rate.abs(), slow, fast), self.share - sample_time / FADES_IN);
        self.share
    }
}

/// How firmly the feedback holds boost, by the share of the firmer one (0 to 1), at an engine speed (rpm, as on the day of
/// the schedule).
pub fn firmness(parameters: &Parameters, share: f64, engine_speed: f64) -> Firmness {
    let &Parameters { lambda, feedback_lambda, derivative_filter, ref allocation, .. } = parameters;
    let share = share * allocation.low_pressure_share(engine_speed + EARLIER);
    let identified = lambda + (feedback_lambda - lambda) * allocation.low_pressure_share(engine_speed);
    Firmness {
        lambda: identified + (LAMBDA * feedback_lambda - identified) * share,
        lead: LEAD * share,
        derivative_filter: derivative_filter * (1.0 + (DERIVATIVE_FILTER - 1.0) * share),
    }
}

/// The time constant (s) with which engine speed is filtered for its rate.
pub fn filter_time(parameters: &Parameters, day: &Day) -> f64 {
    let time = parameters.speed_feedforward.filter_time;
    if day.is_other { FILTER_TIME * time } else { time }
}

/// How much of the schedule's sensitivity to a rate of engine speed (rpm/s) counts.
pub fn share(parameters: &Parameters, day: &Day, rate: f64) -> f64 {
    let of_schedule = parameters.speed_feedforward.share;
    match (day.is_other, rate < 0.0) {
        (false, _) => of_schedule,
        (true, true) => SHARE_OF_FALLS * of_schedule,
        (true, false) => SHARE_OF_RISES * of_schedule,
    }
}
