//! The plant, called as a model: its equations against an independent implementation, its start, its integration, its
//! errors, and its declared dependencies.

mod bench;
mod dependencies;
mod derivatives;
mod friction;
mod golden;
mod integration;
mod latch;
mod physical_bounds;
#[path = "../support/random.rs"]
mod random;
mod random_experiment;
mod refusals;
mod start;
mod steady_states;
mod trace;
