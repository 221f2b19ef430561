//! The plot of a record: which variables share a panel, and how each is drawn.

use fmu_record::numbers;
use fmu_record::{Column, Record};

use crate::figure::{Figure, Line, Panel, color};

/// Quantities of one unit share a panel up to this ratio of their largest values.
const LIKE_SIZE: f64 = 10.0;
/// A panel has at most one line of each colour.
const MOST_LINES: usize = color::CYCLE.len();
/// Words that mark a variable as the reference of those whose names begin with the preceding words.
const REFERENCES: [&str; 4] = ["reference", "setpoint", "target", "desired"];

/// The record over time. `panels` are the names in each panel; names that are not recorded are ignored. By default,
/// quantities of one unit and of like size are together, and a reference is with what follows it.
pub fn draw(record: &Record, title: &str, panels: Option<&[Vec<String>]>) -> Figure {
    let panels = match panels {
        Some(panels) => {
            let column = |name: &String| record.columns().iter().find(|column| column.name == *name);
            panels.iter().map(|names| names.iter().filter_map(column).collect()).collect()
        }
        None => together(record.columns()),
    };
    let panel = |columns: &Vec<&Column>| [panel(record.time(), columns)];
    panels.iter().map(panel).fold(Figure::new().title(title), Figure::row).shared_x()
}

fn together(columns: &[Column]) -> Vec<Vec<&Column>> {
    let mut panels: Vec<Vec<&Column>> = vec![];
    for column in columns {
        let has_room = |panel: &Vec<&Column>| panel[0].unit == column.unit && panel.len() < MOST_LINES;
        let is_pair = |other: &&Column| leads(&column.name, &other.name) || leads(&other.name, &column.name);
        let pair = panels.iter().position(|panel| has_room(panel) && panel.iter().any(is_pair));
        let home = pair.or_else(|| {
            let is_like = |other: &&Column| are_like(size(column), size(other));
            panels.iter().position(|panel| has_room(panel) && panel.iter().all(is_like))
        });
        match home {
            Some(index) => panels[index].push(column),
            None => panels.push(vec![column]),
        }
    }
    panels
}

/// The words before the one that makes a name a reference.
fn stem(name: &str) -> Option<&str> {
    let parts = REFERENCES.iter().filter_map(|word| name.split_once(&format!("_{word}")));
    parts.map(|(stem, _)| stem).next()
}

/// Whether a variable is the reference of another.
fn leads(reference: &str, name: &str) -> bool {
    let is_led =
        |stem: &str| name.strip_prefix(stem).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    stem(reference).is_some_and(is_led) && stem(name).is_none()
}

/// The greatest finite magnitude.
fn size(column: &Column) -> f64 {
    column.values.iter().map(|value| value.abs()).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

fn are_like(one: f64, other: f64) -> bool {
    one.min(other) == 0.0 || one.max(other) <= LIKE_SIZE * one.min(other)
}

fn panel(time: &[f64], columns: &[&Column]) -> Panel {
    let shown: Vec<_> = columns.iter().map(|column| shown(&column.unit, size(column))).collect();
    let has_one_unit = shown.windows(2).all(|pair| pair[0] == pair[1]);
    let label = shown.first().filter(|_| has_one_unit).map_or("", |(unit, _)| unit);
    let mut colors = color::CYCLE.iter().cycle();
    let mut lines = vec![];
    for (column, (unit, factor)) in columns.iter().zip(&shown) {
        let is_reference = columns.iter().any(|other| leads(&column.name, &other.name));
        let label = match unit.as_str() {
            unit if !has_one_unit && !unit.is_empty() => format!("{} ({unit})", column.name),
            _ => column.name.clone(),
        };
        let line = Line::new(time, column.values.iter().map(|value| factor * value));
        let line = line.label(&label).source(&column.name, *factor);
        if is_reference {
            lines.insert(0, line.color(color::INK).thin());
        } else if let Some(&color) = colors.next() {
            lines.push(line.color(color));
        }
    }
    // A picture's legend is inside the frame.
    let height = 130.max(60 + 20 * u32::try_from(lines.len()).unwrap_or(u32::MAX / 32));
    lines.into_iter().fold(Panel::new("time (s)", label).height(height), Panel::line)
}

/// The unit in which values up to a size are plotted, and the factor to it: that of [`numbers::shown`], but kPa from 1
/// kPa on.
#[must_use]
pub fn shown(unit: &str, size: f64) -> (String, f64) {
    match unit {
        "Pa" if (1e3..1e4).contains(&size) => ("kPa".to_owned(), 1e-3),
        other => numbers::shown(other, size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(columns: &[(&str, &str, f64)]) -> Record {
        let mut record = Record::new(columns.iter().map(|(name, unit, _)| ((*name).into(), (*unit).into())));
        record.push(0.0, &columns.iter().map(|(_, _, value)| *value).collect::<Vec<_>>());
        record
    }

    fn names(columns: &[(&str, &str, f64)]) -> Vec<Vec<String>> {
        let record = record(columns);
        let panels = together(record.columns());
        panels.iter().map(|panel| panel.iter().map(|column| column.name.clone()).collect()).collect()
    }

    #[test]
    fn quantities_of_one_unit_and_like_size_are_together() {
        let columns = [
            ("boost_pressure", "Pa", 150e3),
            ("hp_wastegate_pwm", "%", 40.0),
            ("actuator_pressure", "Pa", -60e3),
            ("pressure_noise", "Pa", 10.0),
            ("pulse", "%", 0.0),
        ];
        assert_eq!(
            names(&columns),
            [
                ["boost_pressure", "actuator_pressure"].as_slice(),
                &["hp_wastegate_pwm", "pulse"],
                &["pressure_noise"]
            ]
        );
    }

    #[test]
    fn a_reference_is_with_what_follows_it_whatever_its_size() {
        let columns = [
            ("level", "m", 100.0),
            ("boost_reference", "Pa", 1.0),
            ("tank_pressure", "Pa", 150e3),
            ("boost_pressure", "Pa", 150e3),
        ];
        assert_eq!(
            names(&columns),
            [["level"].as_slice(), &["boost_reference", "boost_pressure"], &["tank_pressure"]]
        );
        assert!(leads("boost_reference", "boost_pressure") && leads("speed_setpoint", "speed"));
        assert!(!leads("boost_reference", "boosted") && !leads("boost_pressure", "boost_reference"));
    }

    #[test]
    fn a_panel_does_not_repeat_a_colour() {
        let names: Vec<_> = (0..20).map(|index| format!("x{index}")).collect();
        let columns: Vec<_> = names.iter().map(|name| (name.as_str(), "m", 1.0)).collect();
        let lengths: Vec<_> = self::names(&columns).iter().map(Vec::len).collect();
        assert_eq!(lengths, [6, 6, 6, 2]);
    }

    /// For pages that draw further points: the variable of each line, and the factor to the axis' unit.
    #[cfg(feature = "html")]
    #[test]
    fn lines_name_their_variables_without_points() {
        let record = record(&[("boost_pressure", "Pa", 2000.0), ("duty", "%", 40.0)]);
        let html = draw(&record, "", None).without_points().html();
        for meta in ["\"meta\":\"0.001 boost_pressure\"", "\"meta\":\"1.0 duty\""] {
            assert!(html.contains(meta), "{html}");
        }
        assert_eq!(html.matches("\"y\":[]").count(), 2, "{html}");
        assert!(html.contains("kPa"));
    }

    /// What is drawn: names, the axis' unit and values in it.
    #[cfg(feature = "html")]
    #[test]
    fn panels_are_drawn_as_the_scenario_says() {
        let record = record(&[("a", "Pa", 2000.0), ("b", "Pa", 3000.0), ("c", "V", 12.0)]);
        let html = draw(&record, "", Some(&[vec!["c".to_owned()], vec!["b".to_owned()]])).html();
        assert!(
            html.contains("\"y\":[3.0]") && html.contains("kPa") && !html.contains("\"y\":[2.0]"),
            "{html}"
        );
        assert!(html.find("</span>c</label>").unwrap() < html.find("</span>b</label>").unwrap());
        let mixed = draw(&record, "", Some(&[vec!["a".to_owned(), "c".to_owned()]])).html();
        assert!(
            mixed.contains("</span>a (kPa)</label>") && mixed.contains("</span>c (V)</label>"),
            "{mixed}"
        );
    }
}
