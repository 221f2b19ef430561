//! CSV: numbers as texts that read back as the same doubles, units in brackets of the header.

use std::io::{self, Write};

use anyhow::{Context, Result};

use crate::table::{Column, Header, Table};

/// The name and the unit in a column's header, `name (unit)`; the unit is empty where there is none.
#[must_use]
pub fn name_and_unit(header: &str) -> (&str, &str) {
    header.strip_suffix(')').and_then(|header| header.rsplit_once(" (")).unwrap_or((header, ""))
}

/// The columns of a file's text.
pub(crate) fn read(text: &str) -> Result<Vec<Column>> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let named = |header: &str| {
        let (name, unit) = name_and_unit(header);
        Column::from((name.to_owned(), unit.to_owned()))
    };
    let mut columns: Vec<_> = reader.headers()?.iter().map(named).collect();
    for row in reader.records() {
        let row = row?;
        for (column, text) in columns.iter_mut().zip(&row) {
            let line = row.position().map_or(0, csv::Position::line);
            let value = text.parse().with_context(|| {
                format!("line {line}, {}: expected a number, found \"{text}\"", column.name)
            })?;
            column.values.push(value);
        }
    }
    Ok(columns)
}

pub(crate) fn write(table: &Table<'_>, header: Header, writer: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    csv.write_record(table.0.iter().map(|column| column.header(header)))?;
    for row in 0..table.0.first().map_or(0, |column| column.cells.len()) {
        csv.write_record(table.0.iter().map(|column| column.cells.text(row)))?;
    }
    csv.flush()
}
