//! The reports of a tuning: a self-contained report.html for readers, and report.json for programs.

use std::collections::BTreeMap;

use anyhow::Result;
use serde::Serialize;

use super::bench::drawn_samples;
use super::comparison::Compared;
use super::{Cell, CellOrigin, Point, Procedure, Schedule, ScheduleTable, Sweep, Tuning};
use fmu_master::measure::greatest;
use fmu_plot::{Figure, Line, Panel, Report, Table, color, escaped};
use fmu_record::numbers::{estimate, quantity};

const STYLE: &str = "
sub { line-height: 0; }
.map, .points { font-size: .75rem; line-height: 1.35; font-variant-numeric: tabular-nums; }
.maps { display: flex; flex-wrap: wrap; gap: 1.6rem 2rem; } .maps > div { max-width: 100%; }
.map { width: auto; margin: 0; } .map caption { font-size: .85rem; } .map th, .map td { padding: .16em .35em; white-space: nowrap; }
.map td { text-align: center; border: 1px solid var(--paper); } .map th { color: var(--faint); text-align: right; border: none; }
.map thead th { text-align: center; } .map :is(th, td):first-child { position: sticky; left: 0; background: var(--paper); }
.filled { color: var(--faint); font-style: italic; background: repeating-linear-gradient(135deg, var(--shade) 0 4px, var(--paper) 4px 8px); } .raised { text-decoration: underline; text-underline-offset: 2px; }
.key { max-width: 46rem; } .key td { padding: .1em .7em; border: none; } .settings { max-width: 58rem; }
.points th, .points td { padding: .2em .5em .2em 0; white-space: nowrap; }
";

const DRAWN_POINTS: usize = 6;
/// Responses are drawn up to this many time constants, when they have settled.
const DRAWN_TIME_CONSTANTS: f64 = 5.0;

#[derive(Serialize)]
struct TuningReport<'a> {
    plant: &'a str,
    plant_parameters: String,
    #[serde(flatten)]
    schedule: &'a Schedule,
    procedure: &'a Procedure,
    least_duty: f64,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    dynamics: BTreeMap<&'static str, f64>,
    #[serde(skip_serializing_if = "<[f64]>::is_empty")]
    boost_limits: &'a [f64],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    comparison: &'a [Compared],
    notes: &'a [String],
    sweeps: &'a [Sweep],
    cells: Vec<JsonCell<'a>>,
}

#[derive(Serialize)]
struct JsonCell<'a> {
    engine_speed: f64,
    boost_reference: f64,
    #[serde(flatten)]
    cell: &'a Cell,
    responses: Option<&'a Point>,
}

pub fn json(tuning: &Tuning) -> Result<String> {
    let schedule = &tuning.task.schedule;
    let cells = tuning.cells.iter().map(|cell| JsonCell {
        engine_speed: schedule.engine_speeds[cell.column],
        boost_reference: schedule.boost_references[cell.row],
        cell,
        responses: tuning.point(cell.row, cell.column),
    });
    let report = TuningReport {
        plant: tuning.task.plant.description().attribute("modelName"),
        plant_parameters: tuning.task.plant_parameters_written(),
        schedule,
        procedure: &tuning.task.procedure,
        least_duty: tuning.least_duty(),
        dynamics: tuning
            .dynamics()
            .into_iter()
            .filter_map(|(name, _, _, value)| Some((name, value?)))
            .collect(),
        boost_limits: &tuning.boost_limits,
        comparison: &tuning.comparison,
        notes: &tuning.notes,
        sweeps: &tuning.sweeps,
        cells: cells.collect(),
    };
    Ok(serde_json::to_string_pretty(&report)? + "\n")
}

pub fn html(tuning: &Tuning) -> String {
    let title = format!(
        "{} tuned to {}",
        tuning.task.schedule.controller,
        tuning.task.plant.description().attribute("modelName")
    );
    let mut report = Report::new(&title);
    introduction(&mut report, tuning);
    before_and_after(&mut report, tuning);
    identified_maps(&mut report, tuning);
    feedback_maps(&mut report, tuning);
    static_maps(&mut report, tuning);
    responses(&mut report, tuning);
    points(&mut report, tuning);
    report.page(STYLE)
}

fn introduction(report: &mut Report, tuning: &Tuning) {
    let (task, procedure) = (&tuning.task, &tuning.task.procedure);
    let [identified, others] = tuning.counts();
    let holds = tuning.sweeps.iter().flat_map(|sweep| &sweep.holds);
    let sweep_drift = greatest(holds.map(|hold| hold.drift.abs()));
    let point_drift = greatest(tuning.points.iter().map(|point| point.hold.drift.abs()));
    let mut rows = vec![
        ("Plant", task.plant.description().attribute("modelName").to_owned()),
        ("Plant parameters", task.plant_parameters_written()),
        ("Controller", task.schedule.controller.clone()),
        ("\u{3bb}, desired closed-loop time constant", quantity(task.schedule.lambda, "s")),
        ("Supply voltage", quantity(task.schedule.nominal_voltage, "V")),
        ("Sample time", quantity(1e3 * task.schedule.sample_time, "ms")),
        ("Duty step", format!("\u{b1}{} %", procedure.duty_step)),
        ("Grid points", format!("{}: {identified} identified, {others}", tuning.cells.len())),
        ("Wastegate lift-off, used as the controller's minimum duty", quantity(tuning.least_duty(), "%")),
        (
            "Boost pressure drift in the last second of a hold",
            format!("at most {sweep_drift:.0} Pa in the sweeps, {point_drift:.0} Pa before the steps"),
        ),
    ];
    for (name, unit, source, value) in tuning.dynamics() {
        let text = value.map(|value| format!("{}, {source}", quantity((1e3 * value).round() / 1e3, unit)));
        rows.extend(text.map(|text| (name, text)));
    }
    report.html(&format!(
        "<p>The plant was held at each engine speed with low-pressure wastegate and bypass shut and throttle open. A \
         downward duty sweep gives the static map; its inverse, by monotone cubic interpolation, is the feedforward. At \
         each boost reference reached between {} % and {} % duty, the plant settled for {} s at the feedforward and was \
         then stepped up and down from the same state for {} s. Gain <i>K<sub>p</sub></i>, time constant <i>T</i> and \
         delay <i>L</i> are the least-squares fit of a first-order model with delay to the mean of both responses. The \
         sum of squares has a kink wherever the delay crosses a sample, so the delay is searched on a grid that is \
         refined around the best value; for each delay, the Levenberg-Marquardt method finds gain and time \
         constant.</p>\n",
        procedure.fitted_duty.0,
        procedure.fitted_duty.1,
        procedure.settling_duration,
        procedure.response_duration,
    ));
    let mut table = Table::default().class("settings");
    for (name, value) in rows {
        table.row([name.into(), value.into()]);
    }
    report.table(&table);
    for note in &tuning.notes {
        report.paragraph(note);
    }
}

/// The loop before and after.
fn before_and_after(report: &mut Report, tuning: &Tuning) {
    if tuning.comparison.is_empty() {
        return;
    }
    report.section("Before and after");
    report.paragraph(
        "The loop of this plant with the controller as it is, and with schedule.ssv. Deviations of the study's cases are \
         from what the plant can reach.",
    );
    let mut table = Table::new(["", "", "before", "after"]);
    for Compared { experiment, measure, unit, before, after } in &tuning.comparison {
        let numbers = [before, after].map(|value| fmu_plot::Cell::number(&format!("{value:.2} {unit}")));
        let [before, after] = numbers;
        table.row([experiment.as_str().into(), (*measure).into(), before, after]);
    }
    report.table(&table);
}

fn identified_maps(report: &mut Report, tuning: &Tuning) {
    let map = |title: &str, map: ScheduleTable, factor: f64, decimals: usize| {
        heat_map(tuning, title, decimals, |cell| Shown {
            value: factor * cell.value(map),
            is_found: cell.is_found(map),
            is_raised: cell.is_raised(map),
            hint: tuning.provenance(cell, map),
        })
    };
    let maps = ScheduleTable::all(tuning.task.schedule.strategy).iter().map(|&shown| match shown {
        ScheduleTable::Feedforward => map("Feedforward (%)", shown, 1.0, 1),
        ScheduleTable::Gain => map("Gain <i>K<sub>p</sub></i> (kPa/%)", shown, 1e-3, 2),
        ScheduleTable::TimeConstant => map("Time constant <i>T</i> (s)", shown, 1.0, 2),
        ScheduleTable::Delay => map("Delay <i>L</i> (ms)", shown, 1e3, 0),
        ScheduleTable::SpeedSensitivity => map("Engine speed sensitivity (Pa\u{2009}s/rpm)", shown, 1.0, 1),
    });
    let procedure = &tuning.task.procedure;
    report.section("Maps");
    report.html(&format!(
        "<p class=\"caption\">Columns: engine speed (rpm); rows: boost reference (kPa). Hover over a number for its \
         origin.</p>\n<div class=\"maps\">\n{}</div>\n<table class=\"key\"><tr><td class=\"filled\">1.23</td>\
         <td>filled, not identified here: gain, time constant and delay from the nearest identified row at the same \
         speed; feedforward {} % above and {} % below the reachable range</td>\
         </tr><tr><td class=\"filled raised\">1.23</td><td>raised to the minimum magnitude: gain {} kPa/%, delay {} ms</td>\
         </tr></table>\n",
        maps.collect::<String>(),
        procedure.duty_above_reach,
        procedure.duty_below_reach,
        1e-3 * procedure.least_gain,
        1e3 * procedure.least_delay,
    ));
}

fn feedback_maps(report: &mut Report, tuning: &Tuning) {
    let map = |title: &str, decimals: usize, value: fn(&Cell) -> f64| {
        heat_map(tuning, title, decimals, |cell| Shown {
            value: value(cell),
            is_found: cell.is_found(ScheduleTable::TimeConstant),
            is_raised: false,
            hint: String::new(),
        })
    };
    let quality = heat_map(tuning, "Coefficient of determination <i>R</i>\u{b2} (%)", 2, |cell| {
        let model = tuning.point(cell.row, cell.column).and_then(|point| point.model.as_ref());
        Shown {
            value: model.map_or(f64::NAN, |model| 100.0 * model.determination),
            is_found: cell.basis == CellOrigin::Identified,
            is_raised: false,
            hint: model
                .map_or_else(String::new, |model| format!("RMS residual {:.1} Pa per %", model.residual)),
        }
    });
    let maps = [
        map("Gain <i>K</i> (%/kPa)", 2, |cell| 1e3 * cell.feedback.gain),
        map("Integral time <i>T<sub>i</sub></i> (s)", 2, |cell| cell.feedback.integral_time),
        map("Derivative time <i>T<sub>d</sub></i> (ms)", 0, |cell| 1e3 * cell.feedback.derivative_time),
        quality,
    ];
    report.section(&format!("Feedback at \u{3bb} = {} s, and goodness of fit", tuning.task.schedule.lambda));
    report.paragraph(
        "The controller computes gain, integral and derivative time from the maps and its parameter lambda (paper, \
         eq. (12)).",
    );
    report.html(&format!("<div class=\"maps\">\n{}</div>\n", maps.concat()));
}

/// A number in a map.
struct Shown {
    value: f64,
    is_found: bool,
    is_raised: bool,
    hint: String,
}

/// A map as a table with cells coloured by value, highest boost reference at the top.
fn heat_map(tuning: &Tuning, title: &str, decimals: usize, shown: impl Fn(&Cell) -> Shown) -> String {
    let schedule = &tuning.task.schedule;
    let scale = 10_f64.powf(decimals as f64);
    let shown = |cell: &Cell| {
        let exact = shown(cell);
        // Numbers that look equal get the same colour.
        Shown { value: (exact.value * scale).round() / scale, ..exact }
    };
    let found = tuning.cells.iter().map(&shown).filter(|shown| shown.is_found && shown.value.is_finite());
    let (least, most) = found.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), shown| {
        (least.min(shown.value.abs()), most.max(shown.value.abs()))
    });
    let speeds = schedule.engine_speeds.iter().map(|speed| format!("<th>{speed}</th>"));
    let mut text = format!(
        "<div class=\"wide\"><table class=\"map matrix\"><caption>{title}</caption>\n<thead><tr><td></td>{}\
         </tr></thead>\n",
        speeds.collect::<String>()
    );
    for (row, reference) in schedule.boost_references.iter().enumerate().rev() {
        text += &format!("<tr><th>{:.0}</th>", 1e-3 * reference);
        for cell in tuning.cells.iter().filter(|cell| cell.row == row) {
            let Shown { value, is_found, is_raised, hint } = shown(cell);
            let number = if value.is_finite() {
                format!("{value:.decimals$}").replace('-', "\u{2212}")
            } else {
                "\u{2013}".to_owned()
            };
            let raised = if is_raised { " raised" } else { "" };
            let look = if is_found {
                let strength = if most > least { (value.abs() - least) / (most - least) } else { 0.0 };
                format!("class=\"{}\" style=\"{}\"", raised.trim_start(), shade(strength))
            } else {
                format!("class=\"filled{raised}\"")
            };
            text += &format!("<td {look} title=\"{}\">{number}</td>", escaped(&hint));
        }
        text += "</tr>\n";
    }
    text + "</table></div>\n"
}

/// A colour between those of the smallest and largest value, legible in both colour schemes.
fn shade(strength: f64) -> String {
    format!(
        "background:color-mix(in srgb,var({}) {:.0}%,var({}))",
        color::HIGH.name(),
        100.0 * strength,
        color::LOW.name()
    )
}

fn static_maps(report: &mut Report, tuning: &Tuning) {
    let schedule = &tuning.task.schedule;
    let mut panel = Panel::new("duty (%)", "boost pressure (kPa)").height(300);
    for (sweep, &color) in tuning.sweeps.iter().zip(color::CYCLE.iter().cycle()) {
        let duties: Vec<_> = sweep.holds.iter().map(|hold| hold.duty).collect();
        let boost = sweep.holds.iter().map(|hold| 1e-3 * hold.boost_pressure);
        let speed = schedule.engine_speeds[sweep.column];
        panel = panel
            .line(Line::new(&duties, boost).label(&format!("{speed} rpm")).color(color).thin().markers());
    }
    let (least, most) = tuning.task.procedure.fitted_duty;
    report.section("Static map");
    report.figure(
        &Figure::new().row([panel.x_band(least, most)]),
        "Boost pressure at the end of each hold of the sweeps. Shaded: stepped duties.",
    );
}

fn responses(report: &mut Report, tuning: &Tuning) {
    let mut ranked: Vec<_> =
        tuning.points.iter().filter_map(|point| Some((point, point.model.as_ref()?))).collect();
    ranked.sort_by(|(_, one), (_, other)| one.determination.total_cmp(&other.determination));
    // Evenly spaced from worst to best.
    let last = ranked.len().saturating_sub(1);
    let mut indices: Vec<_> = (0..DRAWN_POINTS).map(|index| index * last / (DRAWN_POINTS - 1)).collect();
    indices.dedup();
    let times: Vec<f64> = drawn_samples(&tuning.task.procedure, tuning.task.schedule.sample_time)
        .map(|sample| sample as f64 * tuning.task.schedule.sample_time)
        .collect();
    let step = tuning.task.procedure.duty_step;
    let panels: Vec<_> = indices
        .into_iter()
        .filter_map(|index| ranked.get(index))
        .map(|(point, model)| {
            let end = DRAWN_TIME_CONSTANTS * model.time_constant.value + model.delay.value;
            let [up, down] =
                [(&point.responses[0], 1.0), (&point.responses[1], -1.0)].map(|(response, sign)| {
                    response.iter().map(|change| 1e-3 * sign * change / step).collect::<Vec<_>>()
                });
            let mean: Vec<_> = up.iter().zip(&down).map(|(up, down)| f64::midpoint(*up, *down)).collect();
            let modelled = times.iter().map(|time| 1e-3 * model.at(*time));
            let speed = tuning.task.schedule.engine_speeds[point.column];
            let boost = 1e-3 * tuning.task.schedule.boost_references[point.row];
            Panel::new("time (s)", "change (kPa/%)")
                .title(&format!("{speed} rpm, {boost:.0} kPa, R\u{b2} {:.2} %", 100.0 * model.determination))
                .x_range(0.0, end.min(tuning.task.procedure.response_duration))
                .line(Line::new(&times, up).label("up").color(color::SKY).thin())
                .line(Line::new(&times, down).label("down, mirrored").color(color::ORANGE).thin())
                .line(Line::new(&times, mean).label("mean").color(color::BLUE))
                .line(Line::new(&times, modelled).label("model").color(color::INK).dashed())
        })
        .collect();
    let rows = panels.chunks(2).map(<[Panel]>::to_vec);
    report.section("Responses and models");
    report.figure(
        &rows.fold(Figure::new(), Figure::row),
        "Boost pressure change after a duty step, per %, from the worst fit to the best. The plant is of higher order, \
         so its response bends where the model has a corner.",
    );
}

fn points(report: &mut Report, tuning: &Tuning) {
    let schedule = &tuning.task.schedule;
    let headings = [
        "rpm",
        "reference (kPa)",
        "duty (%)",
        "boost there (kPa)",
        "<i>K<sub>p</sub></i> (kPa/%)",
        "<i>T</i> (s)",
        "<i>L</i> (ms)",
        "<i>R</i>\u{b2} (%)",
        "residual (Pa/%)",
        "up over down",
    ];
    let mut table = Table::new(headings.map(fmu_plot::Cell::html)).class("points");
    for point in &tuning.points {
        let Some(model) = &point.model else { continue };
        let in_unit = |found: super::Estimate, factor: f64| {
            estimate(factor * found.value, factor * found.standard_error)
        };
        let cells = [
            schedule.engine_speeds[point.column].to_string(),
            format!("{:.0}", 1e-3 * schedule.boost_references[point.row]),
            format!("{:.2}", point.hold.duty),
            format!("{:.1}", 1e-3 * point.hold.boost_pressure),
            in_unit(model.gain, 1e-3),
            in_unit(model.time_constant, 1.0),
            in_unit(model.delay, 1e3),
            format!("{:.3}", 100.0 * model.determination),
            format!("{:.1}", model.residual),
            format!("{:.3}", point.asymmetry),
        ];
        table.row(cells.map(Into::into));
    }
    report.section("All identified points");
    report.html("<details><summary>Models with standard errors, assuming independent residuals</summary>\n");
    report.table(&table);
    report.html("</details>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_plot::Color;
    use fmu_xml::page::STYLE;

    /// The relative luminance of WCAG 2.1.
    fn luminance(color: [f64; 3]) -> f64 {
        let [red, green, blue] = color.map(|value| {
            let value = value / 255.0;
            if value <= 0.03928 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    fn contrast(one: [f64; 3], other: [f64; 3]) -> f64 {
        let [one, other] = [luminance(one), luminance(other)];
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

    /// 4.5:1, what WCAG 2.1 asks of text (1.4.3), for each colour that a cell may have.
    #[test]
    fn texts_in_maps_contrast_with_their_cells_by_day_and_by_night() {
        assert!((contrast([0.0; 3], [255.0; 3]) - 21.0).abs() < 1e-9);
        for scheme in [1, 2] {
            let rgb = |color: Color| {
                let digits = &STYLE.split(&format!("{}: #", color.name())).nth(scheme).unwrap()[..6];
                let number = u32::from_str_radix(digits, 16).unwrap();
                [16, 8, 0].map(|shift| f64::from(number >> shift & 0xff))
            };
            let [low, high, ink, faint, shade, paper] =
                [color::LOW, color::HIGH, color::INK, color::FAINT, color::SHADE, color::PAPER].map(rgb);
            for percent in 0..=100 {
                let strength = f64::from(percent) / 100.0;
                let cell = [0, 1, 2].map(|index| low[index] + strength * (high[index] - low[index]));
                assert!(contrast(ink, cell) >= 4.5, "{percent} %: {}", contrast(ink, cell));
            }
            // Cells that are filled, and captions.
            for back in [shade, paper] {
                assert!(contrast(faint, back) >= 4.5, "{}", contrast(faint, back));
            }
        }
    }
}
