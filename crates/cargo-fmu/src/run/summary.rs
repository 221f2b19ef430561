//! What `simulate` prints of a run that it does not record.

use std::array::from_fn;
use std::fmt::Write as _;

use fmu_record::{Column, Record};

/// The course of each variable: its first and last, least and largest value.
pub struct Summary {
    columns: Vec<Column>,
    courses: Vec<Course>,
    is_empty: bool,
}

#[derive(Clone, Copy)]
struct Course {
    first: f64,
    last: f64,
    least: f64,
    largest: f64,
}

impl Summary {
    /// One without rows.
    pub fn new<'a>(columns: impl Iterator<Item = &'a Column>) -> Self {
        let columns: Vec<_> = columns.cloned().collect();
        let course = Course { first: f64::NAN, last: f64::NAN, least: f64::NAN, largest: f64::NAN };
        Self { courses: vec![course; columns.len()], columns, is_empty: true }
    }

    /// Adds the rows of a record.
    pub fn add(&mut self, record: &Record) {
        for (course, column) in self.courses.iter_mut().zip(record.columns()) {
            if self.is_empty {
                course.first = column.values.first().copied().unwrap_or(f64::NAN);
            }
            course.last = column.values.last().copied().unwrap_or(course.last);
            for &value in &column.values {
                // Both leave out what is not a number.
                course.least = course.least.min(value);
                course.largest = course.largest.max(value);
            }
        }
        self.is_empty &= record.time().is_empty();
    }

    /// A line for each variable.
    pub fn text(&self) -> String {
        let heads = ["", "first", "last", "least", "largest"].map(str::to_owned);
        let rows = self.columns.iter().zip(&self.courses).map(|(column, course)| {
            let Course { first, last, least, largest } = *course;
            let [first, last, least, largest] = [first, last, least, largest].map(|value| column.text(value));
            [column.name.clone(), first, last, least, largest]
        });
        let rows: Vec<_> = [heads].into_iter().chain(rows).collect();
        let mut text = String::new();
        let widths: [_; 5] = from_fn(|index| rows.iter().map(|row| row[index].chars().count()).max());
        for row in &rows {
            let mut line = String::new();
            for (cell, width) in row.iter().zip(widths) {
                let _ = write!(line, "  {cell:0$}", width.unwrap_or_default());
            }
            let _ = writeln!(text, "{}", line.trim_end());
        }
        text
    }
}
