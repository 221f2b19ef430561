//! Parquet, which keeps types, missing values and units.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::panic;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_terms::DisplayUnit;
use parquet::basic::{ConvertedType, Repetition, Type as PhysicalType};
use parquet::column::reader::get_typed_column_reader;
use parquet::column::writer::{ColumnWriter, ColumnWriterImpl};
use parquet::data_type::{ByteArray, DataType, DoubleType};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::types::Type;

use crate::cells::DataColumn;
use crate::table::{Cells, Column, Table};

/// The metadata key of a Parquet file for the units of the columns, a JSON object.
const UNITS: &str = "units";
/// The key of their display units, each a name, a factor and an offset.
const DISPLAY_UNITS: &str = "display_units";

/// The columns of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<DataColumn>> {
    without_panic(|| parquet_columns(path))
}

/// The library for Parquet panics on some damaged files.
fn without_panic<T>(read: impl FnOnce() -> Result<T> + panic::UnwindSafe) -> Result<T> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| ()));
    let read = panic::catch_unwind(read);
    panic::set_hook(hook);
    read.unwrap_or_else(|_| bail!("it is damaged"))
}

fn parquet_columns(path: &Path) -> Result<Vec<DataColumn>> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let metadata = reader.metadata().file_metadata();
    let text = |key: &str| {
        let pair = metadata.key_value_metadata().into_iter().flatten().find(|pair| pair.key == key);
        pair.and_then(|pair| pair.value.as_deref()).unwrap_or("{}")
    };
    let broken = |key: &str| format!("its metadata {key}");
    let mut units: BTreeMap<String, String> =
        serde_json::from_str(text(UNITS)).with_context(|| broken(UNITS))?;
    let mut display_units: BTreeMap<String, (String, f64, f64)> =
        serde_json::from_str(text(DISPLAY_UNITS)).with_context(|| broken(DISPLAY_UNITS))?;
    let schema = metadata.schema_descr();
    if schema.root_schema().get_fields().len() != schema.num_columns() {
        bail!("it has columns within columns");
    }
    let mut columns = vec![];
    let mut others = vec![];
    for (index, description) in schema.columns().iter().enumerate() {
        let name = description.name().to_owned();
        let mut values = vec![];
        if description.physical_type() == PhysicalType::DOUBLE && description.max_def_level() == 0 {
            for group in 0..reader.num_row_groups() {
                let group = reader.get_row_group(group)?;
                let rows = usize::try_from(group.metadata().num_rows())?;
                let mut column = get_typed_column_reader::<DoubleType>(group.get_column_reader(index)?);
                column.read_records(rows, None, None, &mut values)?;
            }
        } else {
            others.push(index);
        }
        let unit = units.remove(&name).unwrap_or_default();
        let display_unit = display_units.remove(&name);
        let display_unit = display_unit.map(|(name, factor, offset)| DisplayUnit { name, factor, offset });
        columns.push(DataColumn::from(Column { display_unit, values, ..Column::from((name, unit)) }));
    }
    if !others.is_empty() {
        for row in reader.get_row_iter(None)? {
            let row = row?;
            for (index, (_, field)) in
                row.get_column_iter().enumerate().filter(|(index, _)| others.contains(index))
            {
                match field {
                    Field::Double(number) => columns[index].push_number(*number),
                    Field::Null => columns[index].push(""),
                    Field::Str(text) => columns[index].push(text),
                    other => columns[index].push(&other.to_string()),
                }
            }
        }
    }
    Ok(columns)
}

/// Writes doubles, 32-bit integers, Booleans and UTF-8 texts.
pub(crate) fn write(table: &Table<'_>, writer: impl Write + Send) -> io::Result<()> {
    write_all(table, writer).map_err(|error| io::Error::other(format!("{error:#}")))
}

fn write_all(table: &Table<'_>, writer: impl Write + Send) -> Result<()> {
    let fields = table.0.iter().map(|column| {
        let (physical, converted, repetition) = parquet_type(&column.cells);
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_converted_type(converted)
            .with_repetition(repetition);
        Ok(Arc::new(field.build()?))
    });
    let fields = fields.collect::<Result<_>>()?;
    let schema = Arc::new(Type::group_type_builder("table").with_fields(fields).build()?);
    let units = table.0.iter().filter(|column| !column.unit.is_empty());
    let units: BTreeMap<_, _> = units.map(|column| (&column.name, &column.unit)).collect();
    let shown = table.0.iter().filter_map(|column| {
        let DisplayUnit { name, factor, offset } = column.display_unit.as_ref()?;
        Some((&column.name, (name, factor, offset)))
    });
    let shown: BTreeMap<_, _> = shown.collect();
    let texts = [(UNITS, serde_json::to_string(&units)?), (DISPLAY_UNITS, serde_json::to_string(&shown)?)];
    let pairs = texts.map(|(key, text)| KeyValue::new(key.to_owned(), text)).to_vec();
    let properties = WriterProperties::builder().set_key_value_metadata(Some(pairs));
    let properties = Arc::new(properties.build());
    let mut file = SerializedFileWriter::new(writer, schema, properties)?;
    let mut rows = file.next_row_group()?;
    for column in &table.0 {
        let mut writer = rows.next_column()?.context("fewer columns than in the schema")?;
        write_cells(&column.cells, writer.untyped())?;
        writer.close()?;
    }
    rows.close()?;
    file.close()?;
    Ok(())
}

fn parquet_type(cells: &Cells<'_>) -> (PhysicalType, ConvertedType, Repetition) {
    match cells {
        Cells::Numbers(_) => (PhysicalType::DOUBLE, ConvertedType::NONE, Repetition::REQUIRED),
        Cells::Number(_) => (PhysicalType::DOUBLE, ConvertedType::NONE, Repetition::OPTIONAL),
        Cells::Whole(_) => (PhysicalType::INT32, ConvertedType::NONE, Repetition::OPTIONAL),
        Cells::Truth(_) => (PhysicalType::BOOLEAN, ConvertedType::NONE, Repetition::OPTIONAL),
        Cells::Text(_) => (PhysicalType::BYTE_ARRAY, ConvertedType::UTF8, Repetition::OPTIONAL),
    }
}

fn write_cells(cells: &Cells<'_>, writer: &mut ColumnWriter<'_>) -> Result<()> {
    match (cells, writer) {
        (Cells::Numbers(cells), ColumnWriter::DoubleColumnWriter(writer)) => {
            writer.write_batch(cells, None, None)?;
        }
        (Cells::Number(cells), ColumnWriter::DoubleColumnWriter(writer)) => write_optional(cells, writer)?,
        (Cells::Whole(cells), ColumnWriter::Int32ColumnWriter(writer)) => write_optional(cells, writer)?,
        (Cells::Truth(cells), ColumnWriter::BoolColumnWriter(writer)) => write_optional(cells, writer)?,
        (Cells::Text(cells), ColumnWriter::ByteArrayColumnWriter(writer)) => {
            let bytes = |cell: &Option<String>| cell.as_deref().map(ByteArray::from);
            write_optional(&cells.iter().map(bytes).collect::<Vec<_>>(), writer)?;
        }
        _ => bail!("the column's type is not the schema's"),
    }
    Ok(())
}

/// Writes the present values, and for each cell 1 if its value is present (Parquet's definition levels).
fn write_optional<T: DataType>(cells: &[Option<T::T>], writer: &mut ColumnWriterImpl<'_, T>) -> Result<()> {
    let levels: Vec<_> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<_> = cells.iter().flatten().cloned().collect();
    writer.write_batch(&values, Some(&levels), None)?;
    Ok(())
}
