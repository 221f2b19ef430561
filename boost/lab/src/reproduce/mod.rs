//! The paper's figures from the FMUs: each has scenarios, measurements, and a drawing in the paper's layout.
//!
//! A [`Claim`] is a claim of the paper with the FMUs' result, the accepted range, and the result's basis.

mod figure_1;
mod figure_10;
mod figure_11;
mod figure_12;
mod figure_13;
mod figure_14;
mod figure_6;
mod figure_7;
mod figure_8;
mod figure_9;
mod report;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};

use fmu_master::Fmu;
use fmu_master::measure;
use fmu_master::scenario::{Scenario, Signal};
use fmu_master::{LoadedFmus, Master};
use fmu_plot::{Figure, Line, Panel, panels};
use fmu_record::Record;
use fmu_record::numbers::{axis, number};
use fmu_run::refuse_missing;

pub use self::report::{CLAIMS_STYLE, claims_table, html, json};

#[derive(Serialize)]
pub struct PaperFigure {
    /// The figure's number in the paper.
    #[serde(rename = "figure")]
    pub number: u32,
    pub title: &'static str,
    #[serde(skip)]
    reproduce: fn(&mut Laboratory) -> Result<Evidence>,
}

/// All figures that are experiments, in order.
pub const FIGURES: [PaperFigure; 10] = [
    PaperFigure { number: 1, title: "Supply voltage disturbance", reproduce: figure_1::reproduce },
    PaperFigure { number: 6, title: "Leakage and pressure over duty", reproduce: figure_6::reproduce },
    PaperFigure { number: 7, title: "Actuator hysteresis", reproduce: figure_7::reproduce },
    PaperFigure { number: 8, title: "Spring, and vacuum pump disturbance", reproduce: figure_8::reproduce },
    PaperFigure { number: 9, title: "Duty ramp and steps", reproduce: figure_9::reproduce },
    PaperFigure { number: 10, title: "Voltage compensation", reproduce: figure_10::reproduce },
    PaperFigure { number: 11, title: "Low-pressure wastegate shut or open", reproduce: figure_11::reproduce },
    PaperFigure { number: 12, title: "Controller structure", reproduce: figure_12::reproduce },
    PaperFigure { number: 13, title: "Boost pressure steps", reproduce: figure_13::reproduce },
    PaperFigure { number: 14, title: "Boost pressure under voltage steps", reproduce: figure_14::reproduce },
];

/// The paper's claims by figure, in the order of the report, without the FMUs' results.
static CLAIMS: LazyLock<BTreeMap<String, Vec<Claim>>> =
    LazyLock::new(|| toml::from_str(include_str!("claims.toml")).expect("it has the claims' keys"));

/// What a figure's experiments give.
#[derive(Serialize)]
pub struct Evidence {
    /// The drawings with their captions.
    #[serde(skip)]
    pub drawings: Vec<(&'static str, Drawing)>,
    /// The FMUs' results by the names of the claims.
    #[serde(skip)]
    results: Vec<(&'static str, f64)>,
    /// Differences from the paper's experiment, and parts that are not reproduced.
    pub notes: Vec<String>,
}

pub enum Drawing {
    /// A plot of a record.
    Plot(Figure),
    /// A picture, as SVG.
    Picture(String),
}

impl Evidence {
    fn new(results: Vec<(&'static str, f64)>) -> Self {
        Self { drawings: vec![], results, notes: vec![] }
    }

    fn drawing(mut self, caption: &'static str, drawing: impl Into<Drawing>) -> Self {
        self.drawings.push((caption, drawing.into()));
        self
    }

    fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// The claims of a figure with the FMUs' results.
    fn claims(&self, figure: u32) -> Result<Vec<Claim>> {
        let claims = &CLAIMS[&format!("figure_{figure}")];
        ensure!(claims.len() == self.results.len(), "claims.toml has other claims");
        let claim = |claim: &Claim| {
            let result = self.results.iter().find(|(name, _)| *name == claim.name);
            let (_, value) = *result.with_context(|| format!("{} has no result", claim.name))?;
            // Not for NaN.
            let holds = value >= claim.least.unwrap_or(f64::NEG_INFINITY)
                && value <= claim.most.unwrap_or(f64::INFINITY);
            Ok(Claim { holds, value, ..claim.clone() })
        };
        claims.iter().map(claim).collect()
    }

    /// The drawings that are plots.
    pub fn plots(&self) -> impl Iterator<Item = &Figure> {
        self.drawings.iter().filter_map(|(_, drawing)| match drawing {
            Drawing::Plot(plot) => Some(plot),
            Drawing::Picture(_) => None,
        })
    }
}

impl From<Figure> for Drawing {
    fn from(plot: Figure) -> Self {
        Self::Plot(plot)
    }
}

/// A claim of the paper, compared with the FMUs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Whether the FMUs' result is in the accepted range.
    #[serde(skip_deserializing)]
    holds: bool,
    /// The name in report.json, unique within the figure.
    pub name: String,
    /// What the paper says.
    pub paper: String,
    /// The paper's number in `unit`, if it prints one.
    pub paper_value: Option<f64>,
    /// The FMUs' result.
    #[serde(skip_deserializing)]
    pub value: f64,
    /// The unit of `value`, `least` and `most`.
    pub unit: String,
    /// The smallest accepted value.
    pub least: Option<f64>,
    /// The largest accepted value.
    pub most: Option<f64>,
    /// Where the result comes from.
    pub basis: Basis,
    /// How the result is computed, and the reason for the range.
    pub how: String,
    /// The known reason for a difference from the paper, if there is one.
    pub known_difference: Option<String>,
}

/// How many claims hold, such as `36 of 38 claims hold; 2 differ for known reasons`, and whether none fails.
pub fn count(figures: &[Reproduced]) -> (String, bool) {
    let claims = || figures.iter().flat_map(|figure| &figure.claims);
    let of = |verdict: &str| claims().filter(|claim| claim.verdict() == verdict).count();
    let (all, holding) = (claims().count(), of("holds"));
    let known = match of("differs") {
        0 => String::new(),
        1 => "; 1 differs for a known reason".to_owned(),
        differing => format!("; {differing} differ for known reasons"),
    };
    (format!("{holding} of {all} claims hold{known}"), of("fails") == 0)
}

/// Where a result comes from.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// Parameters were calibrated to the result.
    Calibration,
    /// The result follows from parameters chosen for other reasons.
    Prediction,
    /// The result follows from the controller's structure.
    Construction,
}

impl Claim {
    /// Whether the FMUs agree, in a word: a claim that fails for a known reason `differs`.
    pub fn verdict(&self) -> &'static str {
        match (self.holds, &self.known_difference) {
            (true, _) => "holds",
            (false, Some(_)) => "differs",
            (false, None) => "fails",
        }
    }

    /// The FMUs' result with its unit.
    pub fn found(&self) -> String {
        self.text(self.value)
    }

    /// The accepted range with its unit.
    pub fn asked(&self) -> String {
        match (self.least, self.most) {
            (Some(least), Some(most)) => format!("{} to {}", number(self.scale().1 * least), self.text(most)),
            (Some(least), None) => format!("at least {}", self.text(least)),
            (None, Some(most)) => format!("at most {}", self.text(most)),
            (None, None) => String::new(),
        }
    }

    /// The number in the paper with its unit.
    pub fn in_paper(&self) -> Option<String> {
        self.paper_value.map(|value| self.text(value))
    }

    fn text(&self, value: f64) -> String {
        let (unit, factor) = self.scale();
        format!("{} {unit}", number(factor * value)).trim_end().to_owned()
    }

    /// The unit of the figure's axes, by the range, and the factor to it.
    fn scale(&self) -> (String, f64) {
        axis(&self.unit, self.most.or(self.least).unwrap_or(self.value))
    }
}

#[derive(Serialize)]
pub struct Reproduced {
    #[serde(flatten)]
    pub figure: &'static PaperFigure,
    pub claims: Vec<Claim>,
    #[serde(flatten)]
    pub evidence: Evidence,
    /// Names and texts of the scenarios that ran.
    #[serde(skip)]
    pub scenarios: Vec<(&'static str, &'static str)>,
    /// The runs, in order.
    #[serde(skip)]
    pub runs: Vec<Run>,
}

/// A run of a figure's experiment, for others to repeat.
pub struct Run {
    pub scenario: Scenario,
    /// The recorded variables.
    pub names: Vec<String>,
}

impl Run {
    fn new(scenario: &Scenario, record: &Record) -> Self {
        let names = record.columns().iter().map(|column| column.name.clone());
        Self { scenario: scenario.clone(), names: names.collect() }
    }
}

/// Runs the experiments.
pub struct Laboratory {
    folder: PathBuf,
    fmus: LoadedFmus,
    scenarios: Vec<(&'static str, &'static str)>,
    runs: Vec<Run>,
}

impl Laboratory {
    /// Uses the `BoostPlant.fmu` and `BoostController.fmu` in a folder.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), fmus: LoadedFmus::default(), scenarios: vec![], runs: vec![] }
    }

    pub fn reproduce(&mut self, figure: &'static PaperFigure) -> Result<Reproduced> {
        let named = || format!("Fig. {}", figure.number);
        let evidence = (figure.reproduce)(self).with_context(named)?;
        Ok(Reproduced {
            figure,
            claims: evidence.claims(figure.number).with_context(named)?,
            evidence,
            scenarios: std::mem::take(&mut self.scenarios),
            runs: std::mem::take(&mut self.runs),
        })
    }

    /// The FMUs with their versions and GUIDs.
    pub fn fmus(&self) -> Vec<String> {
        let describe = |fmu: &Fmu| {
            let attribute = |name| fmu.description().attribute(name);
            format!("{} {} {}", attribute("modelName"), attribute("version"), fmu.description().guid())
        };
        self.fmus.iter().map(describe).collect()
    }

    /// A scenario of the laboratory, from its file name and text.
    fn scenario(&mut self, (name, text): (&'static str, &'static str)) -> Result<Scenario> {
        if !self.scenarios.contains(&(name, text)) {
            self.scenarios.push((name, text));
        }
        let scenario = Scenario::parse(name, text, Path::new(""), &self.folder)?;
        for member in &scenario.fmus {
            member.location.locate(refuse_missing(&member.file))?;
        }
        Ok(scenario)
    }

    fn run(&mut self, scenario: &Scenario) -> Result<Record> {
        let record = Master::new(scenario, &mut self.fmus)?.run(|_, _| ())?.record;
        self.runs.push(Run::new(scenario, &record));
        Ok(record)
    }

    /// Runs the first seconds of a scenario, to see what it records; with the plot of it, without points.
    pub fn try_out(
        &mut self,
        (name, text): (&'static str, &'static str),
        seconds: f64,
    ) -> Result<(Run, Figure)> {
        let scenario = Scenario::parse(name, text, Path::new(""), &self.folder)?;
        let mut begin = scenario.clone();
        begin.end_at(scenario.start_time + seconds)?;
        let record = Master::new(&begin, &mut self.fmus)?.run(|_, _| ())?.record;
        let title = scenario.title.as_deref().unwrap_or_default();
        let plot = panels::template(&record, title, scenario.panel_names().as_deref());
        Ok((Run::new(&scenario, &record), plot))
    }
}

/// A recorded variable over time, times a factor.
fn curve(record: &Record, name: &str, factor: f64) -> Result<Line> {
    Ok(Line::new(record.time(), record.get(name)?.iter().map(|value| factor * value)))
}

/// A panel of lines over time.
fn over_time(label: &str, height: u32, lines: impl IntoIterator<Item = Line>) -> Panel {
    lines.into_iter().fold(Panel::new("time (s)", label).height(height), Panel::line)
}

/// Boost pressure minus its reference over time (kPa).
fn boost_error(record: &Record) -> Result<Line> {
    let values = record.get("boost_pressure")?.iter().zip(record.get("boost_reference")?);
    Ok(Line::new(record.time(), values.map(|(actual, reference)| 1e-3 * actual - 1e-3 * reference)))
}

/// The steps of an input of a scenario, with their ends: beginning, value and end.
fn steps(scenario: &Scenario, input: &str) -> Vec<(f64, f64, f64)> {
    let steps = scenario.input(input).map_or(&[] as &[_], Signal::points);
    let ends = steps.iter().skip(1).map(|step| step.0).chain([scenario.stop_time]);
    steps.iter().zip(ends).map(|(&(begin, value), end)| (begin, value, end)).collect()
}

/// A scenario in the folder `scenarios`: its name and text.
macro_rules! shipped {
    ($name:literal) => {
        ($name, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/", $name)))
    };
}
pub(crate) use shipped;
