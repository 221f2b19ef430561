//! Benchmarks of the models and their FMUs.
//!
//! [`benchmarks::all`] lists them, each for several implementations: the exported library through the C
//! functions of FMI 2.0 ([`library`]), the model called directly ([`direct`]), and for the plant the
//! straightforward right-hand side under a plain Runge-Kutta method ([`mod@reference`]). `src/time.rs` measures
//! times, `src/count.rs` instruction counts, with valgrind. `bash benches/run` does both and
//! prints the table.

pub mod benchmarks;
#[path = "../../tests/boost_steps/mod.rs"]
mod boost_steps;
pub mod closed_loop;
pub mod direct;
pub mod experiment;
pub mod library;
pub mod plant;
pub mod reference;

#[path = "../../tests/plant/bench.rs"]
#[allow(dead_code, missing_docs, clippy::pedantic, reason = "the plant's tests use the rest")]
mod bench;
#[cfg(test)]
#[path = "../../tests/support/random.rs"]
mod random;
#[path = "../../tests/plant/random_experiment.rs"]
#[allow(missing_docs, clippy::pedantic, reason = "written for the plant's tests")]
mod random_experiment;
