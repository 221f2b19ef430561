//! Simulation records: variables over time, as CSV and Parquet.
//!
//! A [`Record`] has the time in s and a column for each variable: doubles with their unit, or texts. It is written to and
//! read from CSV files and, with the feature `parquet`, Parquet files; every double reads back bit for bit. A [`Table`]
//! also writes integers, Booleans and missing values. [`Data`] is measured data. [`numbers`] formats numbers and their
//! units for readers.
//!
//! ```
//! use std::fs::File;
//!
//! use fmu_record::{Record, TableFormat};
//!
//! # fn main() -> anyhow::Result<()> {
//! let mut record = Record::new([("h", "m"), ("v", "m/s")]);
//! record.push(0.0, &[1.0, 0.0]);
//! record.push(0.1, &[0.951, -0.981]);
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("ball.csv");
//! record.table().write(TableFormat::Csv, File::create(&path)?)?;
//!
//! let read = Record::read(&path)?;
//! assert_eq!(read.time(), [0.0, 0.1]);
//! assert_eq!(read.get("h")?, [1.0, 0.951]);
//! assert_eq!(read.columns()[1].unit, "m/s");
//! # Ok(())
//! # }
//! ```

mod cells;
mod csv;
mod data;
mod format;
pub mod numbers;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
mod parquet;
mod record;
mod table;

pub use cells::{Cell, DataColumn, as_number, as_truth};
pub use data::Data;
pub use format::TableFormat;
pub use record::Record;
pub use table::{Cells, Column, Table, TableColumn};
