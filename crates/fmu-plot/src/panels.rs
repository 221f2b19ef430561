//! The plot of a record: which variables share a panel, and how each is drawn.

use std::collections::HashSet;

use fmu_record::{Column, Record};

use crate::figure::{self, Figure, Lane, Line, Panel, color, labelled};

/// Lines share a panel if each uses at least this part of its scale.
const LEAST_SHARE: f64 = 1.0 / 3.0;
/// A panel has at most one line of each colour.
const MOST_LINES: usize = color::CYCLE.len();
/// A number with more values is drawn as a line.
const MOST_STATES: usize = 16;
/// Words that mark a variable as the reference of those whose names begin with the preceding words.
const REFERENCES: [&str; 4] = ["reference", "setpoint", "target", "desired"];

/// The record over time. `panels` are the names in each panel; names that are not recorded are ignored. By default,
/// variables with the same unit and a similar range share a panel, a reference is drawn with the variable that tracks
/// it, and constants are listed in a text below. Booleans, enumerations, texts and codes are lanes.
pub fn draw(record: &Record, title: &str, panels: Option<&[Vec<String>]>) -> Figure {
    let (panels, constants) = grouped(record, panels);
    let constants = constants.iter().map(|column| {
        let value = column.values.iter().find(|value| value.is_finite());
        format!("{} {}", column.name, value.map_or_else(String::new, |value| column.text(*value)))
    });
    let constants = constants.collect::<Vec<_>>().join(", ");
    let note = if constants.is_empty() { constants } else { format!("Constant: {constants}") };
    let panel = |columns: &Vec<&Column>| {
        let has_states = columns.iter().all(|column| has_states(column));
        [if has_states { lanes(record.time(), columns) } else { panel(record.time(), columns) }]
    };
    panels.iter().map(panel).fold(Figure::new().title(title).note(&note), Figure::row).shared_x()
}

/// The panels of a record without its points, for a page whose script adds them; see [`Line::source`].
pub fn template(record: &Record, title: &str, panels: Option<&[Vec<String>]>) -> Figure {
    let panel = |columns: &Vec<&Column>| [panel(record.time(), columns)];
    let figure = Figure::new().title(title).shared_x();
    grouped(record, panels).0.iter().map(panel).fold(figure, Figure::row).without_points()
}

/// The columns of each panel, and the constant ones that are in none.
fn grouped<'a>(
    record: &'a Record,
    panels: Option<&[Vec<String>]>,
) -> (Vec<Vec<&'a Column>>, Vec<&'a Column>) {
    let Some(panels) = panels else { return together(record.columns()) };
    let column = |name: &String| record.columns().iter().find(|column| column.name == *name);
    (panels.iter().map(|names| names.iter().filter_map(column).collect()).collect(), vec![])
}

/// The default panels and lanes.
fn together(columns: &[Column]) -> (Vec<Vec<&Column>>, Vec<&Column>) {
    let is_pair =
        |one: &Column, other: &Column| leads(&one.name, &other.name) || leads(&other.name, &one.name);
    let changes = |column: &Column| {
        let (least, most) = range([column]);
        most - least > SAME * least.abs().max(most.abs())
    };
    let is_drawn = |column: &&Column| {
        changes(column) || columns.iter().any(|other| is_pair(column, other) && changes(other))
    };
    let (drawn, constants): (Vec<_>, Vec<_>) = columns.iter().partition(is_drawn);
    let (lanes, lines): (Vec<_>, Vec<_>) = drawn.into_iter().partition(|column| has_states(column));
    let width = |columns: &[&Column]| {
        let (least, most) = range(columns.iter().copied());
        most - least
    };
    let mut panels: Vec<Vec<&Column>> = vec![];
    for column in lines {
        let has_room = |panel: &[&Column]| {
            let [one, other] = [panel[0], column].map(|column| (&column.unit, &column.display_unit));
            one == other && panel.len() < MOST_LINES
        };
        let has_pair = |panel: &[&Column]| panel.iter().any(|other| is_pair(column, other));
        let suits = |panel: &[&Column]| {
            let all = [panel, &[column]].concat();
            all.iter().all(|line| width(&[line]) >= LEAST_SHARE * width(&all))
        };
        let home = panels.iter().position(|panel| has_room(panel) && has_pair(panel));
        match home.or_else(|| panels.iter().position(|panel| has_room(panel) && suits(panel))) {
            Some(index) => panels[index].push(column),
            None => panels.push(vec![column]),
        }
    }
    panels.extend((!lanes.is_empty()).then_some(lanes));
    (panels, constants)
}

/// A change below this fraction of the size is rounding.
const SAME: f64 = 1e-6;

/// The smallest and the largest finite value.
fn range<'a>(columns: impl IntoIterator<Item = &'a Column>) -> (f64, f64) {
    figure::range(columns.into_iter().flat_map(|column| &column.values).copied())
}

/// Whether a variable has states rather than amounts: a Boolean, an enumeration, texts, or a code of a few whole numbers.
fn has_states(column: &Column) -> bool {
    let is_code = || {
        let has_unit = !matches!(column.unit.as_str(), "" | "1") || column.display_unit.is_some();
        if has_unit || !column.is_discrete {
            return false;
        }
        let states: HashSet<_> = column.values.iter().map(|value| value.to_bits()).collect();
        states.len() <= MOST_STATES && column.values.iter().all(|value| value.fract() == 0.0)
    };
    !column.items.is_empty() || is_code()
}

fn lanes(time: &[f64], columns: &[&Column]) -> Panel {
    let lane = |column: &&Column| {
        let texts: Vec<_> = column.values.iter().map(|value| column.text(*value)).collect();
        let is_switch = !column.is_text && column.values.iter().all(|value| [0.0, 1.0].contains(value));
        let states = time.iter().zip(&column.values).zip(&texts);
        let states = states.map(|((&time, &value), text)| (time, text.as_str(), is_switch && value == 0.0));
        Lane::new(&column.name, states)
    };
    let range = (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(1.0));
    Panel::of_lanes("time (s)", columns.iter().map(lane).collect()).x_range(range.0, range.1)
}

/// The words before the one that makes a name a reference.
fn stem(name: &str) -> Option<&str> {
    REFERENCES.iter().find_map(|word| Some(name.split_once(&format!("_{word}"))?.0))
}

/// Whether a variable is the reference of another.
fn leads(reference: &str, name: &str) -> bool {
    let is_led =
        |stem: &str| name.strip_prefix(stem).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    stem(reference).is_some_and(is_led) && stem(name).is_none()
}

/// The greatest finite magnitude.
fn size(columns: &[&Column]) -> f64 {
    let (least, most) = range(columns.iter().copied());
    if least <= most { least.abs().max(most.abs()) } else { 0.0 }
}

fn panel(time: &[f64], columns: &[&Column]) -> Panel {
    // The display unit that some of one unit declare is that of all: openings from 0 to 1 beside a position in %.
    let declares = |column: &&&Column| column.display_unit.is_some();
    let leader = columns.iter().find(declares).or(columns.first());
    let of_one_unit = leader.map(|leader| leader.scale(size(columns)));
    let has_one_unit = columns.windows(2).all(|pair| pair[0].unit == pair[1].unit)
        && columns.iter().filter(declares).all(|column| Some(column.scale(0.0)) == of_one_unit);
    let own = |column: &&Column| column.scale(size(&[column]));
    let scales: Vec<_> = match of_one_unit {
        Some(scale) if has_one_unit => vec![scale; columns.len()],
        _ => columns.iter().map(own).collect(),
    };
    let label = scales.first().filter(|_| has_one_unit).map_or("", |(unit, _)| unit);
    let mut colors = color::CYCLE.iter().cycle();
    let mut lines = vec![];
    for (column, (unit, function)) in columns.iter().zip(&scales) {
        let is_reference = columns.iter().any(|other| leads(&column.name, &other.name));
        let label = labelled(&column.name, if has_one_unit { "" } else { unit });
        let line = Line::new(time, column.values.iter().map(|value| function.apply(*value)));
        let line = line.label(&label).source(&column.name, *function);
        let line = if column.is_discrete { line.held() } else { line };
        if is_reference {
            lines.insert(0, line.color(color::INK).thin());
        } else if let Some(&color) = colors.next() {
            lines.push(line.color(color));
        }
    }
    // A picture's legend is beside the frame.
    let height = 130.max(60 + 20 * u32::try_from(lines.len()).unwrap_or(u32::MAX / 32));
    lines.into_iter().fold(Panel::new("time (s)", label).height(height), Panel::line)
}

#[cfg(test)]
mod tests {
    use fmu_terms::DisplayUnit;

    use super::*;

    /// Columns with a first and a last value.
    fn record(columns: &[(&str, &str, [f64; 2])]) -> Record {
        let mut record = Record::new(columns.iter().map(|(name, unit, _)| (*name, *unit)));
        for row in 0..2_u8 {
            let values: Vec<_> = columns.iter().map(|(_, _, values)| values[usize::from(row)]).collect();
            record.push(f64::from(row), &values);
        }
        record
    }

    fn names(record: &Record) -> (Vec<Vec<&str>>, Vec<&str>) {
        fn names<'a>(columns: &[&'a Column]) -> Vec<&'a str> {
            columns.iter().map(|column| column.name.as_str()).collect()
        }
        let (panels, constants) = together(record.columns());
        (panels.iter().map(|panel| names(panel)).collect(), names(&constants))
    }

    #[test]
    fn lines_share_a_panel_if_each_uses_a_third_of_it() {
        let record = record(&[
            ("boost_pressure", "Pa", [120e3, 210e3]),
            ("hp_wastegate_pwm", "%", [40.0, 60.0]),
            ("manifold_pressure", "Pa", [118e3, 160e3]),
            ("tank_pressure", "Pa", [32e3, 35e3]),
            // 29 of 90 and 120 kPa.
            ("outlet_pressure", "Pa", [101e3, 130e3]),
            ("ambient_pressure", "Pa", [101e3, 101e3]),
            ("pulse", "%", [0.0, f64::NAN]),
        ]);
        let (panels, constants) = names(&record);
        assert_eq!(
            panels,
            [
                ["boost_pressure", "manifold_pressure"].as_slice(),
                &["hp_wastegate_pwm"],
                &["tank_pressure"],
                &["outlet_pressure"],
            ]
        );
        assert_eq!(constants, ["ambient_pressure", "pulse"]);
    }

    #[test]
    fn a_reference_is_with_what_follows_it_whatever_its_range() {
        let record = record(&[
            ("level", "m", [0.0, 100.0]),
            ("boost_reference", "Pa", [1.0, 1.0]),
            ("tank_pressure", "Pa", [0.0, 150e3]),
            ("boost_pressure", "Pa", [0.0, 150e3]),
        ]);
        let (panels, constants) = names(&record);
        assert_eq!(
            panels,
            [["level"].as_slice(), &["boost_reference", "boost_pressure"], &["tank_pressure"]]
        );
        assert!(constants.is_empty());
        assert!(leads("boost_reference", "boost_pressure") && leads("speed_setpoint", "speed"));
        assert!(!leads("boost_reference", "boosted") && !leads("boost_pressure", "boost_reference"));
    }

    #[test]
    fn a_panel_does_not_repeat_a_colour() {
        let names: Vec<_> = (0..20).map(|index| format!("x{index}")).collect();
        let columns: Vec<_> = names.iter().map(|name| (name.as_str(), "m", [0.0, 1.0])).collect();
        let lengths: Vec<_> = self::names(&record(&columns)).0.iter().map(Vec::len).collect();
        assert_eq!(lengths, [6, 6, 6, 2]);
    }

    /// A record of a valve, a temperature and what has states, as FMUs declare them.
    fn declared() -> Record {
        let display =
            |name: &str, factor, offset| Some(DisplayUnit { name: name.to_owned(), factor, offset });
        let mut record = Record::new([
            Column { display_unit: display("%", 100.0, 0.0), ..Column::from(("valve", "1")) },
            Column { display_unit: display("degC", 1.0, -273.15), ..Column::from(("temperature", "K")) },
            Column {
                items: vec![("off".to_owned(), 1), ("cranking".to_owned(), 2)],
                ..Column::from(("mode", ""))
            },
            Column { is_discrete: true, ..Column::from(("fault_code", "1")) },
            Column { is_discrete: true, ..Column::from(("pwm", "%")) },
            Column { display_unit: display("%", 100.0, 0.0), ..Column::from(("throttle", "1")) },
        ]);
        record.push(0.0, &[0.0, 298.15, 1.0, 0.0, 40.0, 0.5]);
        record.push(0.5, &[0.0, 298.15, 2.0, 4.0, 41.0, 0.5]);
        record.push(1.0, &[1.0, 300.0, 2.0, 4.0, 45.0, 0.5]);
        record
    }

    #[test]
    fn states_are_lanes_and_what_does_not_change_is_a_text() {
        let record = declared();
        let (panels, constants) = names(&record);
        assert_eq!(panels, [["valve"].as_slice(), &["temperature"], &["pwm"], &["mode", "fault_code"]]);
        assert_eq!(constants, ["throttle"]);
        let svg = draw(&record, "", None).svg().unwrap();
        for text in
            ["\u{b0}C", "%", " mode", "cranking", " fault_code", "\n4\n", "Constant: throttle 50\u{202f}%"]
        {
            assert!(svg.contains(text), "{text}: {svg}");
        }
    }

    /// What a page shows of its lines: in the display unit that one of them declares.
    #[cfg(feature = "html")]
    #[test]
    fn a_panel_of_one_unit_has_one_display_unit() {
        let mut record = Record::new([
            Column::from(("throttle", "1")),
            Column {
                display_unit: Some(DisplayUnit { name: "%".to_owned(), factor: 100.0, offset: 0.0 }),
                ..Column::from(("position", "1"))
            },
        ]);
        record.push(0.0, &[0.25, 0.5]);
        record.push(1.0, &[1.0, 0.0]);
        let panels = [vec!["throttle".to_owned(), "position".to_owned()]];
        let html = draw(&record, "", Some(&panels)).html();
        assert!(html.contains("\"y\":[25.0,100.0]") && html.contains("\"y\":[50.0,0.0]"), "{html}");
        assert!(html.contains("\"title\":{\"text\":\"%\"}"), "{html}");
        assert!(html.contains("</span>throttle</label>"), "{html}");
    }

    /// As bars that hide texts too long for them: from 0 s for 0.5 s, and from there for 0.5 s.
    #[cfg(feature = "html")]
    #[test]
    fn lanes_and_display_units_are_on_pages() {
        let html = draw(&declared(), "", None).html();
        for part in [
            "\"base\":[0.0,0.5]",
            "\"x\":[0.5,0.5]",
            "\"text\":[\"off\",\"cranking\"]",
            "\"y\":[25.0,25.0,26.85]",
            "\"meta\":\"1.0-273.15 temperature\"",
            "<p class=\"caption\">Constant: throttle 50\u{202f}%</p>",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        // A discrete number holds its values.
        assert_eq!(html.matches("\"shape\":\"hv\"").count(), 1);
    }

    /// For pages that draw further points: the variable of each line, and the factor to the axis' unit.
    #[cfg(feature = "html")]
    #[test]
    fn lines_name_their_variables_without_points() {
        let record = record(&[("boost_pressure", "Pa", [1000.0, 2000.0]), ("duty", "%", [40.0, 41.0])]);
        let html = template(&record, "", None).html();
        for meta in ["\"meta\":\"0.001 boost_pressure\"", "\"meta\":\"1.0 duty\""] {
            assert!(html.contains(meta), "{html}");
        }
        assert_eq!(html.matches("\"y\":[]").count(), 2, "{html}");
        assert!(html.contains("kPa"));
    }

    /// Tests the names, the axis' unit and the values in that unit.
    #[cfg(feature = "html")]
    #[test]
    fn panels_are_drawn_as_the_scenario_says() {
        let columns = [("a", "Pa", [2000.0; 2]), ("b", "Pa", [3000.0; 2]), ("c", "V", [12.0; 2])];
        let record = record(&columns);
        let html = draw(&record, "", Some(&[vec!["c".to_owned()], vec!["b".to_owned()]])).html();
        assert!(
            html.contains("\"y\":[3.0,3.0]") && html.contains("kPa") && !html.contains("\"y\":[2.0"),
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
