//! Records of simulations: variables over time.
//!
//! A [`Record`] is read from and written to CSV and, with the feature `parquet`, Parquet files, whose numbers read back bit
//! for bit. A [`Table`] has other types of cells, too. [`numbers`] writes numbers and their units for readers.

pub mod numbers;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
mod parquet;
mod record;
mod table;

pub use record::{Column, Record};
pub use table::{Cells, Header, Table, TableColumn, TableFormat, expect_seconds, name_and_unit};
