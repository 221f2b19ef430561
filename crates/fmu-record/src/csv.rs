//! CSV: numbers as texts that read back as the same doubles, units in a row below the header.
//!
//! The row of units begins with `#`, a comment to many readers: `numpy.genfromtxt` skips it, as does pandas with
//! `comment="#"`; FMPy does not.

use std::io::{self, Write};

use anyhow::{Context, Result};
use csv::{ReaderBuilder, StringRecord, Trim};

use crate::table::{Column, Table};

/// What begins a comment.
const COMMENT: char = '#';

fn reader(text: &str) -> csv::Reader<&[u8]> {
    ReaderBuilder::new().trim(Trim::All).comment(Some(COMMENT as u8)).from_reader(text.as_bytes())
}

/// The names and units in the header of a file; a missing unit is empty. Units are in a commented row below the names,
/// or beside them: `name (unit)` or `name [unit]`.
///
/// # Errors
/// When the header is not UTF-8.
pub fn headings(text: &str) -> Result<Vec<(String, String)>> {
    let header = reader(text).headers()?.clone();
    let units = units(text).filter(|units| units.len() == header.len());
    let heading = |(index, name): (usize, &str)| {
        let (name, unit) = match &units {
            Some(units) => (name, &units[index]),
            None => with_unit(name),
        };
        (name.to_owned(), unit.to_owned())
    };
    Ok(header.iter().enumerate().map(heading).collect())
}

/// The comment directly below the header, as a row.
fn units(text: &str) -> Option<StringRecord> {
    let is_before_header = |line: &&str| line.starts_with(COMMENT) || line.trim().is_empty();
    let row = text.lines().skip_while(is_before_header).nth(1)?.strip_prefix(COMMENT)?;
    let mut reader = ReaderBuilder::new().trim(Trim::All).has_headers(false).from_reader(row.as_bytes());
    reader.records().next()?.ok()
}

/// The name and the unit in a cell of the header. Numbers in square brackets are the indices of an element.
fn with_unit(cell: &str) -> (&str, &str) {
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((name, unit)) = cell.strip_suffix(close).and_then(|cell| cell.rsplit_once(open)) {
            let is_index =
                open == '[' && unit.chars().all(|character| character.is_ascii_digit() || character == ',');
            if !name.trim().is_empty() && !is_index {
                return (name.trim(), unit.trim());
            }
        }
    }
    (cell, "")
}

/// The columns of a file's text.
pub(crate) fn read(text: &str) -> Result<Vec<Column>> {
    let mut columns: Vec<_> = headings(text)?.into_iter().map(Column::from).collect();
    for row in reader(text).records() {
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

pub(crate) fn write(table: &Table<'_>, writer: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    csv.write_record(table.0.iter().map(|column| &column.name))?;
    if table.0.iter().any(|column| !column.unit.is_empty()) {
        let units = table.0.iter().enumerate().map(|(index, column)| match index {
            0 => format!("{COMMENT} {}", column.unit).trim_end().to_owned(),
            _ => column.unit.clone(),
        });
        csv.write_record(units)?;
    }
    for row in 0..table.0.first().map_or(0, |column| column.cells.len()) {
        csv.write_record(table.0.iter().map(|column| column.cells.text(row)))?;
    }
    csv.flush()
}
