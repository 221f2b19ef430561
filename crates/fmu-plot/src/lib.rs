//! Draws simulation records and other curves as SVG, PNG and interactive HTML.
//!
//! [`panels::draw`] draws a record: variables with the same unit share a panel if each fills at least a third of its
//! scale.
//!
//! ```
//! use fmu_plot::panels;
//! use fmu_record::Record;
//!
//! # fn main() -> anyhow::Result<()> {
//! let mut record = Record::new([("h", "m"), ("v", "m/s")]);
//! for step in 0..=40 {
//!     let time = 0.01 * f64::from(step);
//!     record.push(time, &[1.0 - 4.905 * time * time, -9.81 * time]);
//! }
//! let svg = panels::draw(&record, "A falling ball", None).svg()?;
//! assert!(svg.starts_with("<svg"));
//! # Ok(())
//! # }
//! ```
//!
//! Build any other [`Figure`] from rows of [`Panel`]s with [`Line`]s:
//!
//! ```
//! use fmu_plot::{Figure, Line, Panel, color};
//!
//! # fn main() -> anyhow::Result<()> {
//! let time = [0.0, 1.0, 2.0];
//! let reference = Line::new(&time, [1.0, 2.0, 2.0]).held().color(color::INK).label("reference");
//! let level = Line::new(&time, [1.0, 1.4, 1.9]).label("level");
//! let panel = Panel::new("time (s)", "level (m)").line(reference).line(level);
//! let figure = Figure::new().title("A tank").row([panel]);
//! let png: Vec<u8> = figure.png()?;
//! # assert!(png.starts_with(b"\x89PNG"));
//! # Ok(())
//! # }
//! ```
//!
//! With the feature `html`, a [`Report`] is a self-contained page whose plots zoom and switch lines on and off;
//! [`Figure::html`] draws a figure for your own HTML in such a page.

mod figure;
pub mod panels;
#[cfg(feature = "html")]
mod report;

pub use figure::{Color, Figure, Line, Panel, color, escaped, labelled};
#[cfg(feature = "html")]
pub use report::{Cell, Report, Table};
