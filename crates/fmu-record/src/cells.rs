//! The cells of measured data, and what they mean to a variable: numbers, Booleans, or words.

use std::collections::BTreeMap;

use crate::table::Column;

/// A column: its heading, and its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct DataColumn {
    /// The column with the numbers; NaN in place of words.
    pub(crate) column: Column,
    /// The cells that are not numbers, by row.
    words: BTreeMap<usize, String>,
}

/// A cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// A number.
    Number(f64),
    /// Anything else.
    Word(&'a str),
}

/// A number.
#[must_use]
pub fn as_number(cell: Cell<'_>) -> Option<f64> {
    match cell {
        Cell::Number(number) => Some(number),
        Cell::Word(_) => None,
    }
}

/// A Boolean as 0 or 1, from 0 and 1 or the words, in any case.
#[must_use]
#[allow(clippy::float_cmp)] // whole numbers
pub fn as_truth(cell: Cell<'_>) -> Option<f64> {
    match cell {
        Cell::Number(number) => [0.0, 1.0].into_iter().find(|known| *known == number),
        Cell::Word(word) if word.eq_ignore_ascii_case("true") => Some(1.0),
        Cell::Word(word) if word.eq_ignore_ascii_case("false") => Some(0.0),
        Cell::Word(_) => None,
    }
}

impl DataColumn {
    /// The name in the heading.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.column.name
    }

    /// The unit in the heading or below it; empty if there is none.
    #[must_use]
    pub fn unit(&self) -> &str {
        &self.column.unit
    }

    /// Appends a cell, which may be a number.
    pub(crate) fn push(&mut self, text: &str) {
        let number = text.parse().unwrap_or_else(|_| {
            self.words.insert(self.column.values.len(), text.to_owned());
            f64::NAN
        });
        self.push_number(number);
    }

    /// Appends a number.
    pub(crate) fn push_number(&mut self, number: f64) {
        self.column.values.push(number);
    }

    /// The cell in a row.
    pub(crate) fn cell(&self, row: usize) -> Cell<'_> {
        self.words.get(&row).map_or(Cell::Number(self.column.values[row]), |word| Cell::Word(word))
    }

    /// The row of the first cell that is not a number.
    pub(crate) fn first_word(&self) -> Option<usize> {
        self.words.keys().next().copied()
    }

    /// Whether it holds texts: without a unit, words other than cells that are missing among numbers.
    pub(crate) fn has_texts(&self) -> bool {
        let is_all_words = self.words.len() == self.column.values.len();
        self.unit().is_empty() && (is_all_words || self.words.values().any(|word| !word.is_empty()))
    }

    /// The column; one of texts has them as its items.
    pub(crate) fn into_column(self) -> Column {
        if !self.has_texts() {
            return self.column;
        }
        let (mut numbers, mut items) = (BTreeMap::new(), vec![]);
        let values = (0..self.column.values.len()).map(|row| {
            let text = match self.cell(row) {
                Cell::Number(number) => number.to_string(),
                Cell::Word(word) => word.to_owned(),
            };
            let next = i32::try_from(numbers.len()).unwrap_or(i32::MAX);
            let number = *numbers.entry(text).or_insert_with_key(|text| {
                items.push((text.clone(), next));
                next
            });
            f64::from(number)
        });
        let values = values.collect();
        Column { values, items, is_text: true, is_discrete: true, ..self.column.clone() }
    }
}

impl From<Column> for DataColumn {
    fn from(column: Column) -> Self {
        Self { column, words: BTreeMap::new() }
    }
}
