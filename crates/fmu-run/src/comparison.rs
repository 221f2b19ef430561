//! Compares records: computes and draws the differences of each from the first.

use std::borrow::Cow;
use std::fmt::Write as _;

use anyhow::{Result, bail};
use fmu_terms::like;

use fmu_plot::{Cell, Figure, Line, Panel, Report, Table, color};
use fmu_record::numbers::quantity;
use fmu_record::{Column, Record};

/// Times closer than this are equal (s), since they are rounded multiples of a step.
const ROUNDING: f64 = 1e-9;

pub struct Comparison<'a> {
    records: &'a [(String, Record)],
    variables: Vec<Variable<'a>>,
    /// What cannot be compared, and why.
    pub notes: Vec<String>,
}

/// A variable common to all records.
struct Variable<'a> {
    /// The variable's name and units, without values.
    heading: Column,
    /// The variable's columns, in the order of the records.
    columns: Vec<&'a Column>,
    /// The differences of all records but the first.
    differences: Vec<Difference>,
}

/// A record's difference from the first, at the first's times. Other texts have none that is finite.
struct Difference {
    points: Vec<(f64, f64)>,
    /// The largest difference, with its time; none if the records are equal.
    greatest: Option<(f64, f64)>,
    root_mean_square: f64,
    /// The number of rows without a finite difference.
    undefined: usize,
}

impl<'a> Comparison<'a> {
    /// Compares named records in all variables or in some. A record has at least one row.
    pub fn new(records: &'a [(String, Record)], wanted: Option<&[String]>) -> Result<Self> {
        let [(first_name, first), others @ ..] = records else { bail!("no record to compare") };
        let mut notes = vec![];
        for (name, record) in others {
            let times = record.time();
            let common = counterparts(first.time(), times).flatten();
            match (common.count(), first.time().len()) {
                (0, _) => {
                    let range = |times: &[f64]| format!("{} s to {} s", times[0], times[times.len() - 1]);
                    bail!(
                        "{name} has none of the times of {first_name}: it covers {}, {first_name} {}",
                        range(times),
                        range(first.time())
                    );
                }
                (common, rows) if !has_times_of(record, first) => notes.push(format!(
                    "{name} and {first_name} have different times: {common} of {rows} rows of {first_name} are \
                     compared, interpolating {name} linearly"
                )),
                _ => {}
            }
        }
        let known = || first.columns().iter().map(|column| column.name.as_str());
        for name in wanted.into_iter().flatten() {
            if !known().any(|known| known == name) {
                bail!("{} has no variable {name}{}", records[0].0, like(name, known()));
            }
        }
        let mut variables = vec![];
        for column in first.columns() {
            if wanted.is_some_and(|wanted| !wanted.contains(&column.name)) {
                continue;
            }
            let find = |(_, record): &'a (String, Record)| {
                record.columns().iter().find(|other| other.name == column.name)
            };
            let columns: Vec<_> = records.iter().filter_map(find).collect();
            if columns.len() < records.len() {
                let missing = records.iter().filter(|record| find(record).is_none());
                let missing: Vec<_> = missing.map(|(name, _)| name.as_str()).collect();
                notes.push(format!("{} is not in {}", column.name, missing.join(", ")));
                continue;
            }
            let mut units: Vec<_> = columns.iter().map(|column| column.unit.as_str()).collect();
            units.retain(|unit| !unit.is_empty());
            units.dedup();
            if units.len() > 1 {
                notes.push(format!("{} is in different units: {}", column.name, units.join(", ")));
                continue;
            }
            let differences = others.iter().zip(&columns[1..]);
            // CSV files have no display units.
            let display_unit = columns.iter().find_map(|column| column.display_unit.clone());
            let heading = (column.name.clone(), units.first().copied().unwrap_or_default().to_owned());
            let is_text = columns.iter().any(|column| column.is_text);
            variables.push(Variable {
                heading: Column { display_unit, is_text, ..Column::from(heading) },
                differences: differences
                    .map(|((_, record), other)| Difference::new(first.time(), column, record.time(), other))
                    .collect(),
                columns,
            });
        }
        for (name, record) in others {
            let is_new = |column: &&Column| !known().any(|known| known == column.name);
            for column in record.columns().iter().filter(|_| wanted.is_none()).filter(is_new) {
                notes.push(format!("{} is only in {name}", column.name));
            }
        }
        if variables.is_empty() {
            bail!("the records have no variable in common");
        }
        Ok(Self { records, variables, notes })
    }

    /// The differences as a text.
    pub fn text(&self) -> String {
        let names = self.variables.iter().map(|variable| variable.heading.name.chars().count());
        let longest = names.max().unwrap_or(0);
        let mut text = String::new();
        for (index, (name, _)) in self.records[1..].iter().enumerate() {
            let _ = writeln!(text, "{name} minus {}:", self.records[0].0);
            for variable in &self.variables {
                let [greatest, time, root_mean_square, undefined] = variable.row(index);
                let more = match (time.as_str(), root_mean_square.as_str()) {
                    ("", _) => undefined,
                    (time, size) if undefined.is_empty() => format!("at {time:<9} {size} RMS"),
                    (time, size) => format!("at {time:<9} {size} RMS; {undefined}"),
                };
                let row = format!("  {:longest$}  {greatest:>14} {more}", variable.heading.name);
                let _ = writeln!(text, "{}", row.trim_end());
            }
        }
        text
    }

    /// The differences as tables.
    pub fn report(&self) -> Report {
        let mut report = Report::default();
        for (index, (name, _)) in self.records[1..].iter().enumerate() {
            report.section(&format!("{name} minus {}", self.records[0].0));
            let mut table = Table::new(["Variable", "Largest difference", "At", "RMS", ""]);
            for variable in &self.variables {
                let cells = variable.row(index).map(|cell| Cell::number(&cell));
                table.row([variable.heading.name.as_str().into()].into_iter().chain(cells));
            }
            report.table(&table);
        }
        for note in &self.notes {
            report.paragraph(note);
        }
        report
    }

    /// For each variable of numbers that differs, a panel with all records next to one with the differences; the names of
    /// the equal ones in a text below.
    pub fn draw(&self) -> Figure {
        let title = self.records.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        let colors = || color::CYCLE.iter().cycle().copied();
        let held = |line: Line, variable: &Variable<'_>| if variable.is_held() { line.held() } else { line };
        let row = |variable: &Variable<'_>| {
            let size = variable.columns.iter().flat_map(|column| &column.values);
            let size = size.map(|value| value.abs()).filter(|value| value.is_finite()).fold(0.0, f64::max);
            let (unit, shown) = variable.heading.scale(size);
            let lines = self.records.iter().zip(&variable.columns).zip(colors());
            let lines = lines.map(|(((name, record), column), color)| {
                let line = Line::new(record.time(), column.values.iter().map(|value| shown.apply(*value)));
                held(line, variable).label(name).color(color)
            });
            let both = Panel::new("time (s)", &unit).title(&variable.heading.name).height(130);
            let size = variable.differences.iter().filter_map(|difference| difference.greatest);
            let size = size.fold(0.0, |most, (value, _)| value.abs().max(most));
            let (unit, shown) = variable.heading.of_differences().scale(size);
            let differences = self.records[1..].iter().zip(&variable.differences).zip(colors().skip(1));
            let differences = differences.map(|(((name, _), difference), color)| {
                let (time, values): (Vec<_>, Vec<_>) = difference.points.iter().copied().unzip();
                let label = format!("{name} minus {}", self.records[0].0);
                let line = Line::new(&time, values.into_iter().map(|value| shown.apply(value)));
                held(line, variable).label(&label).color(color)
            });
            let apart = Panel::new("time (s)", &unit).title("difference").height(130);
            [lines.fold(both, Panel::line), differences.fold(apart, Panel::line)]
        };
        let numbers = self.variables.iter().filter(|variable| !variable.heading.is_text);
        let (equal, drawn): (Vec<_>, Vec<_>) = numbers.partition(|variable| variable.is_equal());
        let names =
            equal.iter().map(|variable| variable.heading.name.as_str()).collect::<Vec<_>>().join(", ");
        let note = if names.is_empty() { names } else { format!("Equal: {names}") };
        drawn.into_iter().map(row).fold(Figure::new().title(&title).note(&note), Figure::row).shared_x()
    }
}

impl Variable<'_> {
    /// Whether all records have the same values.
    fn is_equal(&self) -> bool {
        self.differences.iter().all(|difference| difference.greatest.is_none() && difference.undefined == 0)
    }

    /// Whether its values hold until the next: it is declared discrete, or it is a Boolean, which files have as 0 and 1.
    fn is_held(&self) -> bool {
        let is_truth = |column: &Column| column.values.iter().all(|value| [0.0, 1.0].contains(value));
        self.columns.iter().all(|column| column.is_discrete || is_truth(column))
    }

    /// A record's largest difference, its time, the root mean square, and where there is no finite difference.
    fn row(&self, record: usize) -> [String; 4] {
        let Difference { points, greatest, root_mean_square, undefined } = &self.differences[record];
        let undefined = match undefined {
            0 => String::new(),
            rows if self.heading.is_text => {
                let mut others = points.iter().filter(|(_, difference)| difference.is_nan());
                let first = others.next().map(|(time, _)| quantity(*time, "s")).unwrap_or_default();
                format!("other texts in {rows} rows, from {first} on")
            }
            rows => format!("no finite difference in {rows} rows"),
        };
        let column = self.heading.of_differences();
        let Some((value, time)) = greatest else {
            let word = if undefined.is_empty() { "equal" } else { "unequal" };
            return [word.to_owned(), String::new(), String::new(), undefined];
        };
        [column.text(*value), quantity(*time, "s"), column.text(*root_mean_square), undefined]
    }
}

impl Difference {
    fn new(times: &[f64], first: &Column, other_times: &[f64], other: &Column) -> Self {
        let mut points = vec![];
        let mut undefined = 0;
        let counterparts = counterparts(times, other_times);
        for ((&time, &value), counterpart) in times.iter().zip(&first.values).zip(counterparts) {
            let Some(place) = counterpart else { continue };
            let difference = if first.is_text || other.is_text {
                let is_same = text(first, value) == text(other, other.values[place.row()]);
                if is_same { 0.0 } else { f64::NAN }
            } else {
                let counterpart = place.value(&other.values);
                let is_same =
                    value.to_bits() == counterpart.to_bits() || value.is_nan() && counterpart.is_nan();
                if is_same { 0.0 } else { counterpart - value }
            };
            undefined += usize::from(!difference.is_finite());
            points.push((time, difference));
        }
        let finite = || points.iter().filter(|(_, difference)| difference.is_finite());
        let greatest = finite().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let greatest =
            greatest.filter(|(_, difference)| *difference != 0.0).map(|&(time, value)| (value, time));
        // Scaled, because the squares of the largest numbers overflow.
        let size = greatest.map_or(1.0, |(value, _)| value.abs());
        let squares: f64 = finite().map(|(_, difference)| (difference / size).powi(2)).sum();
        let root_mean_square = size * (squares / finite().count().max(1) as f64).sqrt();
        Self { points, greatest, root_mean_square, undefined }
    }
}

/// A value as a text, as records of texts are read: a number without superfluous digits.
fn text(column: &Column, value: f64) -> Cow<'_, str> {
    column.item(value).map_or_else(|| value.to_string().into(), Cow::from)
}

/// Where in a record a time is: at a row, or after one by a share of the time to the next.
#[derive(Clone, Copy)]
enum Place {
    At(usize),
    After(usize, f64),
}

impl Place {
    /// The last row until the place.
    fn row(self) -> usize {
        let (Self::At(row) | Self::After(row, _)) = self;
        row
    }

    /// The value at the place, interpolated linearly.
    fn value(self, values: &[f64]) -> f64 {
        match self {
            Self::At(row) => values[row],
            Self::After(row, share) => values[row] + share * (values[row + 1] - values[row]),
        }
    }
}

/// The places of ascending times in a record; none outside. The rows of a jump are each other's, the last ones first, so
/// that a single row is what follows a jump.
fn counterparts(times: &[f64], others: &[f64]) -> impl Iterator<Item = Option<Place>> {
    let until = |times: &[f64], from: usize, time: f64| {
        from + times[from..].iter().take_while(|known| **known <= time + ROUNDING).count()
    };
    let [mut own_end, mut end] = [0, 0];
    times.iter().enumerate().map(move |(row, &time)| {
        own_end = until(times, own_end, time);
        end = until(others, end, time);
        let last = end.checked_sub(1)?;
        let first = others[..end].iter().rev().take_while(|known| **known >= time - ROUNDING).count();
        if first > 0 {
            return Some(Place::At((last + 1 + row).saturating_sub(own_end).max(end - first)));
        }
        let after = others.get(end)?;
        Some(Place::After(last, (time - others[last]) / (after - others[last])))
    })
}

fn has_times_of(one: &Record, other: &Record) -> bool {
    one.time().len() == other.time().len()
        && one.time().iter().zip(other.time()).all(|(a, b)| (a - b).abs() <= ROUNDING)
}

#[cfg(test)]
mod tests {
    use fmu_terms::DisplayUnit;

    use super::*;

    fn record(name: &str, unit: &str, rows: &[(f64, f64)]) -> (String, Record) {
        let mut record =
            Record::new([("p".to_owned(), unit.to_owned()), (format!("own_{name}"), String::new())]);
        for &(time, value) in rows {
            record.push(time, &[value, 0.0]);
        }
        (name.to_owned(), record)
    }

    #[test]
    fn differences_have_sign_time_and_unit() {
        let records = [
            record("a", "Pa", &[(0.0, 1e5), (1.0, 1e5), (2.0, 1e5), (3.0, f64::NAN)]),
            record("b", "", &[(0.0, 1e5), (1.0, 1e5 - 3e4), (2.0, 1e5 + 4.0), (3.0, 1.0)]),
        ];
        let comparison = Comparison::new(&records, None).unwrap();
        let text = comparison.text();
        assert!(text.starts_with("b minus a:\n  p  "), "{text}");
        // The root of (30000² + 4²) / 3.
        for part in ["\u{2212}30\u{202f}kPa at 1\u{202f}s", "17.3\u{202f}kPa RMS; no finite", "in 1 rows"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(comparison.notes, ["own_a is not in b", "own_b is only in b"]);
        assert!(comparison.report().page("").contains("<td class=\"number\">\u{2212}30\u{202f}kPa</td>"));
        let html = comparison.draw().html();
        assert_eq!(html.matches("class=\"panel\"").count(), 2);
        assert!(html.contains("\"y\":[0.0,-30.0,0.004"), "{html}");
    }

    /// One of the records declares the display unit.
    #[test]
    fn temperatures_are_in_celsius_and_their_differences_in_kelvin() {
        let celsius = DisplayUnit { name: "degC".to_owned(), factor: 1.0, offset: -273.15 };
        let declared = Column { display_unit: Some(celsius), ..Column::from(("t", "K")) };
        let mut records = [Column::from(("t", "K")), declared].map(|column| Record::new([column]));
        records[0].push(0.0, &[300.0]);
        records[1].push(0.0, &[302.5]);
        let [one, other] = records.map(|record| ("a".to_owned(), record));
        let records = [one, other];
        let comparison = Comparison::new(&records, None).unwrap();
        assert!(comparison.text().contains(" 2.5\u{202f}K at 0\u{202f}s "), "{}", comparison.text());
        let html = comparison.draw().html();
        assert!(html.contains("\"y\":[26.85]") && html.contains("\"y\":[2.5]"), "{html}");
    }

    #[test]
    fn records_of_different_times_are_compared_where_both_are() {
        let records = [
            record("a", "m", &[(0.0, 0.0), (0.5, 1.0), (1.0 - 1e-12, 2.0), (5.0, 9.0)]),
            record("b", "m", &[(-1.0, -2.0), (1.0, 2.0), (2.0, 4.0)]),
        ];
        let comparison = Comparison::new(&records, Some(&["p".to_owned()])).unwrap();
        assert!(comparison.text().contains("equal"), "{}", comparison.text());
        assert_eq!(comparison.variables[0].differences[0].points.len(), 3);
        assert!(comparison.notes[0].contains("different times"));
    }

    /// One of the records has only texts that are numbers.
    #[test]
    fn texts_are_compared_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, cells: [&str; 3]| {
            let path = folder.path().join("a.csv");
            let [a, b, c] = cells;
            std::fs::write(&path, format!("time,p\n0,{a}\n1,{b}\n2,\"{c}\"\n")).unwrap();
            (name.to_owned(), Record::read(&path).unwrap())
        };
        let records = [
            read("a", ["off", "7", "on, \u{b0}"]),
            read("b", ["off", "7.0", "on, \u{b0}"]),
            read("c", ["7", "7", "7"]),
        ];
        assert_eq!(records[0].1.columns()[0].items[2].0, "on, \u{b0}");
        let comparison = Comparison::new(&records, None).unwrap();
        let text = comparison.text();
        assert!(text.contains("b minus a:\n  p           equal\n"), "{text}");
        assert!(text.contains("unequal other texts in 2 rows, from 0\u{202f}s on\n"), "{text}");
        assert_eq!(comparison.draw().html().matches("class=\"panel\"").count(), 0);
    }

    /// As at an event, before and after it; without the first row it is what follows.
    #[test]
    fn jumps_are_compared_on_both_sides() {
        let jump = [(0.0, 0.0), (1.0, 1.0), (1.0, 5.0), (2.0, 6.0)];
        let [mut late, single] = [jump, jump].map(|rows| rows.to_vec());
        late[1].1 = 3.0;
        let single = [single[0], single[2], single[3]];
        for (a, b, differences) in [
            (&jump[..], &jump[..], &[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (2.0, 0.0)][..]),
            (&jump, &late, &[(0.0, 0.0), (1.0, 2.0), (1.0, 0.0), (2.0, 0.0)]),
            (&single, &jump, &[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]),
            (&jump, &single, &[(0.0, 0.0), (1.0, 4.0), (1.0, 0.0), (2.0, 0.0)]),
            // Between the rows of the other there is a line.
            (&[(0.5, 0.5), (0.5, 9.0), (1.5, 5.5)], &jump, &[(0.5, 0.0), (0.5, -8.5), (1.5, 0.0)]),
        ] {
            let records = [record("a", "m", a), record("b", "m", b)];
            let comparison = Comparison::new(&records, Some(&["p".to_owned()])).unwrap();
            assert_eq!(comparison.variables[0].differences[0].points, differences, "{a:?} and {b:?}");
        }
    }

    /// What is equal is named, not drawn; a Boolean is drawn in steps, and no unit has a prefix from the axis.
    #[test]
    fn only_what_differs_is_drawn_and_booleans_in_steps() {
        let record = |pump: [f64; 3], duty: [f64; 3]| {
            let mut record = Record::new([("pump", ""), ("duty", "%"), ("code", ""), ("undefined", "")]);
            for row in 0..3_u8 {
                let index = usize::from(row);
                record.push(f64::from(row), &[pump[index], duty[index], 3.0, f64::NAN]);
            }
            record
        };
        let records = [
            ("a".to_owned(), record([0.0, 1.0, 1.0], [40.0, 41.0, 40.0])),
            ("b".to_owned(), record([0.0, 0.0, 1.0], [40.0, 41.0 - 2e-5, 40.0])),
        ];
        let html = Comparison::new(&records, None).unwrap().draw().html();
        assert_eq!(html.matches("class=\"panel\"").count(), 4, "{html}");
        assert!(html.contains("<p class=\"caption\">Equal: code, undefined</p>"), "{html}");
        // The pump in both records, and its difference.
        assert_eq!(html.matches("\"shape\":\"hv\"").count(), 3, "{html}");
        assert_eq!(html.matches("\"exponentformat\":\"e\"").count(), 8, "{html}");
    }

    #[test]
    fn records_without_common_times_are_not_equal() {
        let refusal = |a: &[(f64, f64)], b: &[(f64, f64)]| {
            let records = [record("a", "m", a), record("b", "m", b)];
            Comparison::new(&records, None).err().unwrap().to_string()
        };
        let rows = [(0.0, 1.0), (1.0, 1.0)];
        assert_eq!(
            refusal(&rows, &[(2.0, 1.0), (3.5, 1.0)]),
            "b has none of the times of a: it covers 2 s to 3.5 s, a 0 s to 1 s"
        );
        assert!(refusal(&rows, &[(0.25, 1.0), (0.75, 1.0)]).starts_with("b has none of the times of a"));
        // One row of two.
        let records = [record("a", "m", &rows), record("b", "m", &[(1.0, 1.0), (2.0, 1.0)])];
        let notes = Comparison::new(&records, None).unwrap().notes;
        assert!(notes[0].contains("1 of 2 rows of a are compared"), "{notes:?}");
    }

    /// The squares and largest differences of these numbers overflow.
    #[test]
    fn the_greatest_numbers_are_compared() {
        let text = |a: f64, b: f64| {
            let records = [record("a", "m", &[(0.0, a)]), record("b", "m", &[(0.0, b)])];
            Comparison::new(&records, None).unwrap().text()
        };
        let half = text(0.0, 1e308);
        assert_eq!(half.matches("1.0\u{b7}10\u{b3}\u{2070}\u{2078}").count(), 2, "{half}");
        for text in [text(-1e308, 1e308), text(f64::NAN, 1.0)] {
            assert!(text.contains("unequal") && text.contains("no finite difference in 1 rows"), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_compared_is_named() {
        let records = [record("a", "Pa", &[(0.0, 1.0)]), record("b", "kPa", &[(0.0, 1.0)])];
        let refusal =
            |wanted: Option<&[String]>| Comparison::new(&records, wanted).err().unwrap().to_string();
        assert_eq!(refusal(None), "the records have no variable in common");
        assert_eq!(refusal(Some(&["own_b".to_owned()])), "a has no variable own_b; did you mean own_a?");
    }
}
