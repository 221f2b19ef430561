//! The solver of the plant's steady state, generic over the number of unknowns and independent of the plant.

pub mod linear;
pub(crate) mod steady_state;
