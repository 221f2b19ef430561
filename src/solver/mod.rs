//! Numerical methods, generic over the number of unknowns and free of allocation: the integrators of the
//! plant's communication steps and the solver of its steady state. They are independent of the plant.
//!
//! `rosenbrock` computes single steps; `step_size` controls their length; `course` integrates over an interval,
//! `multirate` for a system in two parts.

pub(crate) mod course;
mod cubic;
pub mod linear;
pub(crate) mod multirate;
pub(crate) mod rosenbrock;
pub(crate) mod steady_state;
mod step_size;

/// The result of an integrator's step.
#[derive(Clone, Copy, Debug)]
pub struct Trial<const N: usize> {
    /// The states at the step's end.
    pub states: [f64; N],
    /// The derivatives at its end, for the next step.
    pub slopes: [f64; N],
    /// The estimated error of the states.
    pub error: [f64; N],
}
