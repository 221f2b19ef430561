//! The self-contained report of a parameter study, for people: measures over parameters. Programs read results.csv or
//! results.parquet.

use std::cmp::Ordering;

use super::outcome::Outcome;
use super::{Opening, Study, written};
use fmu_package::Value;
use fmu_plot::{Cell, Figure, Line, Panel, Report, Table, color, labelled};
use fmu_record::Column;

pub const HTML: &str = "report.html";

/// Panels per row, so that each is wide enough.
const MOST_IN_ROW: usize = 3;
/// Failed runs listed at most; results.csv has all.
const MOST_FAILURES: usize = 20;

pub fn html((study, opening): (&Study, &Opening), outcomes: &[Outcome]) -> String {
    let title = study.title.as_deref().unwrap_or("Parameter study");
    let failed: Vec<_> = outcomes.iter().filter(|outcome| outcome.error.is_some()).collect();
    let warned = outcomes.iter().filter(|outcome| !outcome.warnings.is_empty()).count();
    let scenario = study.scenario.title.as_deref();
    let mut report = Report::new(title);
    report.paragraph(&format!(
        "{} runs{}, of which {} failed and {warned} have warnings. results.csv and results.parquet list every run with \
         its values.",
        outcomes.len(),
        scenario.map_or_else(String::new, |title| format!(" of the scenario “{title}”")),
        failed.len(),
    ));
    let measures = || opening.measures.iter().enumerate();
    report.section("Measures");
    let mut table = Table::new(["Measure", "Minimum", "Median", "Maximum", "Undefined"]);
    for (index, measure) in measures() {
        table.row(summary(measure, index, outcomes));
    }
    report.table(&table);
    report.section("Parameters");
    let mut table = Table::new(["Parameter", "Values"]);
    for (index, (parameter, _)) in opening.parameters.iter().enumerate() {
        let values: Vec<_> = study.points.iter().filter_map(|point| point[index].as_ref()).collect();
        table.row([parameter.name.as_str().into(), range(&values, parameter).into()]);
    }
    report.table(&table);
    for (index, measure) in measures() {
        report.section(&measure.name);
        let colors = if study.parameters.len() == 2 { "; colours show the other parameter" } else { "" };
        let caption = format!("{} over each parameter; one dot per run{colors}.", measure.name);
        report.figure(&drawing((study, opening), outcomes, index), &caption);
    }
    if !failed.is_empty() {
        report.section("Failed runs");
        let mut table = Table::new(["Run", "Error"]);
        for outcome in failed.iter().take(MOST_FAILURES) {
            table.row([outcome.run.to_string().into(), outcome.error.as_deref().unwrap_or_default().into()]);
        }
        report.table(&table);
        if failed.len() > MOST_FAILURES {
            report.paragraph(&format!("and {} more, in results.csv", failed.len() - MOST_FAILURES));
        }
    }
    report.page("")
}

/// A measure's row: minimum, median and maximum, with their runs.
fn summary(measure: &Column, index: usize, outcomes: &[Outcome]) -> [Cell; 5] {
    let mut found: Vec<_> =
        outcomes.iter().filter_map(|outcome| Some((outcome.measures[index]?, outcome.run))).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cell = |place: Option<&(f64, usize)>| match place {
        Some((value, run)) => Cell::number(&format!("{} (run {run})", measure.text(*value))),
        None => Cell::number(""),
    };
    let undefined = Cell::number(&format!("{} runs", outcomes.len() - found.len()));
    [
        measure.name.as_str().into(),
        cell(found.first()),
        cell(found.get(found.len() / 2)),
        cell(found.last()),
        undefined,
    ]
}

/// A measure over each numeric parameter. If there are two parameters, colours show the values of the other one.
fn drawing((study, opening): (&Study, &Opening), outcomes: &[Outcome], measure: usize) -> Figure {
    let size =
        |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most, value: f64| value.abs().max(most));
    let most = size(&mut outcomes.iter().filter_map(|outcome| outcome.measures[measure]));
    let (unit, y) = opening.measures[measure].scale(most);
    let y_label = labelled(&opening.measures[measure].name, &unit);
    let mut panels = vec![];
    for (index, (parameter, _)) in opening.parameters.iter().enumerate() {
        let value = |outcome: &Outcome| study.points[outcome.run][index].as_ref().and_then(Value::number);
        let drawn = outcomes.iter().filter(|outcome| outcome.measures[measure].is_some());
        let drawn: Vec<_> = drawn.filter(|outcome| value(outcome).is_some()).collect();
        if drawn.is_empty() {
            continue;
        }
        let most = size(&mut drawn.iter().filter_map(|outcome| value(outcome)));
        let (x_unit, x) = parameter.scale(most);
        let panel = Panel::new(&labelled(&parameter.name, &x_unit), &y_label);
        // Values in a unit with another zero may be below it.
        let is_logarithmic = study.parameters[index].is_logarithmic && x.offset == 0.0;
        let panel = if is_logarithmic { panel.logarithmic_x() } else { panel };
        let (panel, groups) = match study.parameters.len() {
            2 => {
                let other = 1 - index;
                let title = format!("colours: {}", study.parameters[other].name);
                (panel.title(&title), groups((study, opening), &drawn, other))
            }
            _ => (panel, vec![(None, drawn)]),
        };
        let lines = groups.into_iter().zip(color::CYCLE).map(|((label, group), color)| {
            let points = group
                .into_iter()
                .filter_map(|outcome| Some((x.apply(value(outcome)?), y.apply(outcome.measures[measure]?))));
            let mut points: Vec<_> = points.collect();
            points.sort_by(|one, other| one.0.total_cmp(&other.0));
            let is_function = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
            let (x, y): (Vec<_>, Vec<_>) = points.into_iter().unzip();
            let line = Line::new(&x, y).color(color);
            match label {
                Some((label, true)) if is_function => line.label(&label).markers(),
                Some((label, _)) => line.label(&label).dots(),
                None => line.dots(),
            }
        });
        panels.push(lines.fold(panel, Panel::line));
    }
    panels.chunks(MOST_IN_ROW).fold(Figure::new(), |figure, row| figure.row(row.iter().cloned()))
}

/// A group's name, and whether it is of one value.
type GroupLabel = Option<(String, bool)>;

/// The runs by a parameter's values, or in thirds if there are more than colours.
fn groups<'a>(
    (study, opening): (&Study, &Opening),
    drawn: &[&'a Outcome],
    parameter: usize,
) -> Vec<(GroupLabel, Vec<&'a Outcome>)> {
    let value = |outcome: &Outcome| study.points[outcome.run][parameter].as_ref();
    let column = &opening.parameters[parameter].0;
    let name = |outcome: &Outcome| match value(outcome) {
        None => "default".to_owned(),
        Some(value) => value.number().map_or_else(|| written(value), |value| column.text(value)),
    };
    let mut sorted = drawn.to_vec();
    sorted.sort_by(|one, other| {
        let [one, other] =
            [one, other].map(|outcome| (value(outcome).and_then(Value::number), name(outcome)));
        one.0.partial_cmp(&other.0).unwrap_or(Ordering::Equal).then(one.1.cmp(&other.1))
    });
    let by_value: Vec<_> = sorted.chunk_by(|one, other| name(one) == name(other)).collect();
    if by_value.len() <= color::CYCLE.len() {
        let groups = by_value.into_iter();
        return groups.map(|group| (Some((name(group[0]), true)), group.to_vec())).collect();
    }
    let thirds = sorted.chunks(sorted.len().div_ceil(3));
    let range = |group: &[&Outcome]| format!("{} to {}", name(group[0]), name(group[group.len() - 1]));
    thirds.map(|group| (Some((range(group), false)), group.to_vec())).collect()
}

/// A summary of a parameter's values.
fn range(values: &[&Value], parameter: &Column) -> String {
    let mut numbers: Vec<_> = values.iter().filter_map(|value| value.number()).collect();
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    match numbers[..] {
        [] => {
            let mut texts: Vec<_> = values.iter().map(|value| written(value)).collect();
            texts.sort();
            texts.dedup();
            texts.join(", ")
        }
        [only] => parameter.text(only),
        [least, .., most] => {
            format!("{} values from {} to {}", numbers.len(), parameter.text(least), parameter.text(most))
        }
    }
}
