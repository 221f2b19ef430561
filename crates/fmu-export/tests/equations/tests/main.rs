//! The integrator, on models of equations.

mod arrays;
mod event_mode;
mod intermediate_update;
mod samples;
mod solutions;
mod vessels;
mod wrong_models;
