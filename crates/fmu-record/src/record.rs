//! Recorded variables over time.

use std::borrow::Cow;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::data::Data;
use crate::format::TableFormat;
use crate::table::{Cells, Column, Table, TableColumn};

/// The name of the first column.
const TIME: &str = "time";

/// Variables over time: the times, and a column of values for each variable. Rows are at communication points, and before
/// and after events.
#[derive(Clone, Debug, Default)]
pub struct Record {
    time: Vec<f64>,
    columns: Vec<Column>,
    /// The rows at events.
    events: Vec<usize>,
}

impl Record {
    /// An empty record of variables. Each is a column without values, or a name and a unit, which may be empty.
    pub fn new(columns: impl IntoIterator<Item = impl Into<Column>>) -> Self {
        Self { columns: columns.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// Appends a row: the time (s) and one value for each column.
    ///
    /// # Panics
    /// When there are more or fewer values than columns.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        assert_eq!(values.len(), self.columns.len(), "one value for each column");
        self.time.push(time);
        for (column, &value) in self.columns.iter_mut().zip(values) {
            column.values.push(value);
        }
    }

    /// Appends a row before or after an event, as [`Record::push`] does.
    ///
    /// # Panics
    /// When there are more or fewer values than columns.
    pub fn push_event(&mut self, time: f64, values: &[f64]) {
        self.events.push(self.time.len());
        self.push(time, values);
    }

    /// Adds texts to those of a column of texts, by its index. The first ones are there already.
    pub fn add_texts(&mut self, column: usize, texts: &[String]) {
        let items = &mut self.columns[column].items;
        for text in &texts[items.len()..] {
            items.push((text.clone(), i32::try_from(items.len()).unwrap_or(i32::MAX)));
        }
    }

    /// The record of the communication points alone. A record that is read has no other rows.
    #[must_use]
    pub fn without_events(&self) -> Cow<'_, Self> {
        if self.events.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut events = self.events.iter().peekable();
        let is_kept: Vec<_> =
            (0..self.time.len()).map(|row| events.next_if(|event| **event == row).is_none()).collect();
        let kept = |values: &[f64]| {
            values.iter().zip(&is_kept).filter(|(_, is_kept)| **is_kept).map(|(value, _)| *value).collect()
        };
        let column = |column: &Column| Column { values: kept(&column.values), ..column.clone() };
        let columns = self.columns.iter().map(column).collect();
        Cow::Owned(Self { time: kept(&self.time), columns, events: vec![] })
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.time.clear();
        self.events.clear();
        self.columns.iter_mut().for_each(|column| column.values.clear());
    }

    /// The time of each row (s); two rows of one time are a jump.
    #[must_use]
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// The recorded variables, in the order of the columns.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The values of a variable, one for each time.
    ///
    /// # Errors
    /// When it is not recorded, or its values are texts.
    pub fn get(&self, name: &str) -> Result<&[f64]> {
        let column = self.columns.iter().find(|column| column.name == name);
        let column = column.with_context(|| format!("{name} is not recorded"))?;
        if column.is_text {
            bail!("the values of {name} are texts");
        }
        Ok(&column.values)
    }

    /// The record as a table to write: the column `time` in s, then the variables.
    #[must_use]
    pub fn table(&self) -> Table<'_> {
        let time = TableColumn::new(&(TIME, "s").into(), Cells::Numbers(&self.time));
        let cells = |own: &'_ Column| {
            let text = |value: &f64| own.item(*value).map(str::to_owned);
            Cells::Text(own.values.iter().map(text).collect())
        };
        let columns = self.columns.iter().map(|own| {
            TableColumn::new(own, if own.is_text { cells(own) } else { Cells::Numbers(&own.values) })
        });
        Table([time].into_iter().chain(columns).collect())
    }

    /// Reads a `.csv` or `.parquet` file as [`Data::read`] does. A column without a unit that has words is of texts.
    ///
    /// # Errors
    /// When [`Data::read`] fails, or the file's name ends otherwise, or a cell is neither a number nor in a column of
    /// texts.
    pub fn read(path: &Path) -> Result<Self> {
        TableFormat::of(path)?;
        let read = Data::read(path, None)?.into_columns();
        let (time, columns) = read.with_context(|| format!("cannot read {}", path.display()))?;
        Ok(Self { time, columns, events: vec![] })
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::Write;

    use fmu_terms::DisplayUnit;

    use super::*;

    fn record() -> Record {
        let display_unit = Some(DisplayUnit { name: "kPa".to_owned(), factor: 1e-3, offset: 0.1 });
        let mut record = Record::new([
            Column { display_unit, ..Column::from(("boost pressure", "Pa")) },
            Column::from(("ratio (of two)", "")),
        ]);
        record.push(0.0, &[1e5 / 3.0, -0.0]);
        record.push(0.1 + 0.2, &[f64::NAN, 1e-300]);
        record
    }

    const FILES: &[&str] = if cfg!(feature = "parquet") { &["a.csv", "b.Parquet"] } else { &["a.csv"] };

    #[test]
    fn a_record_is_read_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        for name in FILES {
            let path = folder.path().join(name);
            let format = TableFormat::of(&path).unwrap();
            record().table().write(format, File::create(&path).unwrap()).unwrap();
            let read = Record::read(&path).unwrap();
            let bits = |record: &Record| -> Vec<Vec<u64>> {
                let columns = record.columns.iter().map(|column| &column.values);
                [&record.time]
                    .into_iter()
                    .chain(columns)
                    .map(|values| values.iter().map(|value| value.to_bits()).collect())
                    .collect()
            };
            assert_eq!(bits(&read), bits(&record()), "{name}");
            let headings = |record: &Record| -> Vec<_> {
                record.columns.iter().map(|column| (column.name.clone(), column.unit.clone())).collect()
            };
            assert_eq!(headings(&read), headings(&record()), "{name}");
            // CSV has no place for it.
            let display_unit = if *name == "a.csv" { None } else { record().columns[0].display_unit.clone() };
            assert_eq!(read.columns[0].display_unit, display_unit, "{name}");
        }
        let text = fs::read_to_string(folder.path().join("a.csv")).unwrap();
        assert!(text.starts_with("time,boost pressure,ratio (of two)\n# s,Pa,\n0.0,"), "{text}");
    }

    #[test]
    fn texts_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let words = ["", "a \"b\", c\nd", "3", ""];
        let mut record = Record::new([
            Column { is_text: true, is_discrete: true, ..Column::from(("note", "")) },
            Column::from(("p", "Pa")),
        ]);
        let texts = ["", "a \"b\", c\nd", "3"].map(str::to_owned);
        for (time, number) in [0.0, 1.0, 2.0, 0.0].into_iter().enumerate() {
            record.add_texts(0, &texts[..3.min(time + 1)]);
            record.push(time as f64, &[number, 1e5]);
        }
        assert_eq!(record.get("note").unwrap_err().to_string(), "the values of note are texts");
        for name in FILES {
            let path = folder.path().join(name);
            record.table().write(TableFormat::of(&path).unwrap(), File::create(&path).unwrap()).unwrap();
            let read = Record::read(&path).unwrap();
            let [note, p] = [0, 1].map(|column| &read.columns()[column]);
            let found: Vec<_> = note.values.iter().filter_map(|value| note.item(*value)).collect();
            assert!(note.is_text && !p.is_text, "{name}");
            assert_eq!(found, words, "{name}");
        }
    }

    #[test]
    fn units_are_read_below_the_header_or_in_it() {
        for (text, expected) in [
            ("time,p\n# s,kPa\n0,1\n", [("time", "s"), ("p", "kPa")]),
            ("# by hand\n\ntime, p\n#s, kPa\n0,1\n", [("time", "s"), ("p", "kPa")]),
            ("time (s),p [kPa]\n0,1\n", [("time", "s"), ("p", "kPa")]),
            ("time(s),p[kPa]\n# a comment\n0,1\n", [("time", "s"), ("p", "kPa")]),
            // An element of an array, and a comment that is no row of units.
            ("time,p[2]\n# a, b, c\n0,1\n", [("time", ""), ("p[2]", "")]),
            ("time,\"p[2,7]\"\n0,1\n", [("time", ""), ("p[2,7]", "")]),
        ] {
            let headings = crate::csv::headings(text).unwrap();
            assert_eq!(headings, expected.map(|(name, unit)| (name.to_owned(), unit.to_owned())), "{text}");
        }
    }

    #[test]
    fn columns_of_different_lengths_are_refused() {
        let column = |cells| TableColumn::new(&("a", "").into(), Cells::Numbers(cells));
        let table = Table([[1.0, 2.0].as_slice(), &[1.0]].map(column).into());
        for format in [TableFormat::Csv, TableFormat::Parquet] {
            let refusal = table.write(format, vec![]).unwrap_err();
            assert_eq!(refusal.to_string(), "the columns have different numbers of rows");
        }
    }

    #[test]
    fn files_that_are_not_records_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (name, content, reason) in [
            ("a.csv", "time,b (m)\n0,1\n1,x\n", "a.csv: line 3, b: expected a number, found \"x\""),
            // Missing among numbers.
            ("b.csv", "time,b\n0,1\n1,\n", "b.csv: line 3, b: expected a number, found \"\""),
            ("d.parquet", "no", "cannot read "),
            ("e.txt", "time\n0\n", "e.txt: a record is a file that ends with .csv or .parquet"),
        ] {
            let path = folder.path().join(name);
            File::create(&path).unwrap().write_all(content.as_bytes()).unwrap();
            let refusal = format!("{:#}", Record::read(&path).unwrap_err());
            assert!(refusal.contains(reason), "{refusal}");
        }
    }

    /// Whatever byte is wrong; the library for Parquet panics at some.
    #[cfg(feature = "parquet")]
    #[test]
    fn a_damaged_parquet_file_is_read_or_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        record().table().write(TableFormat::Parquet, File::create(&path).unwrap()).unwrap();
        let whole = fs::read(&path).unwrap();
        let mut panics = 0;
        for index in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[index] ^= 0xff;
            fs::write(&path, bytes).unwrap();
            if let Err(error) = Record::read(&path) {
                let error = format!("{error:#}");
                assert!(error.starts_with("cannot read ") && error.contains("a.parquet: "), "{error}");
                panics += usize::from(error.ends_with("it is damaged"));
            }
        }
        assert!(panics > 0);
    }
}
