//! The steady state of a system dx/dt = f(x) of a few unknowns, by pseudo-transient continuation.
//!
//! Each iteration is one linearized implicit Euler step, (1/Δt − J)·Δx = f(x). While Δt is short this follows the
//! transient from the guess, and so finds the steady state that the system would reach; as the changes become small,
//! Δt grows and the iteration becomes Newton's, which converges to the precision of the arithmetic (Kelley and Keyes,
//! Convergence analysis of pseudo-transient continuation, SIAM J. Numer. Anal. 35(2), 1998).

use super::linear;

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

/// Finds the steady state of positive unknowns.
///
/// `derivatives` is f, `derivatives_along` its derivative with respect to the unknown at a position; `scales` is the
/// magnitude of each unknown.
pub fn find<const N: usize>(
    derivatives: impl Fn(&[f64; N]) -> [f64; N],
    derivatives_along: impl Fn(&[f64; N], usize) -> [f64; N],
    guess: [f64; N],
    scales: &[f64; N],
) -> Result<[f64; N], NoSteadyState> {
    let scaled = |y: &[f64; N]| -> [f64; N] {
        let slopes = derivatives(&std::array::from_fn(|i| y[i] * scales[i]));
        std::array::from_fn(|i| slopes[i] / scales[i])
    };
    // The matrix 1/Δt − J, with `damping` = 1/Δt.
    let damped = |y: &[f64; N], damping: f64| -> [[f64; N]; N] {
        let x = std::array::from_fn(|i| y[i] * scales[i]);
        let mut matrix = [[0.0; N]; N];
        for column in 0..N {
            let along = derivatives_along(&x, column);
            for row in 0..N {
                matrix[row][column] = -along[row] / scales[row] * scales[column];
            }
            matrix[column][column] += damping;
        }
        matrix
    };
    let mut y: [f64; N] = std::array::from_fn(|i| guess[i] / scales[i]);
    let mut slopes = scaled(&y);
    let mut step = FIRST_STEP;
    for _ in 0..MOST_ITERATIONS {
        let newton = step >= NEWTON_STEP;
        let damping = if newton { 0.0 } else { 1.0 / step };
        let change = match linear::solve(damped(&y, damping), slopes) {
            Some(change) => change,
            None if newton => return Err(NoSteadyState::NotIsolated),
            None => return Err(NoSteadyState::NotConverged),
        };
        let settled = magnitude(&change) < CONVERGED;
        if newton && settled {
            let polished = polish(&scaled, &damped, y)?;
            return Ok(std::array::from_fn(|i| polished[i] * scales[i]));
        }
        let share = admissible_share(&y, &change);
        let next: [f64; N] = std::array::from_fn(|i| y[i] + share * change[i]);
        let next_slopes = scaled(&next);
        // The remaining fraction of the implicit Euler step's residual.
        let left: [f64; N] = std::array::from_fn(|i| next_slopes[i] - damping * share * change[i]);
        let contraction = magnitude(&left) / magnitude(&slopes);
        if settled || share >= 1.0 && contraction < LARGEST_CONTRACTION {
            (y, slopes) = (next, next_slopes);
            // At convergence, `contraction` is a quotient of rounding errors.
            let growth = if settled { 10.0 } else { (0.3 / contraction).clamp(0.5, 10.0) };
            step = (step * growth).min(NEWTON_STEP);
        } else {
            step *= 0.2;
        }
    }
    Err(NoSteadyState::NotConverged)
}

/// Takes a few more Newton steps and returns the unknowns with the smallest residual, since rounding dominates at this
/// precision.
fn polish<const N: usize>(
    scaled: &impl Fn(&[f64; N]) -> [f64; N],
    damped: &impl Fn(&[f64; N], f64) -> [[f64; N]; N],
    mut y: [f64; N],
) -> Result<[f64; N], NoSteadyState> {
    let mut best = (f64::INFINITY, y);
    for _ in 0..POLISHING_ITERATIONS {
        let slopes = scaled(&y);
        let residual = magnitude(&slopes);
        if residual < best.0 {
            best = (residual, y);
        }
        let change = linear::solve(damped(&y, 0.0), slopes).ok_or(NoSteadyState::NotIsolated)?;
        y = std::array::from_fn(|i| y[i] + change[i]);
    }
    Ok(best.1)
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
        // x' = (x − 1)(3 − x)(x − 5)·x: 1 and 5 repel or attract by turns; from 2.9 the flow goes to 1.
        let slope = |x: f64| -(x - 1.0) * (x - 3.0) * (x - 5.0);
        // The product rule, factor by factor.
        let along = |x: &[f64; 1], _| {
            let (a, b, c) = (x[0] - 1.0, x[0] - 3.0, x[0] - 5.0);
            [-(b * c + a * c + a * b)]
        };
        let found = find(|x| [slope(x[0])], along, [2.9], &[1.0]).unwrap();
        assert!((found[0] - 1.0).abs() < 1e-14, "{found:?}");
        let found = find(|x| [slope(x[0])], along, [3.1], &[1.0]).unwrap();
        assert!((found[0] - 5.0).abs() < 1e-14, "{found:?}");
    }

    #[test]
    fn a_line_of_steady_states_is_not_isolated() {
        let found = find(
            |x| [1.0 - x[0], 0.0],
            |_, column| [if column == 0 { -1.0 } else { 0.0 }, 0.0],
            [0.5, 0.5],
            &[1.0, 1.0],
        );
        assert_eq!(found, Err(NoSteadyState::NotIsolated));
    }

    #[test]
    fn endless_growth_is_an_error() {
        assert_eq!(find(|_| [1.0], |_, _| [0.0], [1.0], &[1.0]), Err(NoSteadyState::NotConverged));
        assert_eq!(find(|x| [1.0 + x[0]], |_, _| [1.0], [1.0], &[1.0]), Err(NoSteadyState::NotConverged));
    }
}
