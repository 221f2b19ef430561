//! Recorded variables over time.

use std::io::{self, Write};

use anyhow::{Context, Result};

/// Variables at the communication points.
#[derive(Clone, Debug, Default)]
pub struct Record {
    time: Vec<f64>,
    columns: Vec<Column>,
}

#[derive(Clone, Debug)]
pub struct Column {
    /// In the header of the CSV file.
    pub name: String,
    /// Its unit, as its FMU declares it; empty where there is none.
    pub unit: String,
    pub values: Vec<f64>,
}

impl Record {
    /// An empty record of variables with their units.
    pub fn new(columns: impl IntoIterator<Item = (String, String)>) -> Self {
        let columns = columns.into_iter();
        let columns = columns.map(|(name, unit)| Column { name, unit, values: vec![] }).collect();
        Self { time: vec![], columns }
    }

    /// Appends a row: one value for each column.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        self.time.push(time);
        for (column, &value) in self.columns.iter_mut().zip(values) {
            column.values.push(value);
        }
    }

    /// The communication points (s).
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// The recorded variables, in the order of the columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    pub fn get(&self, name: &str) -> Result<&[f64]> {
        let column = self.columns.iter().find(|column| column.name == name);
        Ok(&column.with_context(|| format!("{name} is not recorded"))?.values)
    }

    /// Writes a CSV file: the time and the variables, in numbers that read back as the same doubles.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record(["time"].into_iter().chain(self.columns.iter().map(|column| column.name.as_str())))?;
        for (row, time) in self.time.iter().enumerate() {
            csv.write_field(format!("{time:?}"))?;
            for column in &self.columns {
                csv.write_field(format!("{:?}", column.values[row]))?;
            }
            csv.write_record(None::<&[u8]>)?;
        }
        csv.flush()
    }
}
