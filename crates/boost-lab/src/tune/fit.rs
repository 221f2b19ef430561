//! The model of paper eq. (10) from a step response: first order with a delay, by least squares.
//!
//! For a given delay, the Levenberg-Marquardt method finds gain and time constant. The delay is searched on a grid that
//! is refined around the best value: the sum of squares is continuous in it, but has a kink at each sample, where
//! gradient methods fail.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{Dyn, Matrix3, OMatrix, OVector, Owned, RowVector3, U2, Vector2};
use serde::{Deserialize, Serialize};

/// The refinement from one grid of delays to the next.
const REFINEMENT: u32 = 10;
/// The number of grids; the last resolves 1e-5 of the response's duration over [`COARSEST`].
const GRIDS: u32 = 5;
/// The largest delay, as a fraction of the response.
const LONGEST_DELAY: f64 = 0.25;
/// The number of delays in the first grid.
const COARSEST: u32 = 30;

/// A first-order model with delay, per unit of the step, with the quality of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FirstOrder {
    pub gain: Estimate,
    /// The time constant (s).
    pub time_constant: Estimate,
    /// The delay (s).
    pub delay: Estimate,
    /// The coefficient of determination R²: the fraction of the response's sum of squares explained by the model.
    pub determination: f64,
    /// The root mean square of the residuals.
    pub residual: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The estimate, in the unit of the parameter.
    pub value: f64,
    /// Its standard error for independent residuals.
    pub standard_error: f64,
}

impl FirstOrder {
    /// Fits a response that starts at time 0 with the value 0 and is sampled after each interval (s).
    ///
    /// None if no model fits: the response does not change, or no fit converges.
    pub fn fit(response: &[f64], interval: f64) -> Option<Self> {
        let last = *response.last()?;
        if response.len() < 10 || last == 0.0 || response.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let duration = response.len() as f64 * interval;
        let reaches = |part: f64| response.iter().position(|value| value / last >= part).unwrap_or(0);
        let guess = Vector2::new(last, ((reaches(0.63) + 1) as f64 * interval).ln());

        let mut spacing = LONGEST_DELAY * duration / f64::from(COARSEST);
        let mut best = best_of((0..=COARSEST).map(|index| f64::from(index) * spacing), |delay| {
            ResponseFit::solve(response, interval, delay, guess)
        })?;
        for _ in 1..GRIDS {
            let (middle, coarser) = (best.delay, spacing);
            spacing /= f64::from(REFINEMENT);
            let delays = (0..=2 * REFINEMENT).map(|index| middle - coarser + f64::from(index) * spacing);
            let start = best.parameters;
            best = best_of(delays.filter(|delay| *delay >= 0.0), |delay| {
                ResponseFit::solve(response, interval, delay, start)
            })?;
        }
        best.model()
    }

    /// The model's response to a step of 1, at a time (s) after it.
    pub fn at(&self, time: f64) -> f64 {
        let since = time - self.delay.value;
        if since <= 0.0 { 0.0 } else { -self.gain.value * (-since / self.time_constant.value).exp_m1() }
    }
}

/// The solution with the least sum of squares.
fn best_of<'a>(
    delays: impl Iterator<Item = f64>,
    solve: impl Fn(f64) -> Option<ResponseFit<'a>>,
) -> Option<ResponseFit<'a>> {
    delays.filter_map(solve).min_by(|a, b| a.sum_of_squares().total_cmp(&b.sum_of_squares()))
}

/// Gain and time constant for a delay. The parameters are the gain and the logarithm of the time constant,
/// which keeps it above zero.
struct ResponseFit<'a> {
    response: &'a [f64],
    interval: f64,
    delay: f64,
    parameters: Vector2<f64>,
}

impl<'a> ResponseFit<'a> {
    fn solve(response: &'a [f64], interval: f64, delay: f64, guess: Vector2<f64>) -> Option<Self> {
        let problem = Self { response, interval, delay, parameters: guess };
        let (problem, report) = LevenbergMarquardt::new().minimize(problem);
        report.termination.was_successful().then_some(problem)
    }

    /// Times since the delay, in time constants; below zero before it.
    fn times(&self) -> impl Iterator<Item = f64> {
        let (delay, time_constant) = (self.delay, self.parameters[1].exp());
        (1..=self.response.len()).map(move |sample| (sample as f64 * self.interval - delay) / time_constant)
    }

    fn residuals(&self) -> impl Iterator<Item = f64> {
        let values = self.times().map(|time| -self.parameters[0] * (-time.max(0.0)).exp_m1());
        values.zip(self.response).map(|(value, measured)| value - measured)
    }

    fn sum_of_squares(&self) -> f64 {
        self.residuals().map(|residual| residual * residual).sum()
    }

    fn model(&self) -> Option<FirstOrder> {
        let (gain, time_constant) = (self.parameters[0], self.parameters[1].exp());
        let count = self.response.len() as f64;
        let left = self.sum_of_squares();
        // The derivatives by gain, time constant and delay.
        let mut information = Matrix3::zeros();
        for time in self.times().filter(|time| *time > 0.0) {
            let slope = gain / time_constant * (-time).exp();
            let row = RowVector3::new(-(-time).exp_m1(), -slope * time, -slope);
            information += row.transpose() * row;
        }
        let covariance = information.try_inverse()? * (left / (count - 3.0));
        let estimate =
            |value, index| Estimate { value, standard_error: covariance[(index, index)].max(0.0).sqrt() };
        let mean = self.response.iter().sum::<f64>() / count;
        let total: f64 = self.response.iter().map(|value| (value - mean).powi(2)).sum();
        Some(FirstOrder {
            gain: estimate(gain, 0),
            time_constant: estimate(time_constant, 1),
            delay: estimate(self.delay, 2),
            determination: 1.0 - left / total,
            residual: (left / count).sqrt(),
        })
    }
}

impl LeastSquaresProblem<f64, Dyn, U2> for ResponseFit<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U2>;
    type ParameterStorage = Owned<f64, U2>;

    fn set_params(&mut self, parameters: &Vector2<f64>) {
        self.parameters = *parameters;
    }

    fn params(&self) -> Vector2<f64> {
        self.parameters
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        Some(OVector::<f64, Dyn>::from_iterator(self.response.len(), self.residuals()))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U2>> {
        let gain = self.parameters[0];
        let by_gain = self.times().map(|time| -(-time.max(0.0)).exp_m1());
        let by_logarithm = self.times().map(|time| -gain * time.max(0.0) * (-time.max(0.0)).exp());
        Some(OMatrix::<f64, Dyn, U2>::from_iterator(self.response.len(), by_gain.chain(by_logarithm)))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64;

    use super::*;

    const INTERVAL: f64 = 0.0125;
    const SAMPLES: u32 = 480;

    fn response(gain: f64, time_constant: f64, delay: f64) -> Vec<f64> {
        let at = |time: f64| {
            if time > delay { gain * (1.0 - (-(time - delay) / time_constant).exp()) } else { 0.0 }
        };
        (1..=SAMPLES).map(|sample| at(f64::from(sample) * INTERVAL)).collect()
    }

    /// Delays at a sample, between two, and none. The last grid's spacing is 1e-5 s.
    #[test]
    fn a_response_of_first_order_gives_its_parameters() {
        for (gain, time_constant, delay) in
            [(-4200.0, 1.2, 0.075), (-9000.0, 2.03, 0.0819), (35.0, 0.4, 0.0), (-1.0, 0.9, 1.2345)]
        {
            let fit = FirstOrder::fit(&response(gain, time_constant, delay), INTERVAL).unwrap();
            assert!((fit.delay.value - delay).abs() < 1e-5, "{fit:?}");
            assert!((fit.gain.value / gain - 1.0).abs() < 1e-5, "{fit:?}");
            assert!((fit.time_constant.value / time_constant - 1.0).abs() < 5e-5, "{fit:?}");
            assert!(fit.determination > 1.0 - 1e-8, "{fit:?}");
        }
    }

    /// Over many draws of the noise the parameters scatter as their standard errors say: the mean of
    /// ((estimate − truth) / standard error)² over 50 draws is 1 with a standard deviation of √(2/50) = 0.2.
    #[test]
    fn standard_errors_are_how_much_noise_scatters_the_parameters() {
        let truth = [-4200.0, 1.2, 0.0819];
        let clean = response(truth[0], truth[1], truth[2]);
        let noise = Normal::new(0.0, 100.0).unwrap();
        let mut generator = Pcg64::seed_from_u64(1);
        let mut squares = [0.0; 3];
        for _ in 0..50 {
            let noisy: Vec<_> = clean.iter().map(|value| value + noise.sample(&mut generator)).collect();
            let fit = FirstOrder::fit(&noisy, INTERVAL).unwrap();
            for (index, estimate) in [fit.gain, fit.time_constant, fit.delay].into_iter().enumerate() {
                squares[index] += ((estimate.value - truth[index]) / estimate.standard_error).powi(2) / 50.0;
            }
        }
        assert!(squares.iter().all(|square| (0.4..1.6).contains(square)), "{squares:?}");
    }

    #[test]
    fn an_unusable_response_gives_no_model() {
        assert_eq!(FirstOrder::fit(&[], INTERVAL), None);
        assert_eq!(FirstOrder::fit(&[0.0; 100], INTERVAL), None);
        assert_eq!(FirstOrder::fit(&[f64::NAN; 100], INTERVAL), None);
    }
}
