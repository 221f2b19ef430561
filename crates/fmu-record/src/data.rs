//! Measured data: the columns of a file over its first one, the time. docs/simulate.md in the repository has the rule.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Error, Result, anyhow, bail};
use fmu_io::reading;
use fmu_io::terminal::number;
use fmu_terms::{Linear, UnitTable, like, spelled};

use crate::cells::{Cell, DataColumn, as_number};
use crate::table::Column;
use crate::{csv, parquet};

/// Columns over time, as they are in a file; a variable decides what a word means.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Data {
    time: Vec<f64>,
    columns: Vec<DataColumn>,
    /// The line of each row; none in Parquet.
    lines: Vec<u64>,
}

impl Data {
    /// Reads a file: Parquet if its name ends with `.parquet`, else CSV. `time_unit` replaces the unit in the heading of
    /// the time.
    ///
    /// # Errors
    /// When the file cannot be read, is Parquet while the feature `parquet` is off, has no rows, or two columns of one
    /// name, or its time is in no unit of time, is not a finite number or decreases.
    pub fn read(path: &Path, time_unit: Option<&str>) -> Result<Self> {
        let is_parquet = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet"));
        let read = if is_parquet {
            parquet::read(path).map(|columns| (columns, vec![]))
        } else {
            reading::text(path).map_err(Error::from).and_then(|text| csv::read(&text))
        };
        let data = read.and_then(|(columns, lines)| Self::new(columns, lines, time_unit));
        data.with_context(|| format!("cannot read {}", path.display()))
    }

    fn new(columns: Vec<DataColumn>, lines: Vec<u64>, time_unit: Option<&str>) -> Result<Self> {
        let mut columns = columns.into_iter();
        let time = columns.next().context("it has no columns")?;
        let headed = columns.filter(|column| !column.name().is_empty());
        let mut data = Self { columns: headed.collect(), lines, time: vec![] };
        let mut names = BTreeSet::new();
        if let Some(twin) = data.columns.iter().find(|column| !names.insert(column.name())) {
            bail!("two columns are named {}", twin.name());
        }
        if time.column.values.is_empty() {
            bail!("it has no rows");
        }
        let to_seconds = to_seconds(time_unit.unwrap_or(time.unit()))?;
        data.time = data.values(&time, as_number, "a number")?;
        if to_seconds != Linear::IDENTITY {
            for time in &mut data.time {
                *time = to_seconds.apply(*time);
            }
        }
        if let Some(row) = data.time.windows(2).position(|pair| pair[1] < pair[0]) {
            let [before, after] = [data.time[row], data.time[row + 1]].map(number);
            let place = data.place(row + 1);
            bail!("{place}, {}: the time decreases from {before} s to {after} s", time.name());
        }
        Ok(data)
    }

    /// The time of each row (s); two rows of one time are a jump.
    #[must_use]
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// The columns with a heading, after the time.
    #[must_use]
    pub fn columns(&self) -> &[DataColumn] {
        &self.columns
    }

    /// The data with a single column.
    ///
    /// # Errors
    /// When there is no column of this name.
    pub fn only(&self, name: &str) -> Result<Self> {
        let names = || self.columns.iter().map(DataColumn::name);
        let column = self.columns.iter().find(|column| column.name() == name).with_context(|| {
            let known = names().collect::<Vec<_>>().join(", ");
            format!("it has no column {name}{}; there are {known}", like(name, names()))
        })?;
        Ok(Self { columns: vec![column.clone()], time: self.time.clone(), lines: self.lines.clone() })
    }

    /// The cells of a column as numbers, by what they mean; `expected` describes a valid cell.
    ///
    /// # Errors
    /// When a cell means nothing, or is not a finite number; the message names the line.
    pub fn values(
        &self,
        column: &DataColumn,
        meaning: impl Fn(Cell<'_>) -> Option<f64>,
        expected: &str,
    ) -> Result<Vec<f64>> {
        let value = |row| {
            let value = meaning(column.cell(row)).filter(|value| value.is_finite());
            value.ok_or_else(|| self.refused(column, row, expected))
        };
        (0..column.column.values.len()).map(value).collect()
    }

    /// The time, and columns of numbers, which need not be finite, or of texts.
    pub(crate) fn into_columns(self) -> Result<(Vec<f64>, Vec<Column>)> {
        for column in self.columns.iter().filter(|column| !column.has_texts()) {
            if let Some(row) = column.first_word() {
                return Err(self.refused(column, row, "a number"));
            }
        }
        Ok((self.time, self.columns.into_iter().map(DataColumn::into_column).collect()))
    }

    /// The line of a row, in Parquet its number.
    #[must_use]
    pub fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(row as u64 + 1)
    }

    /// A row, for messages.
    #[must_use]
    pub fn place(&self, row: usize) -> String {
        format!("{} {}", if self.lines.is_empty() { "row" } else { "line" }, self.line(row))
    }

    fn refused(&self, column: &DataColumn, row: usize, expected: &str) -> Error {
        let found = match column.cell(row) {
            Cell::Number(found) => number(found),
            Cell::Word(word) => format!("\"{word}\""),
        };
        anyhow!("{}, {}: expected {expected}, found {found}", self.place(row), column.name())
    }
}

/// The conversion of a time to s.
fn to_seconds(unit: &str) -> Result<Linear> {
    let table = UnitTable::default();
    let base = |name: &str| table.base(&spelled(name)).map_err(Error::msg);
    let conversion = if unit.is_empty() {
        Some(Linear::IDENTITY)
    } else {
        base(unit)?.zip(base("s")?).and_then(|(own, second)| own.to(&second))
    };
    conversion.with_context(|| format!("its time is in {unit}, which is no unit of time"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::cells::as_truth;

    fn read(text: &str) -> Result<Data, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, text).unwrap();
        Data::read(&path, None).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn the_first_column_is_the_time_in_any_unit_of_it() {
        for (heading, factor) in [("time", 1.0), ("t (ms)", 1e-3), ("Zeit [min]", 60.0), ("\u{feff}x", 1.0)] {
            let data = read(&format!("{heading},a\n0,1\n30,2\n30,3\n")).unwrap();
            assert_eq!(data.time(), [0.0, 30.0 * factor, 30.0 * factor], "{heading}");
        }
        let refusal = read("time (K),a\n0,1\n").unwrap_err();
        assert!(refusal.ends_with("a.csv: its time is in K, which is no unit of time"), "{refusal}");
        let refusal = read("time (sec),a\n0,1\n").unwrap_err();
        assert!(refusal.ends_with("the unit 'sec' is not known; its symbol is 's'"), "{refusal}");
    }

    /// As spreadsheets write them: the first separator of the header decides.
    #[test]
    fn semicolons_come_with_decimal_commas() {
        for text in [
            "t (ms);a [2,7];b (Pa);note\n0;1,5;-2e3;x, y\n500;-0,25;1;1,5,0\n",
            "# by hand, 1;2\n\"t\";\"a [2,7]\";b;note\n# ms;;Pa;\n0; 1,5 ;-2e3;\"x, y\"\n500;-0,25;1.0;1,5,0\n",
            "t,\"a [2,7]\",b;c,note\n#ms,,Pa,\n0,1.5,-2e3,\"x, y\"\n500,-0.25,1,\"1,5,0\"\n",
        ] {
            let data = read(text).unwrap();
            assert_eq!(data.time(), [0.0, 0.5], "{text}");
            let [a, b, note] = data.columns() else { panic!("{text}") };
            assert_eq!((a.name(), b.unit()), ("a [2,7]", "Pa"), "{text}");
            assert_eq!(data.values(a, as_number, "").unwrap(), [1.5, -0.25], "{text}");
            assert_eq!(note.cell(1), Cell::Word("1,5,0"), "{text}");
        }
        // A thousand is written without a point.
        let data = read("t;a\n0;1\n1;1.000,5\n").unwrap();
        let refusal = data.values(&data.columns()[0], as_number, "a number").unwrap_err().to_string();
        assert_eq!(refusal, "line 3, a: expected a number, found \"1.000,5\"");
    }

    #[test]
    fn a_cell_means_what_its_reader_takes() {
        let data = read(
            "# by hand\nt,a,b,note,,\n#s,,,,,\n0,1,TRUE,start,,\n\n# later\n1,0.5,false,,,\n2,nan,0,,,\n",
        )
        .unwrap();
        let values = |name: &str, meaning: fn(Cell<'_>) -> Option<f64>| {
            let one = data.only(name).unwrap();
            one.values(&one.columns()[0], meaning, "this").map_err(|error| error.to_string())
        };
        assert_eq!(values("b", as_truth), Ok(vec![1.0, 0.0, 0.0]));
        for (name, meaning, message) in [
            ("a", as_number as fn(Cell<'_>) -> _, "line 8, a: expected this, found NaN"),
            ("a", as_truth, "line 7, a: expected this, found 0.5"),
            ("b", as_number, "line 4, b: expected this, found \"TRUE\""),
            ("note", as_number, "line 4, note: expected this, found \"start\""),
        ] {
            assert_eq!(values(name, meaning), Err(message.to_owned()));
        }
        let missing = data.only("nott").unwrap_err().to_string();
        assert_eq!(missing, "it has no column nott; did you mean note?; there are a, b, note");
    }

    /// Pandas writes such columns, with missing cells and other types.
    #[cfg(feature = "parquet")]
    #[test]
    fn a_column_of_parquet_may_be_of_any_type() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.Parquet");
        let column = |name: &str, cells| crate::TableColumn::new(&(name, "").into(), cells);
        let table = crate::Table(vec![
            column("t", crate::Cells::Numbers(&[0.0, 0.5])),
            column("a", crate::Cells::Number(vec![Some(1.0 / 3.0), Some(-1e-30)])),
            column("gap", crate::Cells::Number(vec![Some(1.0), None])),
            column("n", crate::Cells::Whole(vec![Some(-3), Some(4)])),
            column("on", crate::Cells::Truth(vec![Some(true), Some(false)])),
            column("note", crate::Cells::Text(vec![Some("up".to_owned()), None])),
        ]);
        table.write(crate::TableFormat::Parquet, fs::File::create(&path).unwrap()).unwrap();
        let data = Data::read(&path, None).unwrap();
        let values = |name: &str, meaning: fn(Cell<'_>) -> Option<f64>| {
            let one = data.only(name).unwrap();
            one.values(&one.columns()[0], meaning, "this").map_err(|error| error.to_string())
        };
        assert_eq!(values("a", as_number), Ok(vec![1.0 / 3.0, -1e-30]));
        assert_eq!(values("n", as_number), Ok(vec![-3.0, 4.0]));
        assert_eq!(values("on", as_truth), Ok(vec![1.0, 0.0]));
        assert_eq!(values("gap", as_number), Err("row 2, gap: expected this, found \"\"".to_owned()));
        assert_eq!(values("note", as_number), Err("row 1, note: expected this, found \"up\"".to_owned()));
    }

    #[test]
    fn files_without_a_course_are_refused() {
        for (text, reason) in [
            ("", "it has no columns"),
            ("t,a\n", "it has no rows"),
            ("t,a\n0,1\n-1,2\n", "line 3, t: the time decreases from 0 s to -1 s"),
            ("t,a\n0,1\nx,2\n", "line 3, t: expected a number, found \"x\""),
            ("t,a\ninf,1\n", "line 2, t: expected a number, found inf"),
            ("t,a,a (Pa)\n0,1,2\n", "two columns are named a"),
        ] {
            let refusal = read(text).unwrap_err();
            assert!(refusal.ends_with(&format!("a.csv: {reason}")), "{text}: {refusal}");
        }
    }
}
