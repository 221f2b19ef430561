//! Least squares with standard errors.
//!
//! Standard errors come from the Jacobian and the residuals. Residuals within a phase are correlated: a filter, drift
//! or model error moves many of them together, and the formula for independent residuals underestimates the errors. So
//! they are computed twice: from the residuals' variance, and from the influence of each phase, which allows any
//! correlation within a phase: the bias reduced linearization (CR2) of R. M. Bell and D. F. `McCaffrey`, Survey
//! Methodology 28, 2002. The larger one is used.

use anyhow::{Result, bail};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// A column whose part orthogonal to the others is this much shorter than the longest does not determine its
/// parameter.
const DEPENDENT: f64 = 1e-9;

/// A phase with more than this leverage determines a parameter by itself: its residuals would be zero whatever the
/// errors.
const ALONE: f64 = 1.0 - 1e-6;

/// A parameter with a larger relative standard error is not determined by the data.
const MOST_RELATIVE_ERROR: f64 = 0.5;

/// The tolerance relative to the sum of squares and the parameters: far below any standard error, above the error of
/// numerical derivatives.
const TOLERANCE: f64 = 1e-9;

/// The maximum iterations per parameter, plus one; if a solution exists, two or three suffice.
const PATIENCE: usize = 10;

/// The result of least squares.
#[derive(Clone, Debug)]
pub struct Solution {
    pub parameters: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

impl Solution {
    pub fn standard_error(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }
}

/// Solves a linear problem. `phases` are the numbers of consecutive rows that belong together.
pub fn linear(design: &DMatrix<f64>, observed: &DVector<f64>, phases: &[usize]) -> Result<Solution> {
    let root = inverse_root(design)?;
    // Scaled columns, since powers of a duty in percent differ by orders of magnitude.
    let scales = scales(design);
    let scaled = design * DMatrix::from_diagonal(&scales.map(f64::recip));
    let Ok(parameters) = scaled.svd(true, true).solve(observed, f64::EPSILON) else {
        bail!("the singular value decomposition failed")
    };
    let parameters = parameters.component_div(&scales);
    let residuals = observed - design * &parameters;
    let covariance = covariance(design, &residuals, phases, &root, 0.0);
    Ok(Solution { parameters, covariance })
}

/// Solves a nonlinear problem by the Levenberg-Marquardt method from a start. `residuals` are measured minus computed;
/// the parameters are of the order of 1. `least_variance` is a lower bound of the measurements' variance.
pub fn nonlinear(
    start: &[f64],
    phases: &[usize],
    least_variance: f64,
    residuals: impl Fn(&[f64]) -> Vec<f64>,
) -> Result<Solution> {
    let problem = LeastSquares { parameters: DVector::from_row_slice(start), residuals };
    let (problem, report) =
        LevenbergMarquardt::new().with_tol(TOLERANCE).with_patience(PATIENCE).minimize(problem);
    if !report.termination.was_successful() {
        bail!(
            "the Levenberg-Marquardt method did not converge: {}",
            reason(&report.termination, start.len())
        );
    }
    let jacobian = problem.derivatives();
    let root = inverse_root(&jacobian)?;
    let residuals = problem.values(&problem.parameters);
    let covariance = covariance(&jacobian, &residuals, phases, &root, least_variance);
    Ok(Solution { parameters: problem.parameters, covariance })
}

/// Why the method gave up on a number of parameters, and what to do.
fn reason(termination: &TerminationReason, parameters: usize) -> String {
    match termination {
        TerminationReason::LostPatience => format!(
            "it has not ended after {} evaluations; the data may not determine all parameters, or the plant's values, \
             from which it starts, are too far from theirs",
            PATIENCE * (parameters + 1)
        ),
        TerminationReason::Numerical(what) => {
            format!("{what} is not finite; the data or the plant's values may be out of range")
        }
        TerminationReason::NoImprovementPossible(bound) => {
            format!("rounding ends it before {bound} is met; the data may not determine all parameters")
        }
        TerminationReason::NoParameters => "there is no parameter to fit".to_owned(),
        TerminationReason::NoResiduals => "there is no measurement to fit".to_owned(),
        TerminationReason::User(what) | TerminationReason::WrongDimensions(what) => (*what).to_owned(),
        TerminationReason::ResidualsZero
        | TerminationReason::Orthogonal
        | TerminationReason::Converged { .. } => "it did converge".to_owned(),
    }
}

/// A solution for the parameters determined by the data.
pub struct Reliable {
    /// The parameters, in the solution's order.
    pub free: Vec<usize>,
    pub solution: Solution,
    /// The parameters left out, with their relative standard errors.
    pub left_out: Vec<(usize, f64)>,
}

impl Reliable {
    /// Fits parameters, and leaves out the worst one until no relative standard error is more than
    /// [`MOST_RELATIVE_ERROR`]. `relative` gives this error for a position in the solution and the parameter there.
    pub fn fit(
        mut free: Vec<usize>,
        fit: impl Fn(&[usize]) -> Result<Solution>,
        relative: impl Fn(&Solution, usize, usize) -> f64,
    ) -> Result<Self> {
        let mut left_out = vec![];
        loop {
            if free.is_empty() {
                bail!("every standard error would be more than {:.0} %", 100.0 * MOST_RELATIVE_ERROR);
            }
            let solution = fit(&free)?;
            let errors =
                free.iter().enumerate().map(|(place, &index)| (place, relative(&solution, place, index)));
            match errors.max_by(|(_, one), (_, other)| one.total_cmp(other)) {
                Some((place, error)) if error > MOST_RELATIVE_ERROR => {
                    left_out.push((free.remove(place), error));
                }
                _ => return Ok(Self { free, solution, left_out }),
            }
        }
    }
}

struct LeastSquares<F> {
    parameters: DVector<f64>,
    residuals: F,
}

impl<F: Fn(&[f64]) -> Vec<f64>> LeastSquares<F> {
    fn values(&self, parameters: &DVector<f64>) -> DVector<f64> {
        DVector::from_vec((self.residuals)(parameters.as_slice()))
    }

    /// The residuals' derivatives by central differences.
    fn derivatives(&self) -> DMatrix<f64> {
        const STEP: f64 = 1e-5;
        let column = |index: usize| {
            let at = |step: f64| {
                let mut parameters = self.parameters.clone();
                parameters[index] += step;
                self.values(&parameters)
            };
            (at(STEP) - at(-STEP)) / (2.0 * STEP)
        };
        let columns: Vec<_> = (0..self.parameters.len()).map(column).collect();
        DMatrix::from_columns(&columns)
    }
}

impl<F: Fn(&[f64]) -> Vec<f64>> LeastSquaresProblem<f64, Dyn, Dyn> for LeastSquares<F> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, parameters: &DVector<f64>) {
        self.parameters.copy_from(parameters);
    }

    fn params(&self) -> DVector<f64> {
        self.parameters.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.values(&self.parameters))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.derivatives())
    }
}

fn scales(matrix: &DMatrix<f64>) -> DVector<f64> {
    let lengths: Vec<_> = matrix.column_iter().map(|column| column.norm()).collect();
    DVector::from_vec(lengths).map(|length| if length > 0.0 { length } else { 1.0 })
}

/// A matrix B with B·Bᵀ = (JᵀJ)⁻¹; an error when parameters are not distinguishable.
fn inverse_root(jacobian: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    if jacobian.nrows() <= jacobian.ncols() {
        bail!("{} measurements are too few for {} parameters", jacobian.nrows(), jacobian.ncols());
    }
    let unscaled = DMatrix::from_diagonal(&scales(jacobian).map(f64::recip));
    let triangle = (jacobian * &unscaled).qr().r();
    let least = triangle.diagonal().iter().fold(f64::INFINITY, |least, value| least.min(value.abs()));
    let inverse = triangle.try_inverse().filter(|_| least > DEPENDENT);
    let Some(inverse) = inverse else { bail!("the data do not distinguish the parameters") };
    Ok(unscaled * inverse)
}

fn covariance(
    jacobian: &DMatrix<f64>,
    residuals: &DVector<f64>,
    phases: &[usize],
    root: &DMatrix<f64>,
    least_variance: f64,
) -> DMatrix<f64> {
    let (rows, columns) = jacobian.shape();
    let variance = residuals.norm_squared() / (rows - columns) as f64;
    let independent = root * root.transpose() * variance.max(least_variance);
    let mut by_phases = DMatrix::zeros(columns, columns);
    let mut first = 0;
    for &rows in phases {
        let phase = jacobian.rows(first, rows) * root;
        let gradient = phase.transpose() * residuals.rows(first, rows);
        // A fit follows phases with high leverage, so their residuals are smaller than their errors.
        let SymmetricEigen { eigenvectors, eigenvalues } = (phase.transpose() * &phase).symmetric_eigen();
        let grown = eigenvalues.map(|share| if share < ALONE { (1.0 - share).sqrt().recip() } else { 0.0 });
        let change = root * (&eigenvectors * grown.component_mul(&eigenvectors.tr_mul(&gradient)));
        by_phases += &change * change.transpose();
        first += rows;
    }
    let factors = DVector::from_fn(columns, |index, _| {
        (by_phases[(index, index)] / independent[(index, index)]).sqrt().max(1.0)
    });
    let factors = DMatrix::from_diagonal(&factors);
    &factors * independent * factors
}

pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (count, sum) =
        values.into_iter().fold((0_u32, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// NaN without values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    use super::*;

    /// The estimates of many noisy lines scatter by their standard errors.
    fn scatter(correlation: f64) -> (f64, f64) {
        const ROWS: usize = 600;
        const PHASE: usize = 20;
        const TRIALS: u32 = 400;
        let mut generator = Pcg64::seed_from_u64(5);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut generator) };
        let design = DMatrix::from_fn(
            ROWS,
            2,
            |row, column| {
                if column == 0 { 1.0 } else { (row / PHASE) as f64 / 30.0 }
            },
        );
        let (mut squares, mut errors) = (0.0, 0.0);
        for _ in 0..TRIALS {
            let mut common = 0.0;
            let observed = DVector::from_fn(ROWS, |row, _| {
                if row % PHASE == 0 {
                    common = normal();
                }
                2.0 + 3.0 * design[(row, 1)] + normal() + correlation * common
            });
            let Ok(solution) = linear(&design, &observed, &[PHASE; ROWS / PHASE]) else { return (0.0, 0.0) };
            squares += (solution.parameters[1] - 3.0).powi(2);
            errors += solution.standard_error(1);
        }
        ((squares / f64::from(TRIALS)).sqrt(), errors / f64::from(TRIALS))
    }

    #[test]
    fn standard_errors_are_the_scatter_of_estimates() {
        // The scatter of 400 trials is accurate to 1/√800, 3.5 %. The larger of two estimates is too large by at most
        // the scatter of the one from 30 phases, 1/√60 or 13 %.
        for correlation in [0.0, 1.0] {
            let (scatter, error) = scatter(correlation);
            assert!((0.9..1.2).contains(&(error / scatter)), "{correlation}: {error} for {scatter}");
        }
    }

    #[test]
    fn indistinguishable_parameters_are_refused() {
        let design = DMatrix::from_fn(10, 2, |row, column| row as f64 * (column + 1) as f64);
        let observed = DVector::from_element(10, 1.0);
        assert!(linear(&design, &observed, &[10]).is_err());
        assert!(linear(&design.rows(0, 2).into_owned(), &observed.rows(0, 2).into_owned(), &[2]).is_err());
    }

    /// The least squares of a decay are at infinity: each step of Gauss and Newton goes one time constant on.
    #[test]
    fn a_fit_without_an_end_says_why_in_a_sentence() {
        let decay = |p: &[f64]| vec![(-p[0]).exp(); 3];
        let message = nonlinear(&[0.0], &[3], 0.0, decay).unwrap_err().to_string();
        assert!(message.contains("it has not ended after 20 evaluations; the data may"), "{message}");
        assert!(!message.contains("LostPatience"), "{message}");
    }

    #[test]
    fn a_nonlinear_problem_is_solved_with_its_errors() -> Result<()> {
        let mut generator = Pcg64::seed_from_u64(1);
        let times: Vec<_> = (0..200).map(|index| 0.02 * f64::from(index)).collect();
        let noise: Vec<f64> = times
            .iter()
            .map(|_| 0.01 * Distribution::<f64>::sample(&StandardNormal, &mut generator))
            .collect();
        let observed: Vec<_> =
            times.iter().zip(&noise).map(|(time, noise)| 2.0 * (-time / 0.7).exp() + noise).collect();
        let solution = nonlinear(&[1.0, 1.0], &[1; 200], 0.0, |parameters| {
            let model = times.iter().map(|time| parameters[0] * (-time / parameters[1]).exp());
            observed.iter().zip(model).map(|(observed, model)| observed - model).collect()
        })?;
        for (index, truth) in [2.0, 0.7].into_iter().enumerate() {
            let error = solution.standard_error(index);
            assert!((solution.parameters[index] - truth).abs() < 3.0 * error);
            assert!(error < 0.01);
        }
        Ok(())
    }
}
