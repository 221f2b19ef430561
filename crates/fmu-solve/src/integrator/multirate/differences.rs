//! Difference quotients of a part's derivatives, in place of exact ones.

use core::array;

/// The difference of a state, in allowed errors: so little that the Jacobian is that of all solutions within the tolerance.
/// At a tolerance of 1e-6 it is nearly √ε of the state, where rounding and curvature of a forward difference are alike. At
/// others one of them is larger, but the method keeps its order with any matrix. [Chosen](crate::chosen).
const OF_STATE: f64 = 1e-2;
/// The difference in time, relative to the step: the drift then errs by a thousandth of what it changes by over the step, and
/// by a thousand roundings of the derivatives. [Chosen](crate::chosen).
const OF_TIME: f64 = 1e-3;

/// States of which one is moved by a difference, given the reciprocals of their allowed errors, and the difference.
#[inline]
pub(super) fn moved<const N: usize>(states: &[f64; N], weights: &[f64; N], state: usize) -> ([f64; N], f64) {
    let mut moved = *states;
    moved[state] += chosen!(OF_STATE) / weights[state];
    (moved, moved[state] - states[state])
}

/// A time later by a difference, in a step from a time on, and the difference.
#[inline]
pub(super) fn later(time: f64, length: f64) -> (f64, f64) {
    let difference = chosen!(OF_TIME) * length;
    (time + difference, difference)
}

/// How derivatives change with what was moved by a difference.
#[inline]
pub(super) fn quotient<const N: usize>(there: &[f64; N], here: &[f64; N], difference: f64) -> [f64; N] {
    array::from_fn(|i| (there[i] - here[i]) / difference)
}
