//! The identification of the maps: sweeps, steps, fits, and the values of other cells.
//!
//! The paper (section 6) steps the control signal at many boost pressures and engine speeds, without numbers; these are
//! the ones used for the maps of this repository's controller.

use clap::ValueEnum;
use serde::Serialize;

/// The tuned schedule: the controller's choice between strategies, with its names there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum Strategy {
    /// One virtual duty for all three valves
    SplitRange,
    /// The duty of the high-pressure wastegate
    BySpeed,
}

/// The numbers of the procedure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Procedure {
    /// The duties (%) of a sweep in their order, and their durations (s).
    pub sweep: Vec<(f64, f64)>,
    /// How long a duty is held before it is stepped (s).
    pub settling_duration: f64,
    /// How long a response is recorded (s).
    pub response_duration: f64,
    /// The step of the duty (%).
    pub duty_step: f64,
    /// The minimum and maximum feedforward (%) at which responses are taken: between wastegate lift-off and full
    /// stroke, with a margin for the step.
    pub fitted_duty: (f64, f64),
    /// The wastegate counts as shut once this fraction of a sweep's boost pressure range remains.
    pub shut_part: f64,
    /// The feedforward (%) above the reachable range: wastegate shut, just below lift-off.
    pub duty_above_reach: f64,
    /// The feedforward (%) below the reachable range.
    pub duty_below_reach: f64,
    /// The minimum magnitude of the gain (Pa/%), by which the feedback divides.
    pub least_gain: f64,
    /// The minimum delay (s): derivative and tracking time go to 0 with it.
    pub least_delay: f64,
    /// Additional numbers for the strategy `split_range`.
    pub split_range: Option<SplitRange>,
}

/// The procedure for a virtual duty that sets all three valves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SplitRange {
    /// The sweep where the low-pressure wastegate takes part, as virtual duties (%) with durations (s).
    pub sweep: Vec<(f64, f64)>,
    /// The minimum and maximum feedforward in that sweep at which responses are taken.
    pub fitted_duty: (f64, f64),
    /// The feedforward there below the reachable range: the low-pressure wastegate is fully open.
    pub duty_below_reach: f64,
    /// Models with a gain closer to 0 (Pa/%) are rejected: a loop needs a valve with an effect.
    pub least_fitted_gain: f64,
    /// Models with a longer time constant (s) are rejected as drift.
    pub longest_time_constant: f64,
    /// The step of engine speed (rpm).
    pub speed_step: f64,
    /// The recorded duration of the response to engine speed (s).
    pub speed_response_duration: f64,
    /// The maximum high-pressure shaft speed at rest (rpm).
    pub shaft_speed_limit: f64,
}

/// The largest and smallest of a sweep's fine duties (%), between which boost pressure is steep; and the last duty.
const FINE: (f64, f64) = (56.0, 27.5);
const LAST: f64 = 20.0;

/// Fast turbochargers settle slowly.
fn hold(duty: f64) -> (f64, f64) {
    (duty, if duty < 40.0 { 30.0 } else { 15.0 })
}

/// Duties from one down to another by a step.
fn down(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    (0..).map(move |index| from - step * f64::from(index)).take_while(move |duty| *duty >= to)
}

impl Default for Procedure {
    /// The procedure for the strategy `by_speed`.
    fn default() -> Self {
        // Always downwards, so that actuator friction keeps its sign; in steps below 1 % where boost pressure is steep.
        let coarse = [100.0, 85.0, 75.0, 70.0, 66.0, 62.0, 59.0];
        let duties = coarse.into_iter().chain(down(FINE.0, FINE.1, 0.75)).chain([LAST]);
        Self {
            sweep: duties.map(hold).collect(),
            settling_duration: 30.0,
            response_duration: 12.0,
            duty_step: 1.0,
            fitted_duty: (29.0, 72.0),
            shut_part: 1e-3,
            duty_above_reach: 26.0,
            duty_below_reach: 100.0,
            least_gain: 1000.0,
            least_delay: 0.05,
            split_range: None,
        }
    }
}

impl Procedure {
    /// For the strategy `split_range`, whose low-pressure wastegate is fully open at a virtual duty (%).
    pub fn split_range(low_pressure_open: f64) -> Self {
        // The low-pressure wastegate opens along a hyperbola, so the largest duties move boost pressure least.
        let duties = down(low_pressure_open, 76.0, 2.0)
            .chain(down(75.0, 57.0, 1.0))
            .chain(down(FINE.0, FINE.1, 0.75))
            .chain([LAST]);
        let by_speed = Self::default();
        Self {
            split_range: Some(SplitRange {
                sweep: duties.map(hold).collect(),
                fitted_duty: (by_speed.fitted_duty.0, low_pressure_open - 2.0),
                duty_below_reach: low_pressure_open,
                least_fitted_gain: 20.0,
                longest_time_constant: 5.0,
                speed_step: 25.0,
                speed_response_duration: 5.0,
                shaft_speed_limit: 205e3,
            }),
            ..by_speed
        }
    }

    /// The range of duties, wide where the low-pressure wastegate takes part.
    pub fn range(&self, is_wide: bool) -> Range<'_> {
        match &self.split_range {
            Some(wide) if is_wide => Range {
                sweep: &wide.sweep,
                fitted_duty: wide.fitted_duty,
                duty_below_reach: wide.duty_below_reach,
            },
            _ => Range {
                sweep: &self.sweep,
                fitted_duty: self.fitted_duty,
                duty_below_reach: self.duty_below_reach,
            },
        }
    }

    /// The simulated time of a point of the grid (s).
    pub fn point_duration(&self) -> f64 {
        let of_speed = self.split_range.as_ref().map_or(0.0, |split| split.speed_response_duration);
        self.settling_duration + 2.0 * (self.response_duration + of_speed)
    }
}

/// The duties of an engine speed.
#[derive(Clone, Copy, Debug)]
pub struct Range<'a> {
    pub sweep: &'a [(f64, f64)],
    pub fitted_duty: (f64, f64),
    pub duty_below_reach: f64,
}

impl Range<'_> {
    /// The simulated time of the sweep (s).
    pub fn sweep_duration(&self) -> f64 {
        self.sweep.iter().map(|(_, duration)| duration).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sweep for the maps of this repository's controller.
    #[test]
    fn the_sweep_of_the_virtual_duty() {
        let procedure = Procedure::split_range(102.15);
        let duties: Vec<_> = procedure.range(true).sweep.iter().map(|(duty, _)| *duty).collect();
        let near = |index: usize, duty: f64| assert!((duties[index] - duty).abs() < 1e-9, "{duties:?}");
        // 14 by 2 %, 19 by 1 %, 39 by 0.75 %, and the last.
        assert_eq!(duties.len(), 14 + 19 + 39 + 1);
        for (index, duty) in
            [(0, 102.15), (13, 76.15), (14, 75.0), (32, 57.0), (33, 56.0), (71, 27.5), (72, 20.0)]
        {
            near(index, duty);
        }
        assert_eq!(procedure.range(false).sweep, Procedure::default().range(true).sweep);
    }
}
