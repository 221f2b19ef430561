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

use anyhow::{Context, Result};
use fmu_io::document::Document;
use fmu_io::{reading, writing};
use fmu_package::{Value, ValueType, connection};
use serde::{Deserialize, Serialize};

use self::design::Design;
use self::measures::Measure;
use self::outcome::Outcome;
use crate::run::journal::{Settings, digest};
use fmu_master::scenario::{Assignment, Location, Noise, Recorded, Scenario};
use fmu_master::{Ended, LoadedFmus, Master, column_of};
use fmu_record::{Column, TableFormat};

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
    /// Whether they have rows at events.
    pub records_events: bool,
}

#[derive(Clone, Debug)]
pub struct Parameter {
    /// The name in the study: the FMU's name, a colon and the variable's name.
    pub name: String,
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
    /// Everything the results depend on, by name.
    settings: Settings,
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
        let settings = self.settings()?;
        Ok((fmus, Opening { settings, parameters, measures, notes }))
    }

    /// Everything the results depend on, by name.
    fn settings(&self) -> Result<Settings> {
        let Self { title: _, scenario, parameters, points, measures, keeps_records, records_events } = self;
        let mut settings = Settings::new();
        let mut set = |name: String, value: String| settings.insert(name, value);
        set("records".into(), keeps_records.to_string());
        set("runs".into(), points.len().to_string());
        for (index, parameter) in parameters.iter().enumerate() {
            let values = points.iter().map(|point| point[index].as_ref().map(written).unwrap_or_default());
            set(format!("values of {}", parameter.name), values.collect::<Vec<_>>().join(", "));
        }
        for measure in measures {
            set(format!("measures.{}", measure.name), measure.setting());
        }
        set("scenario's step".into(), format!("{:?}", scenario.step));
        set("scenario's start_time".into(), format!("{:?}", scenario.start_time));
        set("scenario's stop_time".into(), format!("{:?}", scenario.stop_time));
        set("scenario's stepping".into(), format!("{:?}", scenario.stepping));
        let order: Vec<_> = scenario.fmus.iter().map(|member| member.name.as_str()).collect();
        set("scenario's FMUs".into(), order.join(", "));
        for member in &scenario.fmus {
            let name = &member.name;
            set(format!("SHA-256 of {name}'s file"), digest(&member.file)?);
            for (index, (parameters, _)) in member.parameters.iter().enumerate() {
                set(format!("{name}'s parameter set {}", index + 1), format!("{parameters:?}"));
            }
            for assignment in &member.values {
                set(format!("{name}'s {}", assignment.name), written(&assignment.value));
            }
            if let Some(run_in) = &member.run_in {
                set(format!("{name}'s run_in.duration"), format!("{:?}", run_in.duration));
                for (key, assignments) in [("during", &run_in.during), ("after", &run_in.after)] {
                    for assignment in assignments {
                        let key = format!("{name}'s run_in.{key}.{}", assignment.name);
                        set(key, written(&assignment.value));
                    }
                }
            }
            for input in &member.inputs {
                set(format!("{name}'s inputs.{}", input.name), format!("{:?}", input.course));
            }
        }
        if let Some(connections) = &scenario.connections {
            set("scenario's connections".into(), connection::in_line(connections));
        }
        for input in &scenario.inputs {
            set(format!("scenario's inputs.{}", input.name), format!("{:?}", input.course));
        }
        let noises = [("noise", &scenario.noise), ("measurement_noise", &scenario.measurement_noise)];
        for (key, noises) in noises {
            for noise in noises {
                let value = format!("{:?}, seed {}", noise.standard_deviation, noise.seed);
                set(format!("scenario's {key}.{}", noise.name), value);
            }
        }
        if *keeps_records {
            let names = scenario.record.as_ref().map(|record| {
                record.iter().map(|recorded| recorded.name.as_str()).collect::<Vec<_>>().join(", ")
            });
            set("scenario's record".into(), names.unwrap_or_default());
            set("events in records".into(), records_events.to_string());
        }
        Ok(settings)
    }

    /// Runs a point; its record, if it is kept, goes to a folder.
    fn run_one(&self, fmus: &LoadedFmus, run: usize, records: &Path) -> Result<Outcome> {
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
                return Ok(outcome);
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
        if self.keeps_records {
            let path = records.join(format!("{run}.csv"));
            writing::write(&path, |writer| finished.record.table().write(TableFormat::Csv, writer))?;
        }
        Ok(outcome)
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
