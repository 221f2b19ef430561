//! The model of paper eq. (10) from a step response: first order with a delay, by least squares.
//!
//! For a given delay, the Levenberg-Marquardt method finds gain and time constant. The delay is searched on a grid that
//! is refined around the best value: the sum of squares is continuous in it, but has a kink at each sample, where
//! gradient methods fail.

use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::{Matrix3, RowVector3};
use serde::{Deserialize, Serialize};

use super::response_fit::ResponseFit;

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
    /// The estimate's standard error for independent residuals.
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
        let guess = [last, ((reaches(0.63) + 1) as f64 * interval).ln()];
        let solve = |delay: f64, guess: [f64; 2]| {
            let problem = ResponseFit::new(response, interval, guess, |parameters| lag(parameters, delay));
            let (fit, report) = LevenbergMarquardt::new().minimize(problem);
            let [gain, logarithm] = fit.parameters.into();
            let solution = Solution { gain, logarithm, delay, squares: fit.sum_of_squares() };
            report.termination.was_successful().then_some(solution)
        };

        let mut spacing = LONGEST_DELAY * duration / f64::from(COARSEST);
        let delays = (0..=COARSEST).map(|index| f64::from(index) * spacing);
        let mut best = best_of(delays.filter_map(|delay| solve(delay, guess)))?;
        for _ in 1..GRIDS {
            let (middle, coarser) = (best.delay, spacing);
            spacing /= f64::from(REFINEMENT);
            let delays = (0..=2 * REFINEMENT).map(|index| middle - coarser + f64::from(index) * spacing);
            let start = [best.gain, best.logarithm];
            best = best_of(delays.filter(|delay| *delay >= 0.0).filter_map(|delay| solve(delay, start)))?;
        }
        best.model(response, interval)
    }

    /// The model's response to a step of 1, at a time (s) after it.
    pub fn at(&self, time: f64) -> f64 {
        let since = time - self.delay.value;
        if since <= 0.0 { 0.0 } else { -self.gain.value * (-since / self.time_constant.value).exp_m1() }
    }
}

/// The value of a step response of first order at a time (s), and its derivatives with respect to the parameters: the
/// gain and the logarithm of the time constant, which keeps it above zero.
fn lag([gain, logarithm]: [f64; 2], delay: f64) -> impl Fn(f64) -> (f64, [f64; 2]) {
    let time_constant = logarithm.exp();
    move |time| {
        // In time constants.
        let since = ((time - delay) / time_constant).max(0.0);
        (-gain * (-since).exp_m1(), [-(-since).exp_m1(), -gain * since * (-since).exp()])
    }
}

/// The parameters for a delay (s), with the sum of squares of the residuals.
struct Solution {
    gain: f64,
    logarithm: f64,
    delay: f64,
    squares: f64,
}

fn best_of(solutions: impl Iterator<Item = Solution>) -> Option<Solution> {
    solutions.min_by(|a, b| a.squares.total_cmp(&b.squares))
}

impl Solution {
    fn model(&self, response: &[f64], interval: f64) -> Option<FirstOrder> {
        let (gain, time_constant) = (self.gain, self.logarithm.exp());
        let count = response.len() as f64;
        // The derivatives by gain, time constant and delay.
        let mut information = Matrix3::zeros();
        let times =
            (1..=response.len()).map(|sample| (sample as f64 * interval - self.delay) / time_constant);
        for time in times.filter(|time| *time > 0.0) {
            let slope = gain / time_constant * (-time).exp();
            let row = RowVector3::new(-(-time).exp_m1(), -slope * time, -slope);
            information += row.transpose() * row;
        }
        let covariance = information.try_inverse()? * (self.squares / (count - 3.0));
        let estimate =
            |value, index| Estimate { value, standard_error: covariance[(index, index)].max(0.0).sqrt() };
        let mean = response.iter().sum::<f64>() / count;
        let total: f64 = response.iter().map(|value| (value - mean).powi(2)).sum();
        Some(FirstOrder {
            gain: estimate(gain, 0),
            time_constant: estimate(time_constant, 1),
            delay: estimate(self.delay, 2),
            determination: 1.0 - self.squares / total,
            residual: (self.squares / count).sqrt(),
        })
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
