//! What the integrator steps: a system of equations, as a whole or in two parts, and the error that it may make.

use core::ops::Range;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;

use super::method::{Method, RODAS5P};
use super::pattern::Pattern;
use crate::Error;
use crate::display::Seconds;

/// Directions along which products of the Jacobian are computed.
pub trait Directions {
    /// The number of directions.
    fn count(&self) -> usize;
    /// The component of a direction along a state. Where the pattern is full, each direction is that of the state at its
    /// position.
    fn component(&self, direction: usize, state: usize) -> f64;
    /// The pattern of the Jacobian whose elements the products give; none if it is full. No two columns of a row share a
    /// direction, except in rows that [`System::gradients`] computes. The last direction checks the pattern: along it, a
    /// product that the elements do not give shows that some are missing, and one that is not a number shows nothing.
    fn pattern(&self) -> Option<&Pattern> {
        None
    }
}

/// A system dx/dt = f(t, x).
pub trait System {
    /// The integration method.
    const METHOD: &'static Method = &RODAS5P;
    /// Whether the tolerance is relative to nominal values alone.
    const TOLERANCE_IS_ABSOLUTE: bool = false;
    /// The longest step in s.
    const LONGEST_STEP: f64 = f64::INFINITY;
    /// Whether the system may have more than [`Method::most_dense`] states with a pattern: otherwise code for it is
    /// left out.
    const MAY_BE_SPARSE: bool = false;

    /// The zero from which times count.
    fn zero(&self) -> f64 {
        0.0
    }
    /// Counts times from another zero.
    fn count_from(&mut self, zero: f64) {
        let _ = zero;
    }
    /// Computes the derivatives of the states.
    fn derivatives(&mut self, time: f64, states: &[f64], derivatives: &mut [f64]);
    /// Differentiates the states' derivatives along directions of the states, by rows, and with respect to time.
    fn linearize(
        &mut self,
        time: f64,
        states: &[f64],
        directions: &impl Directions,
        products: &mut [f64],
        by_time: &mut [f64],
    );
    /// Computes rows of the Jacobian, each as a function of the column, for a system that gives a pattern.
    fn gradients(
        &mut self,
        time: f64,
        states: &[f64],
        rows: &[usize],
        take: impl FnMut(usize, &dyn Fn(usize) -> f64),
    ) {
        let _ = (time, states, rows, take);
    }
    /// Where the Jacobian has elements at this time and these states; full if unknown.
    fn pattern(&mut self, time: f64, states: &[f64]) -> Pattern {
        let _ = (time, states);
        Pattern::full()
    }
    /// Runs a trial where the system need not be valid. There, a panic only ends the trial.
    fn attempt<T>(trial: impl FnOnce() -> T) -> Option<T> {
        catch_unwind(AssertUnwindSafe(trial)).ok()
    }
}

/// Even the shortest step misses the tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepFailure {
    /// The time reached.
    pub time: f64,
    /// The position of the state whose error is largest relative to its tolerance, or NaN.
    pub state: usize,
}

impl StepFailure {
    /// The failure in words, at a time (s): the state's name, and the relative tolerance.
    #[must_use]
    #[cold]
    pub fn error(self, time: f64, state: &str, tolerance: f64) -> Error {
        Error::new(format!(
            "the states cannot be integrated beyond {} s: the error of {state} stays above the tolerance {tolerance:?}, \
             or its derivative is not finite",
            Seconds(time)
        ))
    }
}

/// A part of a model's states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The first states, which do not depend on the others.
    Fast,
    /// The states after the fast ones.
    Slow,
}

/// A system whose parts can be evaluated one by one.
pub trait TwoParts: System {
    /// Computes the derivatives of a part's states from all states. Those of the other part are arbitrary.
    fn part_derivatives(
        &mut self,
        part: Part,
        time: f64,
        states: impl Fn(usize) -> f64,
        derivatives: impl FnMut(usize, f64),
    );
    /// The derivatives at the time and states of the last complete evaluation.
    fn present_derivatives(&self, derivatives: impl FnMut(usize, f64));
    /// Whether derivatives of the slow part depend on a fast state.
    fn drives(state: usize, slow: Range<usize>) -> bool;
    /// Whether the fast part depends on the slow one, so that both must take the same steps.
    fn is_coupled(&self) -> bool;
    /// Whether the derivatives depend on the states alone.
    fn is_autonomous(&self) -> bool;
    /// The range of a state.
    fn range(state: usize) -> [f64; 2];
}

/// The allowed error of a step.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance<'a> {
    /// The allowed error relative to the sum of a state and its nominal value.
    pub relative: f64,
    /// The nominal value of each state.
    pub nominals: &'a [f64],
}

impl Tolerance<'_> {
    #[inline]
    pub(super) fn scale<S: System>(&self, state: usize, value: f64) -> f64 {
        let magnitude = if S::TOLERANCE_IS_ABSOLUTE { 0.0 } else { value.abs() };
        self.relative * (magnitude + self.nominals[state])
    }
}
