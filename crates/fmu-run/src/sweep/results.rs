//! The results of a study as a table: a row for each run, with its values, its measures and the error if it failed.

use anyhow::Result;
use fmu_package::{Value, ValueType};

use super::measures::Measure;
use super::outcome::Outcome;
use super::{Opening, Parameter, Study, written};
use fmu_record::{Cells, Table, TableColumn};

/// The table's files in the folder of the results.
pub const CSV: &str = "results.csv";
pub const PARQUET: &str = "results.parquet";

/// The columns that every study has.
const RUN: &str = "run";
const ERROR: &str = "error";
const WARNINGS: &str = "warnings";

/// Refuses a measure with the name of another column.
pub(super) fn refuse_names(parameters: &[Parameter], measures: &[Measure]) -> Result<()> {
    let parameters = parameters.iter().map(|parameter| parameter.name.as_str());
    let taken: Vec<_> = parameters.chain([RUN, ERROR, WARNINGS]).collect();
    // TOML forbids two measures of the same name.
    match measures.iter().find(|measure| taken.contains(&measure.name.as_str())) {
        Some(measure) => Err(measure.location.error(format!(
            "the results already have a column {}; give the measure another name",
            measure.name
        ))),
        None => Ok(()),
    }
}

/// The results of a study; `outcomes` are those of all runs, in their order.
pub fn table<'a>(study: &Study, opening: &Opening, outcomes: &[Outcome]) -> Table<'a> {
    let plain = |name, cells| TableColumn::new(&(name, "").into(), cells);
    let whole = |value| i32::try_from(value).ok();
    let runs = outcomes.iter().map(|outcome| whole(outcome.run)).collect();
    let mut columns = vec![plain(RUN, Cells::Whole(runs))];
    for (index, (heading, value_type)) in opening.parameters.iter().enumerate() {
        let values = study.points.iter().map(|point| point[index].as_ref());
        let cells = match value_type {
            ValueType::Real => Cells::Number(values.map(|value| value?.number()).collect()),
            ValueType::Integer => Cells::Whole(
                values
                    .map(|value| if let Value::Integer(value) = value? { Some(*value) } else { None })
                    .collect(),
            ),
            ValueType::Boolean => Cells::Truth(
                values
                    .map(|value| if let Value::Boolean(value) = value? { Some(*value) } else { None })
                    .collect(),
            ),
            _ => Cells::Text(values.map(|value| value.map(written)).collect()),
        };
        columns.push(TableColumn::new(heading, cells));
    }
    for (index, heading) in opening.measures.iter().enumerate() {
        let values = outcomes.iter().map(|outcome| outcome.measures[index]).collect();
        columns.push(TableColumn::new(heading, Cells::Number(values)));
    }
    let errors = outcomes.iter().map(|outcome| outcome.error.clone()).collect();
    columns.push(plain(ERROR, Cells::Text(errors)));
    let joined = |outcome: &Outcome| (!outcome.warnings.is_empty()).then(|| outcome.warnings.join("\n"));
    let warnings = outcomes.iter().map(joined).collect();
    columns.push(plain(WARNINGS, Cells::Text(warnings)));
    Table(columns)
}
