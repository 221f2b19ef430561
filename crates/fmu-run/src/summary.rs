//! What `simulate` prints of a run that it does not record.

use std::array::from_fn;
use std::fmt::Write as _;

use fmu_io::terminal::in_line;
use fmu_record::{Column, Record};

/// The course of each variable, once there is a row.
pub struct Summary(Vec<(Column, Option<Course>)>);

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
        Self(columns.map(|column| (column.clone(), None)).collect())
    }

    /// Adds the rows of a record.
    pub fn add(&mut self, record: &Record) {
        for ((heading, course), column) in self.0.iter_mut().zip(record.columns()) {
            if column.is_text {
                heading.items.clone_from(&column.items);
            }
            for &value in &column.values {
                let before =
                    course.unwrap_or(Course { first: value, last: value, least: value, largest: value });
                // Both leave out what is not a number.
                let (least, largest) = (before.least.min(value), before.largest.max(value));
                *course = Some(Course { last: value, least, largest, ..before });
            }
        }
    }

    /// A line for each variable.
    pub fn text(&self) -> String {
        let heads = ["", "first", "last", "least", "largest"].map(str::to_owned);
        let rows = self.0.iter().filter_map(|(column, course)| {
            let Course { first, last, least, largest } = (*course)?;
            let texts = [first, last, least, largest].map(|value| in_line(&column.text(value)));
            let [first, last, least, largest] = texts;
            // Texts have no order.
            let [least, largest] =
                [least, largest].map(|text| if column.is_text { String::new() } else { text });
            Some([column.name.clone(), first, last, least, largest])
        });
        let rows: Vec<_> = [heads].into_iter().chain(rows).collect();
        let mut text = String::new();
        if rows.len() == 1 {
            return text;
        }
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
