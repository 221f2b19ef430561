//! Numerical methods, generic over the number of unknowns and free of allocation: the integrator of the
//! plant's communication steps and the solver of its steady state. They know nothing of engines.

pub mod linear;
pub mod runge_kutta;
pub mod steady_state;
