//! CSV: numbers as texts that read back as the same doubles, units in a row below the header.
//!
//! The row of units begins with `#`, a comment to many readers: `numpy.genfromtxt` skips it, as does pandas with
//! `comment="#"`; FMPy does not. Files of others may have semicolons and decimal commas, as spreadsheets write them in
//! many languages.

use std::io::{self, Write};

use anyhow::Result;
use csv::{ReaderBuilder, StringRecord, Trim};

use crate::cells::DataColumn;
use crate::table::{Column, Table};

/// What begins a comment.
const COMMENT: char = '#';

/// What separates the cells of a file: the first comma or semicolon of its header. Beside semicolons, a comma is a decimal
/// point.
fn separator(text: &str) -> char {
    let header = text.lines().find(|line| !is_skipped(line)).unwrap_or_default();
    let mut is_quoted = false;
    let mut characters = header.chars();
    let found = characters.find(|character| {
        is_quoted ^= *character == '"';
        !is_quoted && [',', ';'].contains(character)
    });
    found.unwrap_or(',')
}

fn builder(separator: char) -> ReaderBuilder {
    let mut builder = ReaderBuilder::new();
    builder.trim(Trim::All).delimiter(separator as u8);
    builder
}

fn reader(text: &str) -> csv::Reader<&[u8]> {
    builder(separator(text)).comment(Some(COMMENT as u8)).from_reader(text.as_bytes())
}

/// The names and units in the header of a file; a missing unit is empty. Units are in a commented row below the names,
/// or beside them: `name (unit)` or `name [unit]`.
pub(crate) fn headings(text: &str) -> Result<Vec<(String, String)>> {
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

/// Whether a line is a comment or empty.
fn is_skipped(line: &&str) -> bool {
    line.starts_with(COMMENT) || line.trim().is_empty()
}

/// The comment directly below the header, as a row.
fn units(text: &str) -> Option<StringRecord> {
    let row = text.lines().skip_while(is_skipped).nth(1)?.strip_prefix(COMMENT)?;
    let mut reader = builder(separator(text)).has_headers(false).from_reader(row.as_bytes());
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

/// The columns of a file's text, and the line of each row.
pub(crate) fn read(text: &str) -> Result<(Vec<DataColumn>, Vec<u64>)> {
    let text = text.trim_start_matches('\u{feff}');
    let columns = headings(text)?.into_iter().map(|heading| DataColumn::from(Column::from(heading)));
    let (mut columns, mut lines): (Vec<_>, _) = (columns.collect(), vec![]);
    let has_decimal_commas = separator(text) == ';';
    for row in reader(text).records() {
        let row = row?;
        lines.push(row.position().map_or(0, |position| line(text, position)));
        for (column, text) in columns.iter_mut().zip(&row) {
            let point = text.replace(',', ".");
            let is_number = has_decimal_commas && point.parse::<f64>().is_ok();
            column.push(if is_number { &point } else { text });
        }
    }
    Ok((columns, lines))
}

/// The line of a row, whose position is that of the comments before it.
fn line(text: &str, position: &csv::Position) -> u64 {
    let rest = usize::try_from(position.byte()).ok().and_then(|start| text.get(start..));
    position.line() + rest.unwrap_or_default().lines().take_while(is_skipped).count() as u64
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
