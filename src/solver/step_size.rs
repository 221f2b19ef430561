//! Step size control of an integrator.
//!
//! A step is accepted when no state's estimated error exceeds its tolerance. Estimates fall with the third power of
//! the step, so that the third root of the error gives the length that would meet the tolerance; after an accepted
//! step the fourth root is used, which damps the changes.

use crate::elementary::{larger, power, smaller};

/// The safety factor below the length that would just meet the tolerance.
const SAFETY: f64 = 0.9;
/// The largest change of the length from one step to the next, in either direction.
const LARGEST_CHANGE: f64 = 5.0;
/// A step may exceed the proposal by this much, so that rounding of its end does not split it.
const ROUNDING: f64 = 1e-6;

/// The step size control.
#[derive(Clone, Copy, Debug)]
pub struct StepSize {
    /// The length of the next step.
    pub next: f64,
    /// The length of the longest step.
    longest: f64,
    /// Whether the last step was rejected.
    rejected: bool,
}

impl StepSize {
    /// Starts with one length, and never exceeds another.
    pub fn new(first: f64, longest: f64) -> Self {
        Self { next: first, longest, rejected: false }
    }

    /// The length of the next step for the remaining time `left`: the longest that reaches the end in equal steps,
    /// which can share an inverse matrix.
    pub fn within(&self, left: f64) -> f64 {
        left / (left / (self.next * (1.0 + ROUNDING))).ceil().max(1.0)
    }

    /// Returns whether to accept a step of a length with an error relative to the tolerance.
    ///
    /// A step that was shortened to reach the end allows less than was proposed before; then the proposal is kept.
    pub fn judge(&mut self, length: f64, error: f64) -> bool {
        if error <= 1.0 {
            let ratio = error.recip().sqrt().sqrt();
            let most = if self.rejected { 1.0 } else { LARGEST_CHANGE };
            let allowed = length * (SAFETY * ratio).clamp(LARGEST_CHANGE.recip(), most);
            let cut_short = length < self.next;
            let next = if cut_short && !self.rejected { larger(self.next, allowed) } else { allowed };
            self.next = smaller(next, self.longest);
            self.rejected = false;
            true
        } else {
            let ratio = if error.is_finite() { SAFETY * power(error, -1.0 / 3.0) } else { 0.0 };
            self.next = length * ratio.max(LARGEST_CHANGE.recip());
            self.rejected = true;
            false
        }
    }
}

/// The largest error of states relative to its tolerance, whose reciprocals are `weights`; infinite if an error or a
/// state is not finite.
pub fn relative_error<const N: usize>(states: &[f64; N], error: &[f64; N], weights: &[f64; N]) -> f64 {
    let mut largest = 0.0_f64;
    let mut sum = 0.0;
    for ((state, error), weight) in states.iter().zip(error).zip(weights) {
        let relative = (error * weight).abs();
        largest = larger(largest, relative);
        sum += relative + 0.0 * state;
    }
    // The maximum ignores NaN; the sum does not.
    if sum.is_finite() { largest } else { f64::INFINITY }
}

/// The position of the largest error relative to its tolerance, or of the first state or error that is not finite.
pub fn largest_error<const N: usize>(states: &[f64; N], error: &[f64; N], weights: &[f64; N]) -> usize {
    let relative = |i: usize| {
        let relative = (error[i] * weights[i]).abs() + 0.0 * states[i];
        if relative.is_nan() { f64::INFINITY } else { relative }
    };
    (0..N).rev().max_by(|&a, &b| relative(a).total_cmp(&relative(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_to_an_end_are_equal_and_not_longer_than_proposed() {
        let steps = StepSize::new(0.3, 1.0);
        assert!((steps.within(1.0) - 0.25).abs() < 1e-15);
        assert!((steps.within(0.3) - 0.3).abs() < f64::EPSILON && (steps.within(1e-9) - 1e-9).abs() < 1e-24);
        // The end carries rounding.
        assert!((steps.within(0.3 + 1e-9) - 0.3).abs() < 2e-9);
    }

    #[test]
    fn large_errors_are_rejected_and_small_ones_lengthen_the_step() {
        let mut steps = StepSize::new(0.1, 1.0);
        assert!(!steps.judge(0.1, 8.0));
        // The third root of 8 with the margin.
        assert!((steps.next - 0.045).abs() < 1e-12, "{}", steps.next);
        assert!(steps.judge(steps.next, 0.5) && steps.next < 0.0451, "not longer right after a rejection");
        assert!(steps.judge(steps.next, 0.01) && steps.next > 0.0451);
        assert!(!steps.judge(steps.next, f64::INFINITY) && steps.next > 0.0);
    }

    #[test]
    fn a_short_step_to_an_end_does_not_shorten_those_after_it() {
        let mut steps = StepSize::new(0.1, 1.0);
        assert!(steps.judge(1e-6, 1e-9));
        assert!((steps.next - 0.1).abs() < f64::EPSILON);
    }

    #[test]
    fn not_a_number_is_an_infinite_error() {
        let (one, nan) = ([1.0, 1.0], [1.0, f64::NAN]);
        assert!((relative_error(&one, &[1.0, -3.0], &[2.0, 1.0]) - 3.0).abs() < f64::EPSILON);
        assert_eq!(largest_error(&one, &[1.0, -3.0], &[2.0, 1.0]), 1);
        for (states, error) in [(&one, &nan), (&nan, &one), (&[1.0, f64::INFINITY], &one)] {
            assert!(relative_error(states, error, &one).is_infinite());
            assert_eq!(largest_error(states, error, &one), 1);
        }
    }
}
