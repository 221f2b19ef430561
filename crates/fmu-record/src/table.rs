//! Tables of columns with names and units.

use anyhow::{Result, bail};

/// How a CSV file's header names a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Header {
    /// By its name alone.
    Names,
    /// As `name (unit)`, where there is a unit.
    NamesAndUnits,
}

/// A recorded variable.
#[derive(Clone, Debug)]
pub struct Column {
    /// The name in the CSV header.
    pub name: String,
    /// The unit declared by the FMU; empty if there is none.
    pub unit: String,
    /// One for each time, in the unit.
    pub values: Vec<f64>,
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

impl TableColumn<'_> {
    pub(crate) fn header(&self, header: Header) -> String {
        match header {
            Header::NamesAndUnits if !self.unit.is_empty() => format!("{} ({})", self.name, self.unit),
            _ => self.name.clone(),
        }
    }
}

impl Cells<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Truth(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    pub(crate) fn text(&self, row: usize) -> String {
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
