//! The response of boost pressure to an engine speed step with the valves held, by least squares.
//!
//! At once the engine swallows more, and boost pressure falls by β with the short time constant of the volumes; then
//! the turbochargers speed up, and it rises to its new steady state: `−β (1 − exp(−t/τ)) + (K_N + β) (1 − exp(−t/T))`.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{Dyn, OMatrix, OVector, Owned, U4, Vector4};
use serde::{Deserialize, Serialize};

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
            .flat_map(|short: f64| {
                LONG.map(|long: f64| Vector4::new(fall, short.ln(), last + fall, long.ln()))
            })
            .filter_map(|guess| {
                let problem = Fit { response, interval, parameters: guess };
                let (fit, report) = LevenbergMarquardt::new().minimize(problem);
                report.termination.was_successful().then(|| fit.model())
            })
            .filter(|model| model.fall_time < model.rise_time)
            .min_by(|one, other| one.residual.total_cmp(&other.residual))
    }
}

/// The parameters: the drop and the logarithm of its time constant, then the same of the rise.
struct Fit<'a> {
    response: &'a [f64],
    interval: f64,
    parameters: Vector4<f64>,
}

impl Fit<'_> {
    fn times(&self) -> impl Iterator<Item = f64> {
        (1..=self.response.len()).map(|sample| sample as f64 * self.interval)
    }

    fn residuals(&self) -> impl Iterator<Item = f64> {
        let [fall, short, rise, long] = self.parameters.into();
        let (short, long) = (short.exp(), long.exp());
        let values =
            self.times().map(move |time| fall * (-time / short).exp_m1() - rise * (-time / long).exp_m1());
        values.zip(self.response).map(|(value, measured)| value - measured)
    }

    fn model(&self) -> SpeedResponse {
        let [fall, short, rise, long] = self.parameters.into();
        let squares: f64 = self.residuals().map(|residual| residual * residual).sum();
        SpeedResponse {
            fall,
            fall_time: short.exp(),
            gain: rise - fall,
            rise_time: long.exp(),
            residual: (squares / self.response.len() as f64).sqrt(),
        }
    }
}

impl LeastSquaresProblem<f64, Dyn, U4> for Fit<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U4>;
    type ParameterStorage = Owned<f64, U4>;

    fn set_params(&mut self, parameters: &Vector4<f64>) {
        self.parameters = *parameters;
    }

    fn params(&self) -> Vector4<f64> {
        self.parameters
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        Some(OVector::<f64, Dyn>::from_iterator(self.response.len(), self.residuals()))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U4>> {
        let [fall, short, rise, long] = self.parameters.into();
        let (short, long) = (short.exp(), long.exp());
        let by_amplitude =
            |sign: f64, constant: f64| self.times().map(move |time| sign * (-time / constant).exp_m1());
        let by_logarithm = |amplitude: f64, constant: f64| {
            self.times().map(move |time| amplitude * time / constant * (-time / constant).exp())
        };
        let columns = by_amplitude(1.0, short)
            .chain(by_logarithm(fall, short))
            .chain(by_amplitude(-1.0, long))
            .chain(by_logarithm(-rise, long));
        Some(OMatrix::<f64, Dyn, U4>::from_iterator(self.response.len(), columns))
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
