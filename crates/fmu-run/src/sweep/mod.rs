//! Parameter studies: a scenario, run for many values of its FMUs' parameters, on all cores.
//!
//! A study is a TOML file ([`Study::read`]; docs/simulate.md describes every key). [Workers](super::workers) load the
//! FMUs and run it. Each run has its own instances, so runs are independent. Each finished run is written to the
//! [journal](super::journal) at once; an interrupted study resumes from it. A failed run is a row of the results with the
//! FMU's message, or with what ended its worker.

mod command;
pub mod design;
mod measures;
pub mod outcome;
pub mod report;
pub mod results;

pub use self::command::Sweep;
use std::path::{Path, PathBuf};
use std::{fs, io};

use anyhow::{Context, Result};
use fmu_io::document::Document;
use fmu_io::{reading, writing};
use fmu_package::{Value, ValueType};
use serde::{Deserialize, Serialize};

use self::design::Design;
use self::measures::Measure;
use self::outcome::Outcome;
use crate::journal::Identity;
use fmu_master::scenario::{Assignment, Location, Noise, Recorded, Scenario};
use fmu_master::{Ended, LoadedFmus, Master, column_of};
use fmu_record::{Column, Record, TableFormat};

/// The journal in the folder of the results.
const JOURNAL: &str = "journal.jsonl";
/// The folder of the runs' records, below that of the results.
const RECORDS: &str = "records";

pub struct Study {
    title: Option<String>,
    /// The scenario, with the values that are not varied.
    pub scenario: Scenario,
    parameters: Vec<Parameter>,
    points: Vec<Vec<Option<Value>>>,
    measures: Vec<Measure>,
    keeps_records: bool,
    /// Whether records have rows at events.
    pub records_events: bool,
}

#[derive(Clone, Debug)]
pub struct Parameter {
    /// The name in the study: the FMU's name, a colon and the variable's name.
    pub name: String,
    /// Whether the parameter's values are spread evenly by their logarithms.
    pub is_logarithmic: bool,
    pub location: Location,
}

impl Parameter {
    /// The FMU's name in the scenario and the variable's name.
    fn parts(&self) -> Result<(&str, &str)> {
        self.name.split_once(':').ok_or_else(|| {
            self.location.error("expected the FMU's name in the scenario, a colon and the variable's name")
        })
    }
}

/// What a worker finds in a study's FMUs, before any run.
#[derive(Deserialize, Serialize)]
pub struct Opening {
    /// Everything that the results depend on.
    identity: Identity,
    /// The name, units and type of each parameter.
    parameters: Vec<(Column, ValueType)>,
    /// The name and units of each measure.
    measures: Vec<Column>,
    /// Notes on names in the scenario that the FMUs do not have.
    notes: Vec<String>,
}

impl Study {
    /// Reads a file, and the scenario that it names, relative to its folder. Paths of FMUs are relative to `fmus`.
    pub fn read(path: &Path, fmus: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let document = Document::parse(&path.to_string_lossy(), &text)?;
        let root = document.root();
        let scenario = root.required("scenario", "the path of a scenario")?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let file = scenario.path("the path of a scenario", folder)?;
        // The scenario's messages have their own locations.
        let mut scenario = Scenario::read(&file, fmus)?;
        scenario.files.push(path.to_owned());
        let title = root.title()?.map(str::to_owned);
        let keeps_records = root.optional("records").map_or(Ok(false), |node| {
            node.value().as_bool().ok_or_else(|| node.unexpected("true to keep the record of each run"))
        })?;
        let Design { parameters, points } = Design::read(&root)?;
        let measures = root.required("measures", "a table of measures by their names")?;
        let measures = measures::read(&measures, &scenario)?;
        results::refuse_names(&parameters, &measures)?;
        let study = Self {
            title,
            parameters,
            points,
            keeps_records,
            records_events: keeps_records,
            scenario: {
                record_measured(&mut scenario, &measures, keeps_records);
                scenario
            },
            measures,
        };
        root.finish()?;
        Ok(study)
    }

    /// The files and folders of the results.
    pub fn outputs(&self, folder: &Path) -> Vec<PathBuf> {
        let names = [JOURNAL, results::CSV, results::PARQUET, report::HTML].into_iter();
        names.chain(self.keeps_records.then_some(RECORDS)).map(|name| folder.join(name)).collect()
    }

    /// Loads the FMUs, and checks the study's names against them.
    fn open(&self) -> Result<(LoadedFmus, Opening)> {
        let mut fmus = LoadedFmus::default();
        let master = Master::new(&self.scenario, &mut fmus)?;
        let mut measures = vec![];
        for measure in &self.measures {
            let Some(column) = master.recorded().find(|column| column.name == measure.variable) else {
                let message = format!("the scenario does not record {}", measure.variable);
                return Err(measure.location.error(message));
            };
            if column.is_text {
                let message = format!("{} is a String, which cannot be measured", measure.variable);
                return Err(measure.location.error(message));
            }
            measures.push(measure.column(column));
        }
        let notes = master.notes().to_vec();
        drop(master);
        let mut parameters = vec![];
        for (index, parameter) in self.parameters.iter().enumerate() {
            let (member, name) = parameter.parts()?;
            let Some(member) = self.scenario.fmus.iter().find(|known| known.name == member) else {
                let names: Vec<_> = self.scenario.fmus.iter().map(|member| member.name.as_str()).collect();
                let message = format!("the scenario has no FMU {member}; it has {}", names.join(", "));
                return Err(parameter.location.error(message));
            };
            let fmu = fmus.get(member)?;
            let variable = parameter.location.locate(fmu.variable(name))?;
            if !variable.is_settable() {
                let message = format!("{name} is calculated by the FMU and cannot be set");
                return Err(parameter.location.error(message));
            }
            for value in self.points.iter().filter_map(|point| point[index].as_ref()) {
                let fitted = value.fit(variable, &[], fmu.description());
                parameter.location.locate(fitted.map_err(anyhow::Error::from))?;
            }
            let column = column_of(&parameter.name, variable, fmu.description());
            parameters.push((column, variable.value_type()));
        }
        let identity = self.identity()?;
        Ok((fmus, Opening { identity, parameters, measures, notes }))
    }

    /// Everything that the results depend on. Taken apart without `..`, so that a new field does not compile until it is
    /// decided.
    fn identity(&self) -> Result<Identity> {
        let Self { title: _, scenario, parameters, points, measures, keeps_records, records_events } = self;
        let mut identity = scenario.identity()?;
        let mut set = |name: String, value: String| identity.insert(name, value);
        set("version of cargo-fmu".into(), env!("CARGO_PKG_VERSION").to_owned());
        set("records".into(), keeps_records.to_string());
        set("events in records".into(), records_events.to_string());
        set("runs".into(), points.len().to_string());
        for (index, Parameter { name, is_logarithmic: _, location: _ }) in parameters.iter().enumerate() {
            let values = points.iter().map(|point| point[index].as_ref().map(written).unwrap_or_default());
            set(format!("values of {name}"), values.collect::<Vec<_>>().join(", "));
        }
        for measure in measures {
            let (name, value) = measure.identity();
            set(name, value);
        }
        Ok(identity)
    }

    /// Runs a point, and returns its record if that is kept.
    fn run_one(&self, fmus: &LoadedFmus, run: usize) -> Result<(Outcome, Option<Record>)> {
        let mut outcome = Outcome::new(run, self.measures.len());
        let simulated = self.point(run).and_then(|scenario| {
            let mut master = Master::new(&scenario, &mut fmus.clone())?;
            if self.records_events {
                master.record_events();
            }
            Ok((master.run(|_, _| ())?, scenario))
        });
        let (finished, scenario) = match simulated {
            Ok(simulated) => simulated,
            Err(error) => {
                outcome.error = Some(format!("{error:#}"));
                return Ok((outcome, None));
            }
        };
        outcome.warnings = finished.warnings.iter().map(|(name, message)| message.of(name)).collect();
        outcome.warnings.extend(finished.ended.as_ref().map(Ended::in_brief));
        let sampled = finished.record.without_events();
        outcome.measures = self
            .measures
            .iter()
            .map(|measure| measure.of(&sampled, &scenario).map(|value| value.is_finite().then_some(value)))
            .collect::<Result<_>>()?;
        Ok((outcome, self.keeps_records.then_some(finished.record)))
    }

    /// Whether the record of a run should be in a folder, but is gone.
    fn lacks_record(&self, outcome: &Outcome, records: &Path) -> bool {
        self.keeps_records && outcome.error.is_none() && !record_of(outcome, records).exists()
    }

    fn point(&self, run: usize) -> Result<Scenario> {
        let mut scenario = self.scenario.clone();
        for (parameter, value) in self.parameters.iter().zip(&self.points[run]) {
            if let Some(value) = value {
                let (member, name) = parameter.parts()?;
                let member = scenario.fmus.iter_mut().find(|known| known.name == member);
                let member = member.with_context(|| format!("no FMU has {}", parameter.name))?;
                member.values.retain(|assignment| assignment.name != name);
                let location = parameter.location.clone();
                member.values.push(Assignment { name: name.to_owned(), value: value.clone(), location });
            }
        }
        Ok(scenario)
    }
}

/// The file of a run's record.
fn record_of(outcome: &Outcome, records: &Path) -> PathBuf {
    records.join(format!("{}.csv", outcome.run))
}

/// Writes the record of a run, if it is kept, to a folder.
fn keep((outcome, record): (Outcome, Option<Record>), records: &Path) -> Result<Outcome> {
    if let Some(record) = record {
        let path = record_of(&outcome, records);
        writing::write(&path, |writer| record.table().write(TableFormat::Csv, writer))?;
    }
    Ok(outcome)
}

/// Removes the record of a run that failed after it was written.
fn discard(outcome: &Outcome, records: &Path) -> Result<()> {
    let path = record_of(outcome, records);
    match fs::remove_file(&path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// Limits a scenario's records to the measured variables, unless records are kept; nothing is drawn.
fn record_measured(scenario: &mut Scenario, measures: &[Measure], keeps_records: bool) {
    scenario.panels = None;
    let mut record = match scenario.record.take() {
        Some(record) if keeps_records => record,
        // The default is all driven inputs and all outputs.
        None if keeps_records => return,
        _ => vec![],
    };
    for measure in measures {
        if !record.iter().any(|recorded| recorded.name == measure.variable) {
            record.push(Recorded { name: measure.variable.clone(), location: measure.location.clone() });
        }
    }
    let is_recorded = |noise: &Noise| record.iter().any(|recorded| recorded.name == noise.name);
    if !keeps_records {
        scenario.measurement_noise.retain(is_recorded);
    }
    scenario.record = Some(record);
}

/// A value for results and messages; a number reads back as the same double.
pub fn written(value: &Value) -> String {
    match value {
        Value::Real(value, _) => format!("{value:?}"),
        Value::Integer(value) => value.to_string(),
        Value::Boolean(value) => value.to_string(),
        Value::String(text) | Value::Enumeration(text) => text.clone(),
    }
}
