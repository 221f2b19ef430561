//! The measures of each run of a study.

use anyhow::{Context, Result};
use clap::ValueEnum;
use fmu_io::terminal::number;

use fmu_io::document::{Node, TomlTable};
use fmu_master::measure::{Following, between, greatest, least};
use fmu_master::scenario::{Location, Scenario, Signal};
use fmu_record::{Column, Record};

/// A measure of a run.
#[derive(Clone, Debug)]
pub struct Measure {
    pub name: String,
    /// The variable, as the scenario records it.
    pub variable: String,
    pub location: Location,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    /// A statistic of the values between two times.
    Statistic { statistic: Statistic, from: f64, to: f64 },
    /// A quality of the response to the steps of an input of the scenario.
    Step { quality: Quality, reference: String },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Statistic {
    Final,
    Mean,
    Minimum,
    Maximum,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Quality {
    OvershootUp,
    OvershootDown,
    RiseTime,
    EndError,
}

const EXPECTED: &str = "a table with the name of a variable under one of final, mean, minimum, maximum, \
                        overshoot_up, overshoot_down, rise_time and end_error";

pub fn read(node: &Node<'_>, scenario: &Scenario) -> Result<Vec<Measure>> {
    let table = node.table("a table of measures by their names")?;
    let measures: Vec<_> =
        table.entries().map(|(name, node)| read_one(name, &node, scenario)).collect::<Result<_>>()?;
    if measures.is_empty() { Err(node.unexpected("at least one measure")) } else { Ok(measures) }
}

fn read_one(name: &str, node: &Node<'_>, scenario: &Scenario) -> Result<Measure> {
    let table = node.table(EXPECTED)?;
    let mut found = vec![];
    for statistic in Statistic::value_variants() {
        if let Some(variable) = chosen(&table, statistic) {
            let (from, to) = read_times(&table, scenario)?;
            found.push((variable, Kind::Statistic { statistic: *statistic, from, to }));
        }
    }
    for quality in Quality::value_variants() {
        if let Some(variable) = chosen(&table, quality) {
            found.push((
                variable,
                Kind::Step { quality: *quality, reference: read_reference(&table, scenario)? },
            ));
        }
    }
    let Ok([(variable, kind)]) = <[_; 1]>::try_from(found) else { return Err(node.unexpected(EXPECTED)) };
    let variable = variable.string("the name of a variable")?.to_owned();
    table.finish()?;
    Ok(Measure { name: name.to_owned(), variable, location: node.location().clone(), kind })
}

/// The value under a measure's key, if the table has it.
fn chosen<'a>(table: &TomlTable<'a>, measure: &impl ValueEnum) -> Option<Node<'a>> {
    table.optional(measure.to_possible_value()?.get_name())
}

/// The time interval; by default the whole scenario.
fn read_times(table: &TomlTable<'_>, scenario: &Scenario) -> Result<(f64, f64)> {
    let time = |key, default| {
        let Some(node) = table.optional(key) else { return Ok(default) };
        let time = node.number("a time in s")?;
        let steps = (time - scenario.start_time) / scenario.step;
        let is_in = (scenario.start_time..=scenario.stop_time).contains(&time);
        if !is_in || (steps - steps.round()).abs() > 1e-6 {
            return Err(node.unexpected(&format!(
                "a time from {} to {} s, a whole number of steps of {} s after the start",
                number(scenario.start_time),
                number(scenario.stop_time),
                number(scenario.step)
            )));
        }
        Ok(time)
    };
    let (from, to) = (time("from", scenario.start_time)?, time("to", scenario.stop_time)?);
    if from > to {
        let [from, to] = [from, to].map(number);
        return Err(table.location().error(format!("expected from before to, found {from} s to {to} s")));
    }
    Ok((from, to))
}

/// The steps of an input of the scenario.
fn read_reference(table: &TomlTable<'_>, scenario: &Scenario) -> Result<String> {
    const EXPECTED: &str = "an input of the scenario that is steps";
    let node = table.required("reference", EXPECTED)?;
    let name = node.string(EXPECTED)?;
    match scenario.input(name) {
        Some(Signal::Steps(points)) if points.len() > 1 => Ok(name.to_owned()),
        _ => Err(node.unexpected(EXPECTED)),
    }
}

impl Measure {
    /// The value for a run; not finite if undefined, such as a rise time never reached.
    pub fn of(&self, record: &Record, scenario: &Scenario) -> Result<f64> {
        match &self.kind {
            &Kind::Statistic { statistic, from, to } => {
                // A run may have ended before, as its FMU requested.
                let last = record.time().last().copied().context("the record is empty")?;
                if from > last {
                    return Ok(f64::NAN);
                }
                let values = between(record, &self.variable, from, to.min(last))?;
                let all = values.iter().copied();
                Ok(match statistic {
                    Statistic::Final => values[values.len() - 1],
                    Statistic::Mean => all.sum::<f64>() / values.len() as f64,
                    Statistic::Minimum => least(all),
                    Statistic::Maximum => greatest(all),
                })
            }
            Kind::Step { quality, reference } => {
                let signal = scenario.input(reference).context("no such input")?;
                let following = Following::new(record, &self.variable, signal.points())?;
                Ok(greatest(match quality {
                    Quality::OvershootUp => following.up,
                    Quality::OvershootDown => following.down,
                    Quality::RiseTime => following.rise,
                    Quality::EndError => following.end_error,
                }))
            }
        }
    }

    /// The measure's name and units, by those of its variable.
    pub fn column(&self, variable: &Column) -> Column {
        let column = match self.kind {
            Kind::Step { quality: Quality::RiseTime, .. } => {
                Column { unit: "s".to_owned(), ..Column::default() }
            }
            Kind::Step { .. } => variable.of_differences(),
            Kind::Statistic { .. } => variable.clone(),
        };
        Column { name: self.name.clone(), ..column }
    }

    /// The measure's name and what it depends on, for the journal.
    pub fn identity(&self) -> (String, String) {
        let Self { name, variable, kind, location: _ } = self;
        (format!("measures.{name}"), format!("{kind:?} of {variable}"))
    }
}
