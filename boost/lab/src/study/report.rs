//! A study's results: a table of all cases, and a report with the distributions and the cases outside the criteria.

use std::io::{self, Write};
use std::iter;

use clap::ValueEnum as _;
use serde::Serialize;

use super::case::{Faulty, Measures};
use super::criteria::{Criterion, FAST_AT_REST, NEAR};
use super::draw::Case;
use super::fault::FaultKind;
use super::names::{BOOST, MODEL, SHAFT, TRUE_BOOST};
use super::situation::Situation;
use super::{Explained, Outcome, Study};
use fmu_master::measure::greatest;
use fmu_plot::{Cell, Figure, Line, Panel, Report, Table, color, escaped};
use fmu_record::numbers::{axis, number, quantity};

/// The shares of the cases below the quantiles of the tables, of which a study has those that it has cases for.
const QUANTILES: [f64; 6] = [0.5, 0.9, 0.95, 0.99, 0.999, 1.0];
/// Drawn values in a row of a case's table.
const DRAWN_IN_ROW: usize = 3;
/// Number of plotted quantities: those with the strongest correlation.
const PLOTTED: usize = 6;

type Get = fn(&Measures) -> Option<f64>;

/// The measures with a distribution: name, unit, factor to it, and value.
const DISTRIBUTIONS: [(&str, &str, f64, Get); 11] = [
    ("worst deviation from the reachable reference", "kPa", 1e-3, |measures| Some(measures.deviation)),
    ("largest overshoot over a reference step", "kPa", 1e-3, |measures| Some(measures.overshoot)),
    ("maximum high-pressure shaft speed at rest", "krpm", 1e-3, |measures| measures.shaft_at_rest),
    ("maximum high-pressure shaft speed in transients", "krpm", 1e-3, |measures| {
        measures.shaft_in_transients
    }),
    ("movement back on the way to a new reference", "kPa", 1e-3, |measures| Some(measures.dip)),
    ("longest rise to 95 % of what can be held", "s", 1.0, |measures| measures.rise),
    ("highest tank pressure", "kPa", 1e-3, |measures| measures.tank),
    ("share of the time with the pump on", "%", 100.0, |measures| measures.pump),
    ("way of the duty", "%/s", 1.0, |measures| measures.duty_travel),
    ("highest boost without vacuum", "kPa", 1e-3, |measures| Some(measures.unaided.as_ref()?.boost)),
    ("maximum shaft speed without vacuum", "krpm", 1e-3, |measures| measures.unaided.as_ref()?.shaft),
];

/// A study with its results.
pub struct StudyReport<'a> {
    pub study: &'a Study,
    pub outcomes: &'a [Outcome],
    pub explained: &'a [Explained],
}

#[derive(Serialize)]
struct Json<'a> {
    plant: &'a str,
    controller: &'a str,
    seed: u64,
    cases: usize,
    strategies: Vec<JsonStrategy>,
    outside: Vec<JsonCase>,
}

#[derive(Serialize)]
struct JsonStrategy {
    strategy: String,
    criteria: Vec<Criterion>,
    /// Quantiles by measure, in the order of `shares`.
    shares: Vec<f64>,
    quantiles: Vec<(String, Vec<f64>)>,
}

#[derive(Serialize)]
struct JsonCase {
    case: usize,
    measures: Measures,
    /// The deviation of the best control found, in the window around the worst moment (Pa).
    optimum: Option<f64>,
    cause: Option<String>,
}

/// The worst of the cases with a fault, of which [`FAULT_COLUMNS`] names the numbers.
struct ByFault {
    fault: String,
    cases: usize,
    worst: [String; 9],
}

const FAULT_COLUMNS: [&str; 9] = [
    "with a code",
    "latest code (s)",
    "excess before the code (kPa)",
    "excess (kPa)",
    "without limp-home",
    "deficit (kPa)",
    "without limp-home",
    "shaft (krpm)",
    "without limp-home",
];

/// A number to a tenth.
fn number_of(value: f64) -> String {
    format!("{value:.1}")
}

/// How many of a number of values are up to the quantile of a share.
fn rank(share: f64, values: usize) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to the number of values
    let rank = (share * values as f64).ceil() as usize;
    rank
}

/// The quantile: the smallest value not exceeded by at least this share of the values.
fn quantile(ascending: &[f64], share: f64) -> f64 {
    ascending.get(rank(share, ascending.len()).saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

impl StudyReport<'_> {
    fn strategy_name(&self, index: usize) -> String {
        self.study.strategies[index].clone().unwrap_or_else(|| "default strategy".to_owned())
    }

    fn measures(&self, strategy: usize) -> Vec<Option<&Measures>> {
        self.outcomes.iter().map(|outcome| outcome.runs.get(strategy)?.measures.as_ref()).collect()
    }

    pub fn criteria(&self, strategy: usize) -> Vec<Criterion> {
        self.study.required().judge(&self.measures(strategy))
    }

    /// Whether the judged strategy meets all criteria.
    pub fn passes(&self) -> bool {
        self.criteria(0).iter().all(|criterion| criterion.met)
    }

    /// A strategy's values of a measure, ascending, in the unit of [`DISTRIBUTIONS`].
    fn ascending(&self, strategy: usize, measure: usize) -> Vec<f64> {
        let (_, _, factor, get) = DISTRIBUTIONS[measure];
        let values = self.measures(strategy).into_iter().flatten().filter_map(get);
        let mut values: Vec<_> = values.map(|value| factor * value).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// The [`QUANTILES`] that are not the worst case under another name.
    fn shares(&self) -> impl Iterator<Item = f64> {
        let cases = self.outcomes.len();
        QUANTILES.into_iter().filter(move |&share| share >= 1.0 || rank(share, cases) < cases)
    }

    fn quantiles(&self, ascending: &[f64]) -> impl Iterator<Item = String> {
        self.shares().map(|share| format!("{:.2}", quantile(ascending, share)))
    }

    /// The criteria as lines of text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for strategy in 0..self.study.strategies.len() {
            text += &format!("{}\n", self.strategy_name(strategy));
            for criterion in self.criteria(strategy) {
                let word = if criterion.met { "met:" } else { "NOT MET:" };
                let found = criterion.found.as_deref().unwrap_or("not available");
                text +=
                    &format!("  {word:8} {}: {found} (required: {})\n", criterion.name, criterion.required);
            }
            for (measure, (name, unit, ..)) in DISTRIBUTIONS.iter().enumerate() {
                let values = self.ascending(strategy, measure);
                if !values.is_empty() {
                    text += &format!("           {name} ({unit}): {}\n", join(self.quantiles(&values)));
                }
            }
        }
        text += &format!("  quantiles: {}\n", join(self.shares().map(share_name)));
        for ByFault { fault, cases, worst } in self.by_fault() {
            let worst = FAULT_COLUMNS.iter().zip(worst).map(|(name, value)| format!("{name} {value}"));
            text += &format!("  {fault}: {cases} cases; {}\n", join(worst));
        }
        text
    }

    /// The worst of each fault's cases, of the judged strategy.
    fn by_fault(&self) -> Vec<ByFault> {
        let faulty: Vec<_> = self
            .outcomes
            .iter()
            .filter_map(|outcome| outcome.runs.first()?.measures.as_ref()?.faulty.as_ref())
            .collect();
        let of_kind = |kind: &FaultKind| {
            let cases: Vec<_> = faulty.iter().filter(|faulty| faulty.kind == *kind).collect();
            let worst = |factor: f64, get: &dyn Fn(&Faulty) -> Option<f64>| {
                let values = cases.iter().filter_map(|faulty| get(faulty));
                values
                    .max_by(f64::total_cmp)
                    .map_or_else(|| "\u{2013}".to_owned(), |value| number_of(factor * value))
            };
            let found = cases.iter().filter(|faulty| faulty.code_after.is_some()).count();
            (!cases.is_empty()).then(|| ByFault {
                fault: kind.name(),
                cases: cases.len(),
                worst: [
                    format!("{found}"),
                    worst(1.0, &|faulty| faulty.code_after),
                    worst(1e-3, &|faulty| Some(faulty.excess_before_code)),
                    worst(1e-3, &|faulty| Some(faulty.with.excess)),
                    worst(1e-3, &|faulty| Some(faulty.without.as_ref()?.excess)),
                    worst(1e-3, &|faulty| Some(faulty.with.deficit)),
                    worst(1e-3, &|faulty| Some(faulty.without.as_ref()?.deficit)),
                    worst(1e-3, &|faulty| faulty.with.shaft),
                    worst(1e-3, &|faulty| faulty.without.as_ref()?.shaft),
                ],
            })
        };
        FaultKind::value_variants().iter().filter_map(of_kind).collect()
    }

    pub fn json(&self) -> anyhow::Result<String> {
        let strategies = (0..self.study.strategies.len()).map(|strategy| JsonStrategy {
            strategy: self.strategy_name(strategy),
            criteria: self.criteria(strategy),
            shares: self.shares().collect(),
            quantiles: (0..DISTRIBUTIONS.len())
                .map(|measure| {
                    let values = self.ascending(strategy, measure);
                    let name = format!("{} ({})", DISTRIBUTIONS[measure].0, DISTRIBUTIONS[measure].1);
                    (name, self.shares().map(|share| quantile(&values, share)).collect())
                })
                .collect(),
        });
        let outside = self.study.outside(self.outcomes).into_iter().map(|(case, measures)| {
            let explained = self.explained.iter().find(|explained| explained.case.number == case);
            JsonCase {
                case,
                measures,
                optimum: explained.and_then(|explained| Some(explained.optimum.as_ref()?.deviation)),
                cause: explained.map(|explained| self.cause(explained)),
            }
        });
        let report = Json {
            plant: self.study.rig.plant.description().attribute("modelName"),
            controller: self.study.rig.controller.description().attribute("modelName"),
            seed: self.study.rig.seed,
            cases: self.outcomes.len(),
            strategies: strategies.collect(),
            outside: outside.collect(),
        };
        Ok(serde_json::to_string_pretty(&report)? + "\n")
    }

    pub fn html(&self) -> String {
        let title = format!(
            "{} on {} random plants and ambient conditions",
            self.study.rig.controller.description().attribute("modelName"),
            self.outcomes.len()
        );
        let mut report = Report::new(&title);
        self.introduction(&mut report);
        self.judged(&mut report);
        self.distributions(&mut report);
        self.influences(&mut report);
        self.one_by_one(&mut report);
        report.page("")
    }

    fn introduction(&self, report: &mut Report) {
        let passes = self.passes();
        let bound = if self.study.rig.saves_states {
            "In transients, the benchmark is a control that knows the plant, tried on the plant itself from its state at \
             each step and at the start of each ramp; no control has to do better."
        } else {
            "The plant cannot save its state, so its fastest possible response is not considered."
        };
        let verdict =
            if passes { "Passed: all criteria are met." } else { "Failed: a criterion is not met." };
        report.verdict(verdict, passes);
        let situation = self.study.cases.situation;
        let judged = if situation.is_benchmarked() {
            format!(
                "A case is judged by its largest deviation from the <em>reachable</em> reference, the reference clipped to \
                 what the plant can hold at rest: from above with its wastegates shut or its shaft at 205 krpm, from below \
                 with all valves open. {bound} After a reference step, any pressure between the old and the new reference \
                 is accepted until 1.5 s after boost could have reached the new one."
            )
        } else {
            "The deviation is how far boost exceeds its reference, or where that is below it what the plant can hold; \
             boost that is too low does not count."
                .to_owned()
        };
        report.html(&format!(
            "<p>Plant: {}. The cases are a Latin hypercube (seed {}) of plant parameters between the FMU's values and \
             those of each set, and the other quantities of results.csv. What happens: {}. {judged}</p>\n",
            escaped(self.study.rig.plant.description().attribute("modelName")),
            self.study.rig.seed,
            escaped(&situation.description()),
        ));
        for note in &self.study.cases.notes {
            report.paragraph(note);
        }
    }

    fn judged(&self, report: &mut Report) {
        let strategies = 0..self.study.strategies.len();
        let names: Vec<_> = strategies.clone().map(|strategy| self.strategy_name(strategy)).collect();
        let all: Vec<_> = strategies.clone().map(|strategy| self.criteria(strategy)).collect();
        report.section("Criteria");
        let mut table = Table::new(["", "required"].into_iter().chain(names.iter().map(String::as_str)));
        for (index, criterion) in all[0].iter().enumerate() {
            let found = all.iter().map(|criteria| {
                let Criterion { found, met, .. } = &criteria[index];
                Cell::verdict(found.as_deref().unwrap_or("not available"), *met)
            });
            table.row([criterion.name.into(), (&criterion.required).into()].into_iter().chain(found));
        }
        report.table(&table);
        if self.study.cases.situation == Situation::Faults {
            report.section("Faults");
            let mut table = Table::new(["fault", "cases"].into_iter().chain(FAULT_COLUMNS));
            for ByFault { fault, cases, worst } in self.by_fault() {
                let numbers = iter::once(cases.to_string()).chain(worst);
                table.row(iter::once(fault.into()).chain(numbers.map(|text| Cell::number(&text))));
            }
            report.table(&table);
        }
        report.section("Quantiles");
        let mut table = Table::new(iter::once(String::new()).chain(self.shares().map(share_name)));
        for (measure, (name, unit, ..)) in DISTRIBUTIONS.iter().enumerate() {
            for strategy in strategies.clone() {
                let values = self.ascending(strategy, measure);
                if !values.is_empty() {
                    let strategy = match &names[..] {
                        [_] => String::new(),
                        names => format!(", {}", names[strategy]),
                    };
                    let numbers = self.quantiles(&values).map(|text| Cell::number(&text));
                    table.row(iter::once(format!("{name} ({unit}){strategy}").into()).chain(numbers));
                }
            }
        }
        report.table(&table);
    }

    fn distributions(&self, report: &mut Report) {
        let panel = |measure: usize| {
            let (name, unit, ..) = DISTRIBUTIONS[measure];
            let mut panel = Panel::new(unit, "share of cases (%)").title(name).y_range(0.0, 100.0);
            for strategy in 0..self.study.strategies.len() {
                let values = self.ascending(strategy, measure);
                let count = values.len() as f64;
                let shares = (1..=values.len()).map(|rank| 100.0 * rank as f64 / count);
                let line =
                    Line::new(&values, shares).held().color(color::CYCLE[strategy % color::CYCLE.len()]);
                panel = panel.line(line.label(&self.strategy_name(strategy)));
            }
            panel
        };
        let has_values = |measure: &usize| !self.ascending(0, *measure).is_empty();
        let figures = (0..DISTRIBUTIONS.len()).filter(has_values).map(panel);
        let figure = figures.fold(Figure::new(), |figure, panel| figure.row([panel]));
        report.section("Distributions");
        report.figure(&figure, "Share of cases up to each value.");
    }

    /// The influences on the deviation.
    fn influences(&self, report: &mut Report) {
        let known: Vec<_> = self
            .outcomes
            .iter()
            .filter_map(|outcome| Some((outcome.case, outcome.runs[0].measures.as_ref()?.deviation)))
            .collect();
        let deviations: Vec<_> = known.iter().map(|(_, deviation)| 1e-3 * deviation).collect();
        let drawn: Vec<_> = known.iter().map(|(case, _)| self.study.cases.case(*case).drawn).collect();
        let columns = self.study.cases.columns().into_iter().zip(self.study.cases.units());
        let mut influences: Vec<_> = columns
            .enumerate()
            .map(|(column, (name, unit))| {
                let values: Vec<_> = drawn.iter().map(|values| values[column].1).collect();
                let (unit, factor) = axis(unit, greatest(values.iter().map(|value| value.abs())));
                let label = format!("{name} ({})", if unit.is_empty() { "share" } else { &unit });
                let correlation = rank_correlation(&values, &deviations);
                (label, correlation, values.into_iter().map(|value| factor * value).collect::<Vec<_>>())
            })
            .collect();
        influences.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let panels = influences.iter().take(PLOTTED).map(|(label, correlation, values)| {
            let interval = confidence(*correlation, values.len());
            let interval = interval.map_or_else(
                || "too few cases".to_owned(),
                |(from, to)| {
                    format!(
                        "95 %: {from:.2} to {to:.2}{}",
                        if from * to > 0.0 { "" } else { ", may be noise" }
                    )
                },
            );
            let title = format!("rank correlation {correlation:.2} ({interval})").replace('-', "\u{2212}");
            Panel::new(label, "deviation (kPa)")
                .title(&title)
                .line(Line::new(values, deviations.iter().copied()).dots())
        });
        let panels: Vec<_> = panels.collect();
        let figure = panels.chunks(3).fold(Figure::new(), |figure, row| figure.row(row.to_vec()));
        report.section("Influences on the deviation");
        report.figure(
            &figure,
            "Worst deviation of each case over the drawn quantities with the strongest correlation, with its 95 % \
             confidence interval: an interval that includes 0 may be noise. Parameter sets: share from 0 (the FMU's value) to 1.",
        );
    }

    fn one_by_one(&self, report: &mut Report) {
        let all = self.study.outside(self.outcomes);
        report.section("Cases outside the bounds");
        for outcome in self.outcomes {
            if let Some(error) = &outcome.runs[0].error {
                report.paragraph(&format!("Case {} failed to run: {error}", outcome.case));
            }
        }
        report.paragraph(&format!(
            "{} of {} cases are outside. Allowed are: {}.",
            all.len(),
            self.outcomes.len(),
            self.study.required().sentence()
        ));
        if all.len() > self.explained.len() {
            report.paragraph(&format!("Shown: the worst {}; results.csv has all.", self.explained.len()));
        }
        for explained in self.explained {
            self.explanation(report, explained);
        }
    }

    fn explanation(&self, report: &mut Report, explained: &Explained) {
        let Explained { case, measures, .. } = explained;
        let Case { number, .. } = case;
        report.section_of(
            &format!("case-{number}"),
            &format!("Case {number}: {:.2} kPa", 1e-3 * measures.deviation),
        );
        report.paragraph(&self.cause(explained));
        report.figure(
            &traces(explained),
            "Closed loop, and best control found, if it was searched, from a second before boost left the reachable \
             range. Shaded: from a second before the worst moment to half a second after it.",
        );
        let drawn = case.drawn.iter().zip(self.study.cases.units());
        let drawn: Vec<_> =
            drawn.map(|((name, value), unit)| [name.into(), Cell::number(&quantity(*value, unit))]).collect();
        let mut table = Table::default().class("pairs");
        drawn.chunks(DRAWN_IN_ROW).for_each(|row| table.row(row.concat()));
        report.table(&table);
        let rig = &self.study.rig;
        let scenario = rig.text(case, rig.variant(self.study.strategies[0].as_deref()));
        report.details("Scenario for cargo fmu simulate", &scenario);
    }

    /// Why a case is outside, as far as the numbers show.
    fn cause(&self, explained: &Explained) -> String {
        let Explained { case, measures, simulated, optimum } = explained;
        let time = measures.deviation_time;
        let row = super::case::point(time);
        let [duty, low_pressure, bypass] = simulated.valves(row.saturating_sub(1));
        let begun = case.experiment.events.iter().filter(|event| event.begin <= time);
        let after = match begun.max_by(|a, b| a.begin.total_cmp(&b.begin)) {
            Some(event) if event.is_step => format!("{:.2} s after a reference step", time - event.begin),
            Some(event) if time <= event.end => {
                format!("{:.2} s into an engine speed ramp", time - event.begin)
            }
            Some(event) => format!("{:.2} s after an engine speed ramp", time - event.end),
            None => "before anything moves".to_owned(),
        };
        let fault = case
            .experiment
            .fault
            .as_ref()
            .map_or_else(String::new, |fault| format!("Fault: {}. ", fault.kind.name()));
        let side = if measures.is_above { "high" } else { "low" };
        let mut text = format!(
            "{fault}Boost is {:.2} kPa too {side} at {time:.2} s, {after}, at {:.0} rpm ({:+.0} rpm/s), with {duty:.1} % \
             high-pressure wastegate duty, the low-pressure wastegate {:.0} % and the bypass {:.0} % open. ",
            1e-3 * measures.deviation,
            case.experiment.engine_speed.at(time),
            (case.experiment.engine_speed.at(time) - case.experiment.engine_speed.at(time - 0.1)) / 0.1,
            100.0 * low_pressure,
            100.0 * bypass,
        );
        let aim = simulated.record.get(MODEL).ok().map(|pressures| pressures[row]);
        if let Some(aim) = aim.filter(|aim| !measures.is_above && *aim < simulated.lower[row] - NEAR) {
            text += &format!(
                "The controller aims at only {:.1} of {:.1} kPa reachable. ",
                1e-3 * aim,
                1e-3 * simulated.lower[row]
            );
        }
        if let Some(optimum) = optimum {
            let (best, own) = (1e-3 * optimum.deviation, 1e-3 * optimum.closed_loop);
            text += &if optimum.deviation > NEAR {
                format!(
                    "Not explained by the search: the best valve movement found, with full knowledge, deviates by {best:.2} kPa."
                )
            } else if optimum.deviation > 0.5 * optimum.closed_loop {
                format!(
                    "Mostly the plant's limit: the best valve movement found, with full knowledge, deviates by {best:.2} kPa, the loop by {own:.2} kPa."
                )
            } else {
                format!(
                    "Within the plant's reach: a control with full knowledge stays within {best:.2} kPa, the loop within {own:.2} kPa."
                )
            };
        }
        let required = self.study.required();
        if required.is_failed(measures) {
            if let Some(code) = measures.alarm.filter(|code| *code != 0.0) {
                text += &format!(" Alarm: fault_code {code}.");
            }
            if let Some(flow) = measures.least_flow.filter(|flow| *flow < 0.0) {
                text += &format!(" A compressor surges: {:.2} g/s.", 1e3 * flow);
            }
            if let Some(speed) = measures.shaft_at_rest.filter(|speed| *speed > FAST_AT_REST) {
                text += &format!(" Shaft speed at rest: {:.1} krpm.", 1e-3 * speed);
            }
            text += &format!(" It is among the {}.", join(required.violated(measures).map(str::to_owned)));
        }
        text
    }
}

fn traces(explained: &Explained) -> Figure {
    let Explained { simulated, optimum, measures, .. } = explained;
    let time = simulated.record.time();
    let window = (measures.deviation_time - 1.0, measures.deviation_time + 0.5);
    let own = |name: &str, factor: f64| {
        let values = simulated.record.get(name).ok()?;
        Some(Line::new(time, values.iter().map(|value| factor * value)))
    };
    let kilopascal = |values: &[f64]| values.iter().map(|value| 1e-3 * value).collect::<Vec<_>>();
    let found = optimum.as_ref();
    let best = |values: Vec<f64>| Some(Line::new(&found?.times, values));
    let valve = |index: usize| best(found?.valves.iter().map(|valves| valves[index]).collect());
    let colored = |line: Option<Line>, label: &str, color| Some(line?.label(label).color(color));
    let edge = |values: &[f64]| Line::new(time, kilopascal(values)).color(color::GRAY).thin();
    let boost = [
        Some(edge(&simulated.lower).label("reachable, from")),
        Some(edge(&simulated.upper).dashed().label("to")),
        colored(own("boost_reference", 1e-3), "reference", color::INK),
        colored(own(TRUE_BOOST, 1e-3).or_else(|| own(BOOST, 1e-3)), "closed loop", color::BLUE),
        colored(found.and_then(|found| best(kilopascal(&found.boost))), "best found", color::VERMILION),
    ];
    let speed = [colored(own("engine_speed", 1.0), "engine speed", color::INK)];
    let duty = [
        colored(own("hp_wastegate_pwm", 1.0), "high-pressure wastegate", color::BLUE),
        colored(valve(0), "best found", color::VERMILION),
    ];
    let openings = [
        colored(own("lp_wastegate", 1.0), "low-pressure wastegate", color::BLUE),
        colored(own("hp_bypass", 1.0), "bypass", color::GREEN),
        colored(valve(1), "best low-pressure wastegate", color::VERMILION),
        colored(valve(2), "best bypass", color::ORANGE),
    ];
    let shaft = [
        colored(own(SHAFT, 1e-3), "high-pressure shaft", color::BLUE),
        colored(found.and_then(|found| best(kilopascal(&found.shaft))), "best found", color::VERMILION),
    ];
    let panel = |label: &str, height: u32, lines: &[Option<Line>]| {
        let panel = Panel::new("time (s)", label).x_band(window.0, window.1).height(height);
        [lines.iter().flatten().cloned().fold(panel, Panel::line)]
    };
    Figure::new()
        .row(panel("boost (kPa)", 220, &boost))
        .row(panel("engine (rpm)", 100, &speed))
        .row(panel("duty (%)", 110, &duty))
        .row(panel("opening", 130, &openings))
        .row(panel("shaft (krpm)", 110, &shaft))
        .shared_x()
}

fn share_name(share: f64) -> String {
    if share < 1.0 { format!("{} %", number(100.0 * share)) } else { "worst".to_owned() }
}

fn join(texts: impl Iterator<Item = String>) -> String {
    texts.collect::<Vec<_>>().join(", ")
}

/// Spearman's rank correlation of values without ties.
fn rank_correlation(one: &[f64], other: &[f64]) -> f64 {
    let ranks = |values: &[f64]| {
        let mut order: Vec<_> = (0..values.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let mut ranks = vec![0.0; values.len()];
        for (rank, index) in order.into_iter().enumerate() {
            ranks[index] = rank as f64;
        }
        ranks
    };
    let count = one.len() as f64;
    let squares: f64 = ranks(one).iter().zip(ranks(other)).map(|(a, b)| (a - b) * (a - b)).sum();
    1.0 - 6.0 * squares / (count * (count * count - 1.0)).max(1.0)
}

/// The 95 % confidence interval of a rank correlation (Bonett and Wright 2000); none for too few values.
fn confidence(correlation: f64, count: usize) -> Option<(f64, f64)> {
    let freedom = count.checked_sub(3).filter(|freedom| *freedom > 0)? as f64;
    let error = ((1.0 + correlation * correlation / 2.0) / freedom).sqrt();
    let [from, to] = [-1.96, 1.96].map(|quantile| (correlation.atanh() + quantile * error).tanh());
    Some((from, to))
}

/// The numbers in the table of all cases.
const NUMBERS: [(&str, Get); 22] = [
    ("deviation", |measures| Some(measures.deviation)),
    ("deviation_time", |measures| Some(measures.deviation_time)),
    ("overshoot", |measures| Some(measures.overshoot)),
    ("shaft_at_rest", |measures| measures.shaft_at_rest),
    ("shaft_in_transients", |measures| measures.shaft_in_transients),
    ("least_compressor_flow", |measures| measures.least_flow),
    ("fault_code", |measures| measures.alarm),
    ("dip", |measures| Some(measures.dip)),
    ("rise_time", |measures| measures.rise),
    ("tank_pressure", |measures| measures.tank),
    ("pump_share", |measures| measures.pump),
    ("duty_travel", |measures| measures.duty_travel),
    ("boost_without_vacuum", |measures| Some(measures.unaided.as_ref()?.boost)),
    ("shaft_without_vacuum", |measures| measures.unaided.as_ref()?.shaft),
    ("code_after", |measures| measures.faulty.as_ref()?.code_after),
    ("excess_before_code", |measures| Some(measures.faulty.as_ref()?.excess_before_code)),
    ("excess", |measures| Some(measures.faulty.as_ref()?.with.excess)),
    ("excess_without_limp_home", |measures| Some(measures.faulty.as_ref()?.without.as_ref()?.excess)),
    ("deficit", |measures| Some(measures.faulty.as_ref()?.with.deficit)),
    ("deficit_without_limp_home", |measures| Some(measures.faulty.as_ref()?.without.as_ref()?.deficit)),
    ("shaft", |measures| measures.faulty.as_ref()?.with.shaft),
    ("shaft_without_limp_home", |measures| measures.faulty.as_ref()?.without.as_ref()?.shaft),
];

/// The table of all cases: a row for each case and strategy.
pub fn csv(report: &StudyReport<'_>, writer: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(writer);
    let columns = report.study.cases.columns();
    let mut names: Vec<_> = NUMBERS.iter().map(|(name, _)| *name).collect();
    names.insert(2, "is_above");
    let required = report.study.required();
    let names = ["case", "strategy", "verdict", "fault"].into_iter().chain(names).chain(["error"]);
    csv.write_record(names.chain(columns.iter().map(String::as_str)))?;
    for outcome in report.outcomes {
        let Case { drawn, experiment, .. } = report.study.cases.case(outcome.case);
        let fault = experiment.fault.map_or_else(String::new, |fault| fault.kind.name());
        for (strategy, run) in outcome.runs.iter().enumerate() {
            let text = |value: f64| format!("{value:?}");
            let measured = run.measures.as_ref();
            let verdict = match measured {
                Some(measures) if required.is_failed(measures) => "fail",
                Some(measures) if required.is_outside(measures) => "beyond 2 kPa",
                Some(_) => "pass",
                None => "error",
            };
            let numbers = NUMBERS.iter().map(|(_, get)| measured.and_then(get).map(text).unwrap_or_default());
            let mut numbers: Vec<_> = numbers.collect();
            numbers.insert(2, measured.map(|measures| measures.is_above.to_string()).unwrap_or_default());
            let strategy = report.study.strategies[strategy].clone().unwrap_or_default();
            let row = [outcome.case.to_string(), strategy, verdict.to_owned(), fault.clone()].into_iter();
            let row = row.chain(numbers);
            let row = row.chain([run.error.clone().unwrap_or_default()]);
            csv.write_record(row.chain(drawn.iter().map(|(_, value)| text(*value))))?;
        }
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_the_sample() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        for (share, expected) in [(0.5, 10.0), (0.95, 19.0), (0.96, 20.0), (1.0, 20.0)] {
            assert!((quantile(&values, share) - expected).abs() < 1e-12, "{share}");
        }
        assert!(quantile(&[], 0.5).is_nan());
    }

    /// With the formula of their paper, by hand: 0.5 of 103 values; a weak correlation of few is noise.
    #[test]
    fn the_confidence_of_a_correlation_depends_on_the_number_of_values() {
        let (from, to) = confidence(0.5, 103).unwrap();
        // The hyperbolic tangents of 0.5493 minus and plus 1.96 · 0.10607.
        assert!((from - 0.3287).abs() < 1e-4 && (to - 0.6394).abs() < 1e-4, "{from} {to}");
        let (from, to) = confidence(-0.4, 10).unwrap();
        assert!(from < 0.0 && to > 0.0);
        assert_eq!(confidence(0.9, 3), None);
    }

    #[test]
    fn ranks_correlate_whatever_the_scale() {
        let rising = [1.0, 2.0, 30.0, 400.0];
        assert!((rank_correlation(&rising, &[-5.0, 0.0, 1.0, 1.1]) - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&rising, &[4.0, 3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
        // Squares of differences 1, 1, 1, 1: 1 - 6 * 4 / (4 * 15).
        assert!((rank_correlation(&rising, &[2.0, 1.0, 4.0, 3.0]) - 0.6).abs() < 1e-12);
    }
}
