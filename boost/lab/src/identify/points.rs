//! Measurements with their residuals from a fit.

use super::Residuals;
use super::statistics::root_mean_square;
use fmu_plot::{Figure, Line, Panel, color};

/// A measurement with its residual from a fit.
#[derive(Clone, Copy, Debug)]
pub struct ResidualPoint {
    /// The place on the horizontal axis.
    pub place: f64,
    pub measured: f64,
    /// Measured minus computed.
    pub residual: f64,
    /// Whether the measurement was kept for validation.
    pub validates: bool,
}

/// Dots, with one colour for tuning and another one for validation.
fn dots(
    points: &[ResidualPoint],
    value: fn(&ResidualPoint) -> f64,
) -> impl Iterator<Item = (Line, &'static str)> {
    [(false, "tuning", color::BLUE), (true, "validation", color::VERMILION)].into_iter().filter_map(
        move |(validates, label, color)| {
            let chosen = points.iter().filter(|point| point.validates == validates);
            let (x, y): (Vec<_>, Vec<_>) = chosen.map(|point| (point.place, value(point))).unzip();
            (!x.is_empty()).then(|| (Line::new(&x, y).dots().color(color), label))
        },
    )
}

/// A curve over the range of some points.
pub fn curve(points: &[ResidualPoint], value: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let [from, to] = [f64::min, f64::max]
        .map(|choose| points.iter().map(|point| point.place).reduce(choose).unwrap_or(0.0));
    let places: Vec<_> = (0..=100).map(|index| from + (to - from) * f64::from(index) / 100.0).collect();
    let values = places.iter().map(|place| value(*place)).collect();
    (places, values)
}

/// Measurements over a curve, and below their residuals.
pub fn drawing(
    [x_label, y_label, residual_label]: [&str; 3],
    points: &[ResidualPoint],
    (x, y): (&[f64], &[f64]),
) -> Figure {
    let line = Line::new(x, y.iter().copied()).color(color::INK).thin().label("fit");
    let fit = with_measured(Panel::new(x_label, y_label).height(200).line(line), points);
    Figure::new().row([fit]).row([residual_panel(points, x_label, residual_label).height(90)]).shared_x()
}

pub fn with_measured(panel: Panel, points: &[ResidualPoint]) -> Panel {
    dots(points, |point| point.measured).fold(panel, |panel, (line, label)| panel.line(line.label(label)))
}

pub fn residual_panel(points: &[ResidualPoint], x_label: &str, label: &str) -> Panel {
    dots(points, |point| point.residual).fold(Panel::new(x_label, label), |panel, (line, _)| panel.line(line))
}

/// The root mean squares of the residuals.
pub fn residuals(name: &str, unit: &str, points: &[ResidualPoint]) -> Residuals {
    let [tuning, validation] = [false, true].map(|validates| {
        let chosen = points.iter().filter(|point| point.validates == validates);
        root_mean_square(chosen.map(|point| point.residual))
    });
    Residuals { name: name.to_owned(), unit: unit.to_owned(), tuning, validation, noise: None }
}
