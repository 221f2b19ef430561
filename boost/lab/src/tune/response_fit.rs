//! Least squares of a step's response, a problem for the Levenberg-Marquardt method.

use levenberg_marquardt::LeastSquaresProblem;
use nalgebra::{Const, Dyn, OMatrix, OVector, Owned, SVector};

/// The parameters of a curve that fit a response, which is sampled after each interval (s).
pub struct ResponseFit<'a, F, const N: usize> {
    response: &'a [f64],
    interval: f64,
    pub parameters: SVector<f64, N>,
    /// The curve with some parameters: at a time (s), its value and the derivatives with respect to them.
    curve: F,
}

impl<'a, F: Fn([f64; N]) -> C, C: Fn(f64) -> (f64, [f64; N]), const N: usize> ResponseFit<'a, F, N> {
    /// The problem, to be solved from a guess.
    pub fn new(response: &'a [f64], interval: f64, guess: [f64; N], curve: F) -> Self {
        Self { response, interval, parameters: guess.into(), curve }
    }

    /// The values of the curve and its derivatives at the samples.
    fn samples(&self) -> impl Iterator<Item = (f64, [f64; N])> {
        let curve = (self.curve)(self.parameters.into());
        (1..=self.response.len()).map(move |sample| curve(sample as f64 * self.interval))
    }

    fn residuals(&self) -> impl Iterator<Item = f64> {
        self.samples().zip(self.response).map(|((value, _), measured)| value - measured)
    }

    pub fn sum_of_squares(&self) -> f64 {
        self.residuals().map(|residual| residual * residual).sum()
    }
}

impl<F: Fn([f64; N]) -> C, C: Fn(f64) -> (f64, [f64; N]), const N: usize>
    LeastSquaresProblem<f64, Dyn, Const<N>> for ResponseFit<'_, F, N>
{
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Const<N>>;
    type ParameterStorage = Owned<f64, Const<N>>;

    fn set_params(&mut self, parameters: &SVector<f64, N>) {
        self.parameters = *parameters;
    }

    fn params(&self) -> SVector<f64, N> {
        self.parameters
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        Some(OVector::<f64, Dyn>::from_iterator(self.response.len(), self.residuals()))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, Const<N>>> {
        let slopes: Vec<_> = self.samples().map(|(_, slopes)| slopes).collect();
        Some(OMatrix::<f64, Dyn, Const<N>>::from_fn(slopes.len(), |row, column| slopes[row][column]))
    }
}
