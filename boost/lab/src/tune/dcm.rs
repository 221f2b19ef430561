//! The tuned schedule as DCM (`KONSERVIERUNG_FORMAT 2.0`), which calibration tools such as INCA and `CANape` read: maps as
//! `KENNFELD`, the limit of the reference as `KENNLINIE`, other parameters as `FESTWERT`.

use std::collections::BTreeMap;
use std::fmt::Write;

use fmu_io::terminal::number;
use fmu_package::{ParameterSet, Value};

use super::schedule::{Schedule, ScheduleTable, boost_limit_parameter};

/// Values per line, the most that the format's authors write.
const PER_LINE: usize = 6;

/// The parameters of a set that was tuned over the grid of a schedule.
pub fn dcm(set: &ParameterSet, schedule: &Schedule) -> String {
    let values: BTreeMap<_, _> =
        set.parameters.iter().map(|parameter| (parameter.name.as_str(), &parameter.value)).collect();
    let number_of = |name: &str| values.get(name).and_then(|value| value.number()).unwrap_or(f64::NAN);
    let (speeds, references) = (&schedule.engine_speeds, &schedule.boost_references);
    let mut text = format!("* {}\nKONSERVIERUNG_FORMAT 2.0\n", set.description);
    for parameter in set.parameters.iter().filter(|parameter| !parameter.name.ends_with(']')) {
        let (unit, value) = match &parameter.value {
            Value::Real(value, Some(unit)) => (unit.as_str(), format!("WERT {}", number(*value))),
            Value::Enumeration(item) => ("", format!("TEXT \"{item}\"")),
            // The tuning sets nothing else.
            _ => continue,
        };
        let units = [("EINHEIT_W", unit)];
        block(&mut text, &format!("FESTWERT {}", parameter.name), &parameter.description, &units, &[value]);
    }
    if schedule.allocation.is_some() {
        let limits: Vec<_> =
            (0..speeds.len()).map(|column| number_of(&boost_limit_parameter(column))).collect();
        let lines = [values_in_lines("ST/X", speeds), values_in_lines("WERT", &limits)].concat();
        let title = format!("KENNLINIE {} {}", array(&boost_limit_parameter(0)), speeds.len());
        let units = [("EINHEIT_X", "rpm"), ("EINHEIT_W", "Pa")];
        block(&mut text, &title, "limit of the boost reference over engine speed", &units, &lines);
    }
    for &map in ScheduleTable::all(schedule.strategy) {
        let mut lines = values_in_lines("ST/X", speeds);
        for (row, &reference) in references.iter().enumerate() {
            let cells = (0..speeds.len()).map(|column| number_of(&schedule.parameter(map, row, column)));
            lines.push(format!("ST/Y {}", number(reference)));
            lines.extend(values_in_lines("WERT", &cells.collect::<Vec<_>>()));
        }
        let name = schedule.parameter(map, 0, 0);
        let title = format!("KENNFELD {} {} {}", array(&name), speeds.len(), references.len());
        let units = [("EINHEIT_X", "rpm"), ("EINHEIT_Y", "Pa"), ("EINHEIT_W", map.unit())];
        block(&mut text, &title, "over engine speed and boost reference", &units, &lines);
    }
    text
}

fn block(text: &mut String, title: &str, description: &str, units: &[(&str, &str)], lines: &[String]) {
    // Writing to a `String` cannot fail.
    let _ = writeln!(text, "\n{title}\n   LANGNAME \"{}\"", description.replace('"', "'"));
    for (key, unit) in units {
        let _ = writeln!(text, "   {key} \"{unit}\"");
    }
    for line in lines {
        let _ = writeln!(text, "   {line}");
    }
    text.push_str("END\n");
}

fn values_in_lines(key: &str, values: &[f64]) -> Vec<String> {
    let line = |values: &[f64]| {
        values.iter().fold(key.to_owned(), |line, value| format!("{line} {}", number(*value)))
    };
    values.chunks(PER_LINE).map(line).collect()
}

/// The name of the array of an element.
fn array(element: &str) -> &str {
    element.split('[').next().unwrap_or(element)
}
