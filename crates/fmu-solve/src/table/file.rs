//! Tables from files.

use super::{Surface, refused};
use crate::error::Error;

/// The files that a model brings along.
pub trait ReadResource {
    /// The bytes of a file.
    ///
    /// # Errors
    /// When it cannot be read.
    fn resource(&self, name: &str) -> Result<Vec<u8>, Error>;
}

/// The numbers of a CSV file, by rows. Empty lines and those that begin with `#` are left out, as is a first line of
/// names. The first cell may be a text, which a grid does not use.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    name: String,
    rows: Vec<Vec<f64>>,
    /// The refusal of the first cell, if it is a text.
    corner: Option<Error>,
}

impl Table {
    /// Reads a text; its name is for messages.
    ///
    /// # Errors
    /// When a cell other than the first is not a number; the message names the line.
    pub fn parse(name: &str, text: &str) -> Result<Self, Error> {
        let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
        let lines = lines.filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
        let (mut rows, mut corner) = (vec![], None);
        for (position, (index, line)) in lines.enumerate() {
            let cells = line.split(',').map(str::trim);
            if position == 0 && cells.clone().all(|cell| cell.parse::<f64>().is_err()) {
                continue;
            }
            let number = |(column, cell): (usize, &str)| {
                cell.parse().or_else(|_| {
                    let refusal = refused(name, format_args!("line {}: '{cell}' is not a number", index + 1));
                    if (position, column) == (0, 0) {
                        corner = Some(refusal);
                        return Ok(f64::NAN);
                    }
                    Err(refusal)
                })
            };
            rows.push(cells.enumerate().map(number).collect::<Result<_, _>>()?);
        }
        Ok(Self { name: name.to_owned(), rows, corner })
    }

    /// Reads a file of a model's resources, which are those of `fmu_export::Context`.
    ///
    /// # Errors
    /// When [`ReadResource::resource`] or [`Table::parse`] fails, or the file is not UTF-8.
    pub fn resource(resources: &impl ReadResource, name: &str) -> Result<Self, Error> {
        let bytes = resources.resource(name)?;
        let text = str::from_utf8(&bytes).map_err(|error| refused(name, error))?;
        Self::parse(name, text)
    }

    /// The table's rows. If the first cell is a text, it is NaN.
    #[must_use]
    pub fn rows(self) -> Vec<Vec<f64>> {
        self.rows
    }

    /// The table's columns.
    ///
    /// # Errors
    /// When the first cell is a text, or a row has another number of cells.
    pub fn columns<const COLUMNS: usize>(self) -> Result<[Vec<f64>; COLUMNS], Error> {
        if let Some(refusal) = self.corner {
            return Err(refusal);
        }
        let mut columns = [const { Vec::new() }; COLUMNS];
        for (index, row) in self.rows.iter().enumerate() {
            let row: &[f64; COLUMNS] = row.as_slice().try_into().map_err(|_| {
                let (row, cells) = (index + 1, row.len());
                refused(&self.name, format_args!("row {row} has {cells} cells, not {COLUMNS}"))
            })?;
            for (column, &cell) in columns.iter_mut().zip(row) {
                column.push(cell);
            }
        }
        Ok(columns)
    }

    /// The table's numbers as those of a [`Surface`]: columns' knots in the first row, after a cell that is not used
    /// and may be a text, then in each row the row's knot and its values.
    ///
    /// # Errors
    /// When [`Surface::check`] rejects the numbers.
    pub fn grid(self) -> Result<Grid, Error> {
        let mut rows = self.rows.into_iter();
        let columns = rows.next().unwrap_or_default().into_iter().skip(1).collect();
        let (rows, values) = rows
            .map(|mut row| {
                let values = row.split_off(row.len().min(1));
                (row.first().copied().unwrap_or(f64::NAN), values)
            })
            .unzip();
        let grid = Grid { rows, columns, values };
        grid.surface().check(&self.name)?;
        Ok(grid)
    }
}

/// The numbers of a [`Surface`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    rows: Vec<f64>,
    columns: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Grid {
    /// The surface over these numbers.
    #[must_use]
    pub fn surface(&self) -> Surface<'_, Vec<f64>> {
        Surface::new(&self.rows, &self.columns, &self.values)
    }
}

crate::persistent! { Grid { rows, columns, values } }
