//! A parameter study's self-contained report for readers: measures over parameters. Programs read results.csv or
//! results.parquet.

use super::outcome::Outcome;
use super::{Loaded, written};
use fmu_package::Value;
use fmu_plot::panels::shown;
use fmu_plot::{Cell, Figure, Line, Panel, Report, Table, color};
use fmu_record::numbers::{number, quantity};

pub const HTML: &str = "report.html";

/// Panels per row, so that each is wide enough.
const MOST_IN_ROW: usize = 3;
/// Failed runs listed at most; results.csv has all.
const MOST_FAILURES: usize = 20;

pub fn html(loaded: &Loaded, outcomes: &[Outcome]) -> String {
    let study = loaded.study();
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
    let measures = || study.measures.iter().zip(&loaded.measure_units).enumerate();
    report.section("Measures");
    let mut table = Table::new(["Measure", "Minimum", "Median", "Maximum", "Undefined"]);
    for (index, (measure, unit)) in measures() {
        table.row(summary(&measure.name, unit, index, outcomes));
    }
    report.table(&table);
    report.section("Parameters");
    let mut table = Table::new(["Parameter", "Values"]);
    for (index, parameter) in study.parameters.iter().enumerate() {
        let values: Vec<_> = study.points.iter().filter_map(|point| point[index].as_ref()).collect();
        let range = range(&values, &loaded.variables[index].unit);
        table.row([parameter.name.as_str().into(), range.into()]);
    }
    report.table(&table);
    for (index, (measure, unit)) in measures() {
        report.section(&measure.name);
        let caption = format!("{} over each parameter; one dot per run.", measure.name);
        report.figure(&drawing(loaded, outcomes, index, unit), &caption);
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
fn summary(name: &str, unit: &str, index: usize, outcomes: &[Outcome]) -> [Cell; 5] {
    let mut found: Vec<_> =
        outcomes.iter().filter_map(|outcome| Some((outcome.measures[index]?, outcome.run))).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cell = |place: Option<&(f64, usize)>| match place {
        Some((value, run)) => Cell::number(&format!("{} (run {run})", quantity(*value, unit))),
        None => Cell::number(""),
    };
    let undefined = Cell::number(&format!("{} runs", outcomes.len() - found.len()));
    [name.into(), cell(found.first()), cell(found.get(found.len() / 2)), cell(found.last()), undefined]
}

/// A measure over each numeric parameter.
fn drawing(loaded: &Loaded, outcomes: &[Outcome], measure: usize, unit: &str) -> Figure {
    let study = loaded.study();
    let size =
        |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most, value: f64| value.abs().max(most));
    let most = size(&mut outcomes.iter().filter_map(|outcome| outcome.measures[measure]));
    let (unit, factor) = shown(unit, most);
    let mut panels = vec![];
    for (index, parameter) in study.parameters.iter().enumerate() {
        let points = outcomes.iter().filter_map(|outcome| {
            let value = study.points[outcome.run][index].as_ref().and_then(Value::number)?;
            Some((value, outcome.measures[measure]?))
        });
        let (x, y): (Vec<_>, Vec<_>) = points.unzip();
        if x.is_empty() {
            continue;
        }
        let x_unit = &loaded.variables[index].unit;
        let (x_unit, x_factor) = shown(x_unit, size(&mut x.iter().copied()));
        let x: Vec<_> = x.into_iter().map(|value| x_factor * value).collect();
        let label = match x_unit.as_str() {
            "" => parameter.name.clone(),
            unit => format!("{} ({unit})", parameter.name),
        };
        let dots = Line::new(&x, y.into_iter().map(|value| factor * value)).color(color::BLUE).dots();
        panels.push(Panel::new(&label, &unit).line(dots));
    }
    panels.chunks(MOST_IN_ROW).fold(Figure::new(), |figure, row| figure.row(row.iter().cloned()))
}

/// A summary of a parameter's values.
fn range(values: &[&Value], unit: &str) -> String {
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
        [only] => quantity(only, unit),
        [least, .., most] => {
            let (unit, factor) = shown(unit, most);
            let both = [least, most].map(|value| number(factor * value));
            format!("{} values from {} to {} {unit}", numbers.len(), both[0], both[1]).trim_end().to_owned()
        }
    }
}
