//! The boost pressure controller, called as a model: its law against independent transcriptions and
//! hand calculations, its clock, its initialization and its errors.

#![allow(clippy::float_cmp, reason = "where equality is asserted, the law is exact")]

mod bench;
mod by_speed;
mod extremes;
mod initialization;
mod law;
#[path = "../support/random.rs"]
mod random;
mod refusals;
mod sampling;
mod split_range;
mod stages;
mod task;
mod transcription;
