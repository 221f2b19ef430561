//! The identification of the maps: sweeps, steps, fits, and the values of other cells.
//!
//! The paper (section 6) steps the control signal at many boost pressures and engine speeds, and prints no
//! numbers; these are the ones that the maps of this repository's controller were made with.

use serde::Serialize;

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
    /// The least and the largest feedforward (%) at which responses are taken: between the wastegate's lift-off
    /// and its full stroke, with a margin for the step.
    pub fitted_duty: (f64, f64),
    /// The wastegate counts as shut from this remaining fraction of a sweep's range of boost pressure on.
    pub shut_part: f64,
    /// The feedforward (%) above the reachable range: the wastegate is shut, just below its lift-off.
    pub duty_above_reach: f64,
    /// The feedforward (%) below the reachable range.
    pub duty_below_reach: f64,
    /// The least magnitude of the gain (Pa/%): the feedback divides by it.
    pub least_gain: f64,
    /// The least delay (s): the derivative and the tracking time go to 0 with it.
    pub least_delay: f64,
}

impl Default for Procedure {
    fn default() -> Self {
        // Always down, so that friction in the actuator keeps its sign; in steps below 1 % where boost pressure
        // is steep.
        let coarse = [100.0, 85.0, 75.0, 70.0, 66.0, 62.0, 59.0];
        let fine = (0..=38).map(|index| 56.0 - 0.75 * f64::from(index));
        let duties = coarse.into_iter().chain(fine).chain([20.0]);
        // The turbochargers settle slowly where they are fast.
        let hold = |duty: f64| (duty, if duty < 40.0 { 30.0 } else { 15.0 });
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
        }
    }
}

impl Procedure {
    /// The simulated time of a sweep (s).
    pub fn sweep_duration(&self) -> f64 {
        self.sweep.iter().map(|(_, duration)| duration).sum()
    }

    /// The simulated time of a point of the grid (s).
    pub fn point_duration(&self) -> f64 {
        self.settling_duration + 2.0 * self.response_duration
    }
}
