//! Tables of columns with names and units, as CSV, or as Parquet, which keeps types, missing values and units.
//!
//! Parquet rather than Arrow's file format: pandas, Polars, Spark and MATLAB all read it, and of the crates that write
//! either, `parquet` without its Arrow layer is the smallest (29 crates in its tree; `arrow-ipc` with `arrow-array` has
//! 41).

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use parquet::basic::{ConvertedType, Repetition, Type as PhysicalType};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

/// The key of the columns' units, a JSON object, in a Parquet file's metadata.
pub const UNITS: &str = "units";

/// A table's file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    Csv,
    Parquet,
}

/// How a CSV file's header names a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Header {
    Names,
    /// `name (unit)`, if there is a unit.
    NamesAndUnits,
}

/// The name and unit in a column's header; the unit may be empty.
pub fn name_and_unit(header: &str) -> (&str, &str) {
    header.strip_suffix(')').and_then(|header| header.rsplit_once(" (")).unwrap_or((header, ""))
}

/// Rejects a time unit other than s.
pub fn expect_seconds(unit: &str) -> Result<()> {
    match unit {
        "" | "s" => Ok(()),
        other => bail!("its time is in {other}, not in s"),
    }
}

pub struct Table<'a>(pub Vec<TableColumn<'a>>);

pub struct TableColumn<'a> {
    pub name: String,
    /// Empty where there is none.
    pub unit: String,
    pub cells: Cells<'a>,
}

pub enum Cells<'a> {
    /// Numbers, none of which is missing.
    Numbers(&'a [f64]),
    Number(Vec<Option<f64>>),
    Whole(Vec<Option<i32>>),
    Truth(Vec<Option<bool>>),
    Text(Vec<Option<String>>),
}

impl TableFormat {
    /// The format of a file extension. Pipes and the like get CSV.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("csv") => Ok(Self::Csv),
            Some("parquet") => Ok(Self::Parquet),
            _ if path.exists() && !path.is_file() => Ok(Self::Csv),
            _ => bail!("{}: a record is a file that ends with .csv or .parquet", path.display()),
        }
    }
}

impl TableColumn<'_> {
    fn header(&self, header: Header) -> String {
        match header {
            Header::NamesAndUnits if !self.unit.is_empty() => format!("{} ({})", self.name, self.unit),
            _ => self.name.clone(),
        }
    }
}

impl Table<'_> {
    pub fn write(&self, format: TableFormat, header: Header, writer: impl Write + Send) -> io::Result<()> {
        match format {
            TableFormat::Csv => self.write_csv(header, writer),
            TableFormat::Parquet => self.write_parquet(writer),
        }
    }

    /// Writes CSV; numbers read back as the same doubles, missing values are empty.
    fn write_csv(&self, header: Header, writer: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(writer);
        csv.write_record(self.0.iter().map(|column| column.header(header)))?;
        for row in 0..self.0.first().map_or(0, |column| column.cells.len()) {
            csv.write_record(self.0.iter().map(|column| column.cells.text(row)))?;
        }
        csv.flush()
    }

    /// Writes Parquet: doubles, 32-bit integers, Booleans and UTF-8 texts.
    fn write_parquet(&self, writer: impl Write + Send) -> io::Result<()> {
        self.write_all_parquet(writer).map_err(|error| io::Error::other(format!("{error:#}")))
    }

    fn write_all_parquet(&self, writer: impl Write + Send) -> Result<()> {
        let fields = self.0.iter().map(|column| {
            let (physical, converted, repetition) = column.cells.parquet_type();
            let field = Type::primitive_type_builder(&column.name, physical)
                .with_converted_type(converted)
                .with_repetition(repetition);
            Ok(Arc::new(field.build()?))
        });
        let fields = fields.collect::<Result<_>>()?;
        let schema = Arc::new(Type::group_type_builder("table").with_fields(fields).build()?);
        let units = self.0.iter().filter(|column| !column.unit.is_empty());
        let units: BTreeMap<_, _> = units.map(|column| (&column.name, &column.unit)).collect();
        let units = KeyValue::new(UNITS.to_owned(), serde_json::to_string(&units)?);
        let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![units]));
        let properties = Arc::new(properties.build());
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

impl Cells<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(cells) => cells.len(),
            Self::Number(cells) => cells.len(),
            Self::Whole(cells) => cells.len(),
            Self::Truth(cells) => cells.len(),
            Self::Text(cells) => cells.len(),
        }
    }

    fn text(&self, row: usize) -> String {
        match self {
            Self::Numbers(cells) => Some(format!("{:?}", cells[row])),
            Self::Number(cells) => cells[row].map(|value| format!("{value:?}")),
            Self::Whole(cells) => cells[row].map(|value| value.to_string()),
            Self::Truth(cells) => cells[row].map(|value| value.to_string()),
            Self::Text(cells) => cells[row].clone(),
        }
        .unwrap_or_default()
    }

    fn parquet_type(&self) -> (PhysicalType, ConvertedType, Repetition) {
        match self {
            Self::Numbers(_) => (PhysicalType::DOUBLE, ConvertedType::NONE, Repetition::REQUIRED),
            Self::Number(_) => (PhysicalType::DOUBLE, ConvertedType::NONE, Repetition::OPTIONAL),
            Self::Whole(_) => (PhysicalType::INT32, ConvertedType::NONE, Repetition::OPTIONAL),
            Self::Truth(_) => (PhysicalType::BOOLEAN, ConvertedType::NONE, Repetition::OPTIONAL),
            Self::Text(_) => (PhysicalType::BYTE_ARRAY, ConvertedType::UTF8, Repetition::OPTIONAL),
        }
    }

    fn write(&self, writer: &mut ColumnWriter<'_>) -> Result<()> {
        match (self, writer) {
            (Self::Numbers(cells), ColumnWriter::DoubleColumnWriter(writer)) => {
                writer.write_batch(cells, None, None)?;
            }
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
