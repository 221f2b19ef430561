//! What a model is written against: the arguments that it receives, its typed variables, which are generated from its JSON,
//! and of a sampled model the trait. It knows nothing of value references, C or the order of importers' calls.

pub mod clock;
pub mod context;
pub mod description;
#[cfg(not(target_os = "none"))]
mod files;
pub mod inputs;
#[cfg(not(target_os = "none"))]
pub(crate) mod resources;
pub mod sampled;
pub mod typed;
pub mod variables;
