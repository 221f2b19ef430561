//! Starts at rest: [`Equations::prepare`](crate::Equations::prepare) finds the steady state of a model, and
//! [`Equations::initialize`](crate::Equations::initialize) starts from it.
//!
//! It is found by pseudo-transient continuation. Each iteration is one linearized implicit Euler step, (1/Δt − J)·Δx =
//! f(x). While Δt is short this follows the transient from the guess, and so finds the steady state that the model would
//! reach; as the changes become small, Δt grows and the iteration becomes Newton's, which converges to the precision of
//! the arithmetic (Kelley and Keyes, Convergence analysis of pseudo-transient continuation, SIAM J. Numer. Anal. 35(2),
//! 1998).

use core::{array, fmt};

use crate::error::Error;
use crate::integrator::dense;
use crate::number::{Dual, Number};

/// The pseudo time step of the first iteration in seconds.
const FIRST_STEP: f64 = 1e-3;
/// The pseudo time step in seconds above which the iteration is Newton's.
const NEWTON_STEP: f64 = 1e7;
/// The largest change of a scaled unknown in one iteration.
const LARGEST_CHANGE: f64 = 0.2;
/// The largest fraction of a step's residual that may remain; above, the step was too long for its linearization.
const LARGEST_CONTRACTION: f64 = 0.8;
/// A change of the scaled unknowns below which Newton's iteration has converged up to rounding.
const CONVERGED: f64 = 1e-10;
/// The most iterations; tens are usual.
const MOST_ITERATIONS: usize = 400;
/// Newton iterations after convergence; the one with the smallest residual is used.
const POLISHING_ITERATIONS: usize = 4;

/// Why no steady state was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSteadyState {
    /// The Jacobian is singular: any steady state is one of infinitely many.
    NotIsolated,
    /// The iteration does not converge.
    NotConverged,
}

impl fmt::Display for NoSteadyState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotIsolated => "no isolated steady state exists",
            Self::NotConverged => "no steady state was found",
        })
    }
}

impl From<NoSteadyState> for Error {
    fn from(reason: NoSteadyState) -> Self {
        Self::new(reason.to_string())
    }
}

/// Finds the positive unknowns at which the rates of change are 0, from a guess.
///
/// `rates` computes the unknowns' rates of change, in 1/s times their units; `scales` is the magnitude of each unknown.
///
/// # Errors
/// Why there is none.
pub fn find<const N: usize>(
    rates: impl Fn([Dual; N]) -> [Dual; N],
    guess: [f64; N],
    scales: &[f64; N],
) -> Result<[f64; N], NoSteadyState> {
    let system = Scaled { rates, scales };
    let mut y: [f64; N] = array::from_fn(|i| guess[i] / scales[i]);
    let (mut slopes, mut jacobian) = (system.rates(&y), system.jacobian(&y));
    let mut step = FIRST_STEP;
    for _ in 0..MOST_ITERATIONS {
        let newton = step >= NEWTON_STEP;
        let damping = if newton { 0.0 } else { 1.0 / step };
        let change = match Factors::of(&jacobian, damping).and_then(|factors| factors.solve(slopes)) {
            Some(change) => change,
            None if newton => return Err(NoSteadyState::NotIsolated),
            None => return Err(NoSteadyState::NotConverged),
        };
        let settled = magnitude(&change) < CONVERGED;
        if newton && settled {
            return Ok(system.unscaled(&system.polish(y)?));
        }
        let share = admissible_share(&y, &change);
        let next: [f64; N] = array::from_fn(|i| y[i] + share * change[i]);
        let next_slopes = system.rates(&next);
        // The remaining fraction of the implicit Euler step's residual.
        let left: [f64; N] = array::from_fn(|i| next_slopes[i] - damping * share * change[i]);
        let contraction = magnitude(&left) / magnitude(&slopes);
        if settled || share >= 1.0 && contraction < LARGEST_CONTRACTION {
            (y, slopes, jacobian) = (next, next_slopes, system.jacobian(&next));
            // At convergence, `contraction` is a quotient of rounding errors.
            let growth = if settled { 10.0 } else { (0.3 / contraction).clamp(0.5, 10.0) };
            step = (step * growth).min(NEWTON_STEP);
        } else {
            step *= 0.2;
        }
    }
    Err(NoSteadyState::NotConverged)
}

/// The unknowns that were found, as a function of all that the rates depend on, by the implicit function theorem: they
/// keep their values, and change such that the rates stay 0.
///
/// `rates` computes them over the number type of the equations, `still` with all else constant.
pub fn follow<T: Number, const N: usize>(
    found: [f64; N],
    scales: &[f64; N],
    rates: impl FnOnce([T; N]) -> [T; N],
    still: impl Fn([Dual; N]) -> [Dual; N],
) -> [T; N] {
    let mut unknowns = found.map(T::from);
    let along = rates(unknowns);
    if along.iter().all(|rate| rate.is_constant(rate.value())) {
        return unknowns;
    }
    let system = Scaled { rates: still, scales };
    let factors = Factors::of(&system.jacobian(&array::from_fn(|i| found[i] / scales[i])), 0.0);
    for (position, rate) in along.into_iter().enumerate() {
        let right = array::from_fn(|i| if i == position { 1.0 / scales[i] } else { 0.0 });
        // A steady state that was found is isolated.
        let change = factors.as_ref().and_then(|factors| factors.solve(right)).unwrap_or([f64::NAN; N]);
        for (unknown, (change, scale)) in unknowns.iter_mut().zip(change.into_iter().zip(scales)) {
            *unknown += rate.mapped(0.0, change * scale);
        }
    }
    unknowns
}

/// Rates of change over scaled unknowns, scaled alike.
struct Scaled<'a, F, const N: usize> {
    rates: F,
    scales: &'a [f64; N],
}

impl<F: Fn([Dual; N]) -> [Dual; N], const N: usize> Scaled<'_, F, N> {
    fn unscaled(&self, y: &[f64; N]) -> [f64; N] {
        array::from_fn(|i| y[i] * self.scales[i])
    }

    fn rates(&self, y: &[f64; N]) -> [f64; N] {
        let slopes = (self.rates)(self.unscaled(y).map(Dual::from));
        array::from_fn(|i| slopes[i].value / self.scales[i])
    }

    /// The Jacobian, by rows.
    fn jacobian(&self, y: &[f64; N]) -> [[f64; N]; N] {
        let mut jacobian = [[0.0; N]; N];
        for column in 0..N {
            let mut unknowns = self.unscaled(y).map(Dual::from);
            unknowns[column].derivative = 1.0;
            for (row, slope) in (self.rates)(unknowns).into_iter().enumerate() {
                jacobian[row][column] = slope.derivative / self.scales[row] * self.scales[column];
            }
        }
        jacobian
    }

    /// Takes a few more Newton steps and returns the unknowns with the smallest residual, because rounding dominates at
    /// this precision.
    fn polish(&self, mut y: [f64; N]) -> Result<[f64; N], NoSteadyState> {
        let mut best = (f64::INFINITY, y);
        for _ in 0..POLISHING_ITERATIONS {
            let slopes = self.rates(&y);
            let residual = magnitude(&slopes);
            if residual < best.0 {
                best = (residual, y);
            }
            let change = Factors::of(&self.jacobian(&y), 0.0).and_then(|factors| factors.solve(slopes));
            let change = change.ok_or(NoSteadyState::NotIsolated)?;
            y = array::from_fn(|i| y[i] + change[i]);
        }
        Ok(best.1)
    }
}

/// A factored matrix.
struct Factors<const N: usize> {
    matrix: [[f64; N]; N],
    pivots: [usize; N],
}

impl<const N: usize> Factors<N> {
    /// Those of 1/Δt − J, with `damping` = 1/Δt, unless it is singular.
    fn of(jacobian: &[[f64; N]; N], damping: f64) -> Option<Self> {
        let mut matrix = jacobian.map(|row| row.map(|element| -element));
        for (diagonal, row) in matrix.iter_mut().enumerate() {
            row[diagonal] += damping;
        }
        let mut pivots = [0; N];
        dense::factor(matrix.as_flattened_mut(), &mut pivots).then_some(Self { matrix, pivots })
    }

    /// The solution for a right-hand side, if it is finite.
    fn solve(&self, mut vector: [f64; N]) -> Option<[f64; N]> {
        dense::solve(self.matrix.as_flattened(), &self.pivots, &mut vector);
        vector.iter().all(|x| x.is_finite()).then_some(vector)
    }
}

/// The fraction of a change that keeps within [`LARGEST_CHANGE`] and at most halves any unknown.
fn admissible_share<const N: usize>(y: &[f64; N], change: &[f64; N]) -> f64 {
    let towards_zero =
        (0..N).filter(|&i| change[i] < 0.0).map(|i| 0.5 * y[i].max(0.0) / -change[i]).fold(1.0, f64::min);
    towards_zero.min(LARGEST_CHANGE / magnitude(change)).min(1.0)
}

/// The largest absolute value.
fn magnitude<const N: usize>(vector: &[f64; N]) -> f64 {
    vector.iter().fold(0.0, |largest, x| x.abs().max(largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steady_state_that_the_transient_reaches_is_found() {
        // x' = −(x − 1)(x − 3)(x − 5): 1 and 5 attract, 3 repels.
        let rates = |[x]: [Dual; 1]| [-(x - 1.0) * (x - 3.0) * (x - 5.0)];
        let found = find(rates, [2.9], &[1.0]).unwrap();
        assert!((found[0] - 1.0).abs() < 1e-14, "{found:?}");
        let found = find(rates, [3.1], &[1.0]).unwrap();
        assert!((found[0] - 5.0).abs() < 1e-14, "{found:?}");
    }

    #[test]
    fn it_follows_what_the_rates_depend_on() {
        // x' = p − x², y' = x − q·y: at rest x = √p, y = √p/q.
        fn rates<T: Number>([p, q]: [T; 2], [x, y]: [T; 2]) -> [T; 2] {
            [p - x * x, x - q * y]
        }
        let (parameters, scales) = ([4.0, 0.5], [1.0, 10.0]);
        let still = |unknowns| rates(parameters.map(Dual::from), unknowns);
        let found = find(still, [1.0, 1.0], &scales).unwrap();
        let constant = follow(found, &scales, |unknowns| rates(parameters, unknowns), still);
        assert_eq!(constant.map(f64::to_bits), found.map(f64::to_bits));
        let along = |derivatives: [f64; 2]| {
            let parameters = array::from_fn(|i| Dual::new(parameters[i], derivatives[i]));
            follow(found, &scales, |unknowns| rates(parameters, unknowns), still).map(|x| x.derivative)
        };
        // 1/(2√p), 1/(2·√p·q) and −√p/q², by a handful of operations on numbers of order 1.
        for (found, expected) in [(along([1.0, 0.0]), [0.25, 0.5]), (along([0.0, 1.0]), [0.0, -8.0])] {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-14, "{found} instead of {expected}");
            }
        }
    }

    #[test]
    fn a_line_of_steady_states_is_not_isolated() {
        let found = find(|[x, _]: [Dual; 2]| [-x + 1.0, 0.0.into()], [0.5, 0.5], &[1.0, 1.0]);
        assert_eq!(found, Err(NoSteadyState::NotIsolated));
    }

    #[test]
    fn endless_growth_is_an_error() {
        assert_eq!(find(|_| [1.0.into()], [1.0], &[1.0]), Err(NoSteadyState::NotConverged));
        assert_eq!(find(|[x]: [Dual; 1]| [x + 1.0], [1.0], &[1.0]), Err(NoSteadyState::NotConverged));
    }
}
