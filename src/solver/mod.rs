//! Numerical methods, generic over the number of unknowns and free of allocation: the integrators of the
//! plant's communication steps and the solver of its steady state. They know nothing of engines.
//!
//! The integrators of `rosenbrock` are single steps; `step_size` judges a step's error and says how long the
//! next one should be; `course` goes through an interval in such steps, `multirate` does so for a system in two parts.

pub(crate) mod course;
mod cubic;
pub mod linear;
pub(crate) mod multirate;
pub(crate) mod rosenbrock;
pub(crate) mod steady_state;
mod step_size;

/// Where a step of an integrator leads.
#[derive(Clone, Copy, Debug)]
pub struct Trial<const N: usize> {
    /// The states at the step's end.
    pub states: [f64; N],
    /// Their derivatives there: where the step is taken, those at the begin of the next.
    pub slopes: [f64; N],
    /// What the method estimates to be the error of the states.
    pub error: [f64; N],
}
