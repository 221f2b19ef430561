//! The kinds of models: the trait that a user implements, and what the runtime makes of it.

pub(crate) mod audit;
pub mod equations;
pub mod integrated;
pub mod sampled;
pub mod stepper;
