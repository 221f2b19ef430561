//! The formats of tables: CSV, or Parquet, which keeps types, missing values and units.
//!
//! Parquet rather than Arrow's own file: pandas, Polars, Spark and MATLAB all read it, and of the crates
//! that write either, `parquet` without its Arrow layer is the smallest (29 crates in its tree; `arrow-ipc` with
//! `arrow-array` has 41).

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use anyhow::{Result, bail};

use crate::table::Table;
use crate::{csv, parquet};

/// What a table is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated text.
    Csv,
    /// Apache Parquet, which keeps types, missing values and units. It needs the feature `parquet`.
    Parquet,
}

impl TableFormat {
    /// The format by the ending of a file's name, `.csv` or `.parquet` in any case. Targets that are not files, such as
    /// pipes, get CSV.
    ///
    /// # Errors
    /// When the name ends otherwise.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            _ if path.exists() && !path.is_file() => Ok(Self::Csv),
            _ => bail!("{}: a record is a file that ends with .csv or .parquet", path.display()),
        }
    }
}

impl Table<'_> {
    /// Writes the table. Numbers read back as the same doubles; missing values are empty in CSV and null in Parquet. Units
    /// are in CSV a row below the header that begins with `#`, in Parquet a JSON object in the metadata, under `units`.
    ///
    /// # Errors
    /// When the columns have different numbers of rows, the feature that the format needs is off, or `writer` fails.
    pub fn write(&self, format: TableFormat, writer: impl Write + Send) -> io::Result<()> {
        if !self.0.windows(2).all(|pair| pair[0].cells.len() == pair[1].cells.len()) {
            let message = "the columns have different numbers of rows";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        match format {
            TableFormat::Csv => csv::write(self, writer),
            TableFormat::Parquet => parquet::write(self, writer),
        }
    }
}
