//! Replaces Parquet if the feature `parquet` is off.

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Result, bail};

use crate::cells::DataColumn;
use crate::table::Table;

const REASON: &str = "this program is compiled without Parquet; use a file that ends with .csv";

pub(crate) fn read(_path: &Path) -> Result<Vec<DataColumn>> {
    bail!(REASON)
}

pub(crate) fn write(_table: &Table<'_>, _writer: impl Write + Send) -> io::Result<()> {
    Err(io::Error::other(REASON))
}
