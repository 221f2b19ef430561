//! The integrator, on models of equations.

mod allocations;
mod arrays;
mod calculated_parameters;
mod event_mode;
mod intermediate_update;
mod look_ahead;
mod rod;
mod samples;
mod solutions;
mod termination;
mod two_parts;
mod two_rates;
mod vessels;
mod wrong_models;
