//! The page: operating point, poles, matrices, Bode and Nyquist plots, and a loop's margins.

use fmu_plot::{Cell, Figure, Line, Panel, Report, Table, color, labelled};
use fmu_record::Column;
use fmu_record::numbers::quantity;
use nalgebra::Complex;
use std::f64::consts::TAU;

use super::{Found, Linear, Loop, Path, describe};

/// Beyond these limits, a Nyquist plot of a loop does not show the point -1.
const NYQUIST: f64 = 3.0;

pub fn html(found: &Found) -> String {
    let mut report = Report::new(&found.title);
    report.paragraph(&format!("Linearized at {}.", quantity(found.time, "s")));
    if let Some(cut) = &found.cut {
        section_of_loop(&mut report, cut);
    }
    for linear in &found.fmus {
        section(&mut report, linear);
    }
    report.page("")
}

fn section(report: &mut Report, linear: &Linear) {
    report.section(&linear.name);
    let equations = &linear.equations;
    report.paragraph(&format!("Linear equations {}.", linear.origin()));
    if let Some(path) = &linear.path {
        let [input, output] = [&linear.inputs[path.input], &linear.outputs[path.output]];
        report.figure(
            &bode_of_path(path, input, output),
            &format!("Bode plot from {} to {}.", input.name, output.name),
        );
        report.figure(&nyquist_of_path(path, input, output), "Nyquist plot.");
    }
    let mut table = Table::new(["Pole (1/s)", "Frequency", ""]);
    for [place, frequency, nature] in linear.poles.iter().flatten().map(describe) {
        table.row([Cell::number(&place), Cell::number(&frequency), nature.into()]);
    }
    report.table(&table);
    let mut table = Table::new(["Operating point", "Value", "Rate"]);
    for ((column, (name, value)), rate) in
        linear.states.iter().zip(&equations.states).zip(&equations.derivatives)
    {
        let rate = format!("{}/s", column.of_differences().text(*rate));
        table.row([name.as_str().into(), Cell::number(&column.text(*value)), Cell::number(&rate)]);
    }
    for (columns, values) in [(&linear.inputs, &equations.inputs), (&linear.outputs, &equations.outputs)] {
        for (column, (name, value)) in columns.iter().zip(values) {
            table.row([name.as_str().into(), Cell::number(&column.text(*value)), Cell::number("")]);
        }
    }
    report.table(&table);
    for (name, rows) in [("A", &equations.a), ("B", &equations.b), ("C", &equations.c), ("D", &equations.d)] {
        let row =
            |row: &Vec<f64>| row.iter().map(|number| format!("{number:?}")).collect::<Vec<_>>().join(", ");
        report.details(
            &format!("{name}, in the declared units"),
            &rows.iter().map(row).collect::<Vec<_>>().join("\n"),
        );
    }
}

fn section_of_loop(report: &mut Report, cut: &Loop) {
    report.section(&format!("Loop at {}", cut.input));
    let [gain, phase] = cut.lines();
    report.paragraph(&format!("Margins with the loop opened there: {gain}; {phase}."));
    let frequencies: Vec<_> = cut.points.iter().map(|point| point.frequency).collect();
    let gains: Vec<_> = cut.points.iter().map(|point| point.gain).collect();
    let bode = bode(&frequencies, &gains, "gain (dB)");
    report
        .figure(&bode, "Bode plot of the loop. At the stability limit, the gain is 0 dB where the phase is \u{2212}180\u{b0}.");
    let circle = (0..=90).map(|index| (TAU * f64::from(index) / 90.0).sin_cos());
    let (y, x): (Vec<_>, Vec<_>) = circle.unzip();
    let near: Vec<_> = gains.iter().filter(|gain| gain.norm() < NYQUIST).copied().collect();
    let panel = Panel::new("real part", "imaginary part").height(380).equal_scales();
    let panel = panel
        .line(Line::new(&x, y).label("gain 1").color(color::GRAY).thin().dashed())
        .line(Line::new(&[-1.0], [0.0]).label("limit of stability").color(color::VERMILION).dots())
        .line(curve(&near).label("loop").markers());
    report.figure(&Figure::new().row([panel]), "Nyquist plot of the loop.");
}

fn curve(values: &[Complex<f64>]) -> Line {
    let real: Vec<_> = values.iter().map(|value| value.re).collect();
    Line::new(&real, values.iter().map(|value| value.im))
}

/// The response in the units in which both variables are shown, and its unit.
fn shown(path: &Path, input: &Column, output: &Column) -> (Vec<Complex<f64>>, String) {
    let [(of, output), (by, input)] = [output, input].map(|column| column.of_differences().scale(1.0));
    let unit = match (of.as_str(), by.as_str()) {
        ("", "") => String::new(),
        (of, "") => of.to_owned(),
        (of, by) => format!("{}/{by}", if of.is_empty() { "1" } else { of }),
    };
    (path.response.iter().map(|value| value * (output.factor / input.factor)).collect(), unit)
}

fn bode_of_path(path: &Path, input: &Column, output: &Column) -> Figure {
    let (response, unit) = shown(path, input, output);
    let label = if unit.is_empty() { "gain (dB)".to_owned() } else { format!("gain (dB re 1 {unit})") };
    bode(&path.frequencies, &response, &label)
}

fn nyquist_of_path(path: &Path, input: &Column, output: &Column) -> Figure {
    let (response, unit) = shown(path, input, output);
    let [real, imaginary] = ["real part", "imaginary part"].map(|name| labelled(name, &unit));
    Figure::new().row([Panel::new(&real, &imaginary).height(380).equal_scales().line(curve(&response))])
}

/// Gain and phase over frequency. The phase has no jumps.
fn bode(frequencies: &[f64], response: &[Complex<f64>], label: &str) -> Figure {
    let mut phase = response.first().map_or(0.0, |value| value.arg());
    let mut phases = vec![phase.to_degrees()];
    for pair in response.windows(2) {
        phase += (pair[1] / pair[0]).arg();
        phases.push(phase.to_degrees());
    }
    let line = |values: Vec<f64>| Line::new(frequencies, values);
    let gain = response.iter().map(|value| 20.0 * value.norm().log10()).collect();
    let panel = |label: &str, line: Line| [Panel::new("frequency (Hz)", label).logarithmic_x().line(line)];
    Figure::new().shared_x().row(panel(label, line(gain))).row(panel("phase (\u{b0})", line(phases)))
}
