//! Draws records of simulations.
//!
//! A [`Figure`] has rows of [`Panel`]s with [`Line`]s. It becomes an SVG or a PNG, and with the feature `html` an interactive
//! plot in a [`page`]. [`panels`] chooses what a plot of a record shows together.

mod figure;
mod format;
mod page;
pub mod panels;

pub use figure::{Color, Figure, Line, Panel, color, escaped};
pub use format::PlotFormat;
pub use page::page;
