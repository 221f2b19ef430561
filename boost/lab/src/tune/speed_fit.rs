//! The response of boost pressure to an engine speed step with the valves held, by least squares.
//!
//! At once the engine swallows more, and boost pressure falls by β with the short time constant of the volumes; then
//! the turbochargers speed up, and it rises to its new steady state: `−β (1 − exp(−t/τ)) + (K_N + β) (1 − exp(−t/T))`.

use levenberg_marquardt::LevenbergMarquardt;
use serde::{Deserialize, Serialize};

use super::response_fit::ResponseFit;

/// First guesses of the short time constant (s): the sum of squares has more than one minimum.
const SHORT: [f64; 3] = [0.03, 0.1, 0.3];
/// First guesses of the long one (s).
const LONG: [f64; 2] = [0.6, 1.5];

/// The model, per unit of the step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedResponse {
    /// β: the initial drop of boost pressure.
    pub fall: f64,
    /// τ: the time constant of the fall (s).
    pub fall_time: f64,
    /// `K_N`: the change at rest.
    pub gain: f64,
    /// T: the time constant of the rise (s).
    pub rise_time: f64,
    /// The root mean square of the residuals.
    pub residual: f64,
}

impl SpeedResponse {
    /// Fits a response that begins at time 0 with the value 0 and is sampled after each interval (s).
    ///
    /// None if no fit converges to a fall before the rise.
    pub fn fit(response: &[f64], interval: f64) -> Option<Self> {
        let &last = response.last()?;
        if response.len() < 10 || response.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let fall = -response.iter().copied().fold(0.0, f64::min);
        SHORT
            .into_iter()
            .flat_map(|short: f64| LONG.map(|long: f64| [fall, short.ln(), last + fall, long.ln()]))
            .filter_map(|guess| {
                let problem = ResponseFit::new(response, interval, guess, fall_and_rise);
                let (fit, report) = LevenbergMarquardt::new().minimize(problem);
                let [fall, short, rise, long] = fit.parameters.into();
                report.termination.was_successful().then(|| Self {
                    fall,
                    fall_time: short.exp(),
                    gain: rise - fall,
                    rise_time: long.exp(),
                    residual: (fit.sum_of_squares() / response.len() as f64).sqrt(),
                })
            })
            .filter(|model| model.fall_time < model.rise_time)
            .min_by(|one, other| one.residual.total_cmp(&other.residual))
    }

    /// The response at a time (s) after a step of 1.
    pub fn at(&self, time: f64) -> f64 {
        let &Self { fall, fall_time, gain, rise_time, .. } = self;
        fall * (-time / fall_time).exp_m1() - (gain + fall) * (-time / rise_time).exp_m1()
    }
}

/// The value of the response at a time (s), and its derivatives with respect to the parameters: the drop and the
/// logarithm of its time constant, then the same of the rise.
fn fall_and_rise([fall, short, rise, long]: [f64; 4]) -> impl Fn(f64) -> (f64, [f64; 4]) {
    let (short, long) = (short.exp(), long.exp());
    move |time| {
        let [of_fall, of_rise] = [short, long].map(|constant| (-time / constant).exp_m1());
        let slope = |amplitude: f64, constant: f64| amplitude * time / constant * (-time / constant).exp();
        (fall * of_fall - rise * of_rise, [of_fall, slope(fall, short), -of_rise, slope(-rise, long)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 0.0125;
    const SAMPLES: u32 = 400;

    fn response(fall: f64, fall_time: f64, gain: f64, rise_time: f64) -> Vec<f64> {
        let at = |time: f64| {
            -fall * (1.0 - (-time / fall_time).exp()) + (gain + fall) * (1.0 - (-time / rise_time).exp())
        };
        (1..=SAMPLES).map(|sample| at(f64::from(sample) * INTERVAL)).collect()
    }

    /// Parameters as on the plant model, with gains of both signs, and a rise as long as the record.
    #[test]
    fn a_response_gives_its_parameters() {
        for truth in
            [[27.0, 0.08, 4.0, 1.1], [12.0, 0.15, -3.0, 0.6], [50.0, 0.05, 60.0, 2.0], [12.0, 0.3, 1.0, 5.0]]
        {
            let [fall, fall_time, gain, rise_time] = truth;
            let fit = SpeedResponse::fit(&response(fall, fall_time, gain, rise_time), INTERVAL).unwrap();
            let found = [fit.fall, fit.fall_time, fit.gain, fit.rise_time];
            for (found, truth) in found.into_iter().zip(truth) {
                assert!((found / truth - 1.0).abs() < 1e-5, "{fit:?} of {truth}");
            }
        }
    }

    #[test]
    fn an_unusable_response_gives_no_model() {
        assert_eq!(SpeedResponse::fit(&[], INTERVAL), None);
        assert_eq!(SpeedResponse::fit(&[f64::NAN; 100], INTERVAL), None);
    }
}
