//! The results of a study as a table: a row for each run, with its values, its measures and the error if it failed.
//! As CSV, and as Parquet, which keeps types and missing values.
//!
//! Parquet rather than Arrow's own file: pandas, Polars, Spark and MATLAB all read it, and of the crates
//! that write either, `parquet` without its Arrow layer is the smallest (29 crates in its tree; `arrow-ipc` with
//! `arrow-array` has 41).

use std::io::{self, Write};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_package::Value;
use parquet::basic::{ConvertedType, Repetition, Type as PhysicalType};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::journal::Outcome;
use super::measures::Measure;
use super::{Loaded, Parameter, written};

/// The table's files in the folder of the results.
pub const CSV: &str = "results.csv";
pub const PARQUET: &str = "results.parquet";

/// The columns that every study has.
const RUN: &str = "run";
const ERROR: &str = "error";
const WARNINGS: &str = "warnings";

/// Refuses a measure with the name of another column.
pub(super) fn refuse_names(parameters: &[Parameter], measures: &[Measure]) -> Result<()> {
    let parameters = parameters.iter().map(|parameter| parameter.name.as_str());
    let taken: Vec<_> = parameters.chain([RUN, ERROR, WARNINGS]).collect();
    // TOML forbids two measures of the same name.
    match measures.iter().find(|measure| taken.contains(&measure.name.as_str())) {
        Some(measure) => Err(measure.location.error(format!(
            "the results have a column {} already; give the measure another name",
            measure.name
        ))),
        None => Ok(()),
    }
}

pub struct Table(Vec<ResultColumn>);

struct ResultColumn {
    name: String,
    cells: Cells,
}

enum Cells {
    Number(Vec<Option<f64>>),
    Whole(Vec<Option<i32>>),
    Truth(Vec<Option<bool>>),
    Text(Vec<Option<String>>),
}

impl Table {
    /// The results of a study; `outcomes` are those of all runs, in their order.
    pub fn new(loaded: &Loaded, outcomes: &[Outcome]) -> Self {
        let study = loaded.study();
        let whole = |value| i32::try_from(value).ok();
        let runs = outcomes.iter().map(|outcome| whole(outcome.run)).collect();
        let mut columns = vec![ResultColumn { name: RUN.to_owned(), cells: Cells::Whole(runs) }];
        for (index, (parameter, data_type)) in study.parameters.iter().zip(&loaded.data_types).enumerate() {
            let values = study.points.iter().map(|point| point[index].as_ref());
            let cells = match data_type.as_str() {
                "Real" => Cells::Number(
                    values
                        .map(|value| match value? {
                            Value::Real(value, _) => Some(*value),
                            Value::Integer(value) => Some(f64::from(*value)),
                            _ => None,
                        })
                        .collect(),
                ),
                "Integer" => Cells::Whole(
                    values
                        .map(|value| if let Value::Integer(value) = value? { Some(*value) } else { None })
                        .collect(),
                ),
                "Boolean" => Cells::Truth(
                    values
                        .map(|value| if let Value::Boolean(value) = value? { Some(*value) } else { None })
                        .collect(),
                ),
                _ => Cells::Text(values.map(|value| value.map(written)).collect()),
            };
            columns.push(ResultColumn { name: parameter.name.clone(), cells });
        }
        for (index, measure) in study.measures.iter().enumerate() {
            let values = outcomes.iter().map(|outcome| outcome.measures[index]).collect();
            columns.push(ResultColumn { name: measure.name.clone(), cells: Cells::Number(values) });
        }
        let errors = outcomes.iter().map(|outcome| outcome.error.clone()).collect();
        columns.push(ResultColumn { name: ERROR.to_owned(), cells: Cells::Text(errors) });
        let joined = |outcome: &Outcome| (!outcome.warnings.is_empty()).then(|| outcome.warnings.join("\n"));
        let warnings = outcomes.iter().map(joined).collect();
        columns.push(ResultColumn { name: WARNINGS.to_owned(), cells: Cells::Text(warnings) });
        Self(columns)
    }

    /// Writes CSV; numbers read back as the same doubles, missing values are empty.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record(self.0.iter().map(|column| column.name.as_str()))?;
        for row in 0..self.0.first().map_or(0, |column| column.cells.len()) {
            csv.write_record(self.0.iter().map(|column| column.cells.text(row)))?;
        }
        csv.flush()
    }

    /// Writes Parquet: doubles, 32-bit integers, Booleans and UTF-8 texts, all of which can be missing.
    pub fn write_parquet(&self, writer: impl Write + Send) -> io::Result<()> {
        self.write_all_parquet(writer).map_err(|error| io::Error::other(format!("{error:#}")))
    }

    fn write_all_parquet(&self, writer: impl Write + Send) -> Result<()> {
        let fields = self.0.iter().map(|column| {
            let (physical, converted) = column.cells.parquet_type();
            let field = Type::primitive_type_builder(&column.name, physical)
                .with_converted_type(converted)
                .with_repetition(Repetition::OPTIONAL);
            Ok(Arc::new(field.build()?))
        });
        let fields = fields.collect::<Result<_>>()?;
        let schema = Arc::new(Type::group_type_builder("results").with_fields(fields).build()?);
        let properties = Arc::new(WriterProperties::builder().build());
        let mut file = SerializedFileWriter::new(writer, schema, properties)?;
        let mut rows = file.next_row_group()?;
        for column in &self.0 {
            let mut writer = rows.next_column()?.context("fewer columns than in the schema")?;
            column.cells.write(writer.untyped())?;
            writer.close()?;
        }
        rows.close()?;
        file.close()?;
        Ok(())
    }
}

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Number(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Truth(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    fn text(&self, row: usize) -> String {
        match self {
            Self::Number(cells) => cells[row].map(|value| format!("{value:?}")),
            Self::Whole(cells) => cells[row].map(|value| value.to_string()),
            Self::Truth(cells) => cells[row].map(|value| value.to_string()),
            Self::Text(cells) => cells[row].clone(),
        }
        .unwrap_or_default()
    }

    fn parquet_type(&self) -> (PhysicalType, ConvertedType) {
        match self {
            Self::Number(_) => (PhysicalType::DOUBLE, ConvertedType::NONE),
            Self::Whole(_) => (PhysicalType::INT32, ConvertedType::NONE),
            Self::Truth(_) => (PhysicalType::BOOLEAN, ConvertedType::NONE),
            Self::Text(_) => (PhysicalType::BYTE_ARRAY, ConvertedType::UTF8),
        }
    }

    fn write(&self, writer: &mut ColumnWriter<'_>) -> Result<()> {
        match (self, writer) {
            (Self::Number(cells), ColumnWriter::DoubleColumnWriter(writer)) => {
                let (values, levels) = split(cells);
                writer.write_batch(&values, Some(&levels), None)?;
            }
            (Self::Whole(cells), ColumnWriter::Int32ColumnWriter(writer)) => {
                let (values, levels) = split(cells);
                writer.write_batch(&values, Some(&levels), None)?;
            }
            (Self::Truth(cells), ColumnWriter::BoolColumnWriter(writer)) => {
                let (values, levels) = split(cells);
                writer.write_batch(&values, Some(&levels), None)?;
            }
            (Self::Text(cells), ColumnWriter::ByteArrayColumnWriter(writer)) => {
                let (texts, levels) = split(cells);
                let values: Vec<_> = texts.iter().map(|text| ByteArray::from(text.as_str())).collect();
                writer.write_batch(&values, Some(&levels), None)?;
            }
            _ => bail!("the column's type is not the schema's"),
        }
        Ok(())
    }
}

/// The present values, and for each cell 1 if its value is present (Parquet's definition levels).
fn split<T: Clone>(cells: &[Option<T>]) -> (Vec<T>, Vec<i16>) {
    let levels = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    (cells.iter().flatten().cloned().collect(), levels)
}
