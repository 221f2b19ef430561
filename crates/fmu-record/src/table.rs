//! Tables of columns with names and units, as CSV, and as Parquet, which keeps types, missing values and units.
//!
//! Parquet rather than Arrow's own file: pandas, Polars, Spark and MATLAB all read it, and of the crates
//! that write either, `parquet` without its Arrow layer is the smallest (29 crates in its tree; `arrow-ipc` with
//! `arrow-array` has 41).

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use anyhow::{Result, bail};

use crate::parquet;

/// What a table is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated text.
    Csv,
    /// Apache Parquet, which keeps types, missing values and units. It needs the feature `parquet`.
    Parquet,
}

/// How a CSV file's header names a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Header {
    /// By its name alone.
    Names,
    /// As `name (unit)`, where there is a unit.
    NamesAndUnits,
}

/// The name and the unit in a column's header, `name (unit)`; the unit is empty where there is none.
#[must_use]
pub fn name_and_unit(header: &str) -> (&str, &str) {
    header.strip_suffix(')').and_then(|header| header.rsplit_once(" (")).unwrap_or((header, ""))
}

/// Refuses the unit of a time that is not in s.
///
/// # Errors
/// When the unit is neither `s` nor empty.
pub fn expect_seconds(unit: &str) -> Result<()> {
    match unit {
        "" | "s" => Ok(()),
        other => bail!("its time is in {other}, not in s"),
    }
}

/// Columns with equal numbers of rows.
pub struct Table<'a>(pub Vec<TableColumn<'a>>);

/// A column of a [`Table`].
pub struct TableColumn<'a> {
    /// In the header.
    pub name: String,
    /// The unit of the cells; empty where there is none.
    pub unit: String,
    /// One for each row.
    pub cells: Cells<'a>,
}

/// The cells of a column, all of one type; those that are `None` are missing.
pub enum Cells<'a> {
    /// Numbers, none of which is missing.
    Numbers(&'a [f64]),
    /// Numbers.
    Number(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i32>>),
    /// Truth values.
    Truth(Vec<Option<bool>>),
    /// Texts.
    Text(Vec<Option<String>>),
}

impl TableFormat {
    /// By the ending of a file's name, `.csv` or `.parquet` in any case. What is not a file, such as a pipe, gets CSV.
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

impl TableColumn<'_> {
    fn header(&self, header: Header) -> String {
        match header {
            Header::NamesAndUnits if !self.unit.is_empty() => format!("{} ({})", self.name, self.unit),
            _ => self.name.clone(),
        }
    }
}

impl Table<'_> {
    /// Writes the table. Numbers read back as the same doubles; missing values are empty in CSV and null in Parquet.
    /// `header` is for CSV: Parquet has the units in its metadata, a JSON object under the key `units`.
    ///
    /// # Errors
    /// When the columns have different numbers of rows, the feature that the format needs is off, or `writer` fails.
    pub fn write(&self, format: TableFormat, header: Header, writer: impl Write + Send) -> io::Result<()> {
        if !self.0.windows(2).all(|pair| pair[0].cells.len() == pair[1].cells.len()) {
            let message = "the columns have different numbers of rows";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        match format {
            TableFormat::Csv => self.write_csv(header, writer),
            TableFormat::Parquet => parquet::write(self, writer),
        }
    }

    fn write_csv(&self, header: Header, writer: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record(self.0.iter().map(|column| column.header(header)))?;
        for row in 0..self.0.first().map_or(0, |column| column.cells.len()) {
            csv.write_record(self.0.iter().map(|column| column.cells.text(row)))?;
        }
        csv.flush()
    }
}

impl Cells<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Truth(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    fn text(&self, row: usize) -> String {
        match self {
            Self::Numbers(cells) => Some(format!("{:?}", cells[row])),
            Self::Number(cells) => cells[row].map(|value| format!("{value:?}")),
            Self::Whole(cells) => cells[row].map(|value| value.to_string()),
            Self::Truth(cells) => cells[row].map(|value| value.to_string()),
            Self::Text(cells) => cells[row].clone(),
        }
        .unwrap_or_default()
    }
}
