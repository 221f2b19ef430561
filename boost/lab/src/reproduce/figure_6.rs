//! Fig. 6: the identified valve characteristics, eqs. (6) and (7).

use anyhow::Result;

use super::measure::{at, greatest};
use super::{Evidence, Laboratory, shipped, steps};
use fmu_plot::{Figure, Line, Panel, color};

/// Table 1, leakage: effective area in 1e-9 m2 over the duty in %.
const LEAKAGE: [f64; 3] = [-4.7625e-5, 7.2000e-2, -5.2300e-2];
/// Table 1, pressure (Pa), with the sign of the third coefficient corrected: with the printed one the chamber
/// would rise to 115 kPa and never fall below ambient.
const PRESSURE: [f64; 4] = [2.8939e-2, -6.5767, -4.4044e2, 1.0612e5];
/// The gas constant of air (J/(kg K)).
const GAS_CONSTANT: f64 = 287.0;
/// The choked flow function for air, from eq. (2) made continuous.
const CHOKED: f64 = 0.684_731;

/// A polynomial, highest power first.
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_6.toml"))?;
    let record = laboratory.run(&scenario)?;
    let mut duties = vec![];
    let mut pressures = vec![];
    let mut areas = vec![];
    for (_, duty, end) in steps(&scenario, "hp_wastegate_pwm") {
        let ambient = at(&record, "ambient_pressure", end)?;
        let temperature = at(&record, "ambient_temperature", end)?;
        let flow = at(&record, "valve.leakage_mass_flow", end)?;
        duties.push(duty);
        pressures.push(at(&record, "actuator_pressure", end)?);
        // Eq. (1); the tank is far below the critical pressure ratio.
        areas.push(flow * (GAS_CONSTANT * temperature).sqrt() / (ambient * CHOKED));
    }
    let ambient = at(&record, "ambient_pressure", 0.0)?;
    let expected_pressure = |duty: f64| polynomial(&PRESSURE, duty).min(ambient);
    let expected_area = |duty: f64| 1e-9 * polynomial(&LEAKAGE, duty).max(0.0);
    let pressure_error =
        greatest(duties.iter().zip(&pressures).map(|(&duty, p)| (p - expected_pressure(duty)).abs()));
    let area_error =
        greatest(duties.iter().zip(&areas).map(|(&duty, area)| (area - expected_area(duty)).abs()));

    let fine: Vec<f64> = (0..=400).map(|index| 0.25 * f64::from(index)).collect();
    let panel = |title, label, factor: f64, equation, expected: &dyn Fn(f64) -> f64, found: &[f64]| {
        let expected = Line::new(&fine, fine.iter().map(|&duty| factor * expected(duty)));
        let found = Line::new(&duties, found.iter().map(|value| factor * value));
        Panel::new("duty (%)", label)
            .title(title)
            .height(240)
            .line(expected.label(equation))
            .line(found.color(color::VERMILION).dots().label("FMU at rest"))
    };
    let leakage = "effective area (mm\u{b2})";
    let leakage = panel("(a) Valve leakage", leakage, 1e6, "eq. (6), Table 1", &expected_area, &areas);
    let pressure = "actuator pressure (kPa)";
    let pressure =
        panel("(b) Actuator pressure", pressure, 1e-3, "eq. (7), Table 1", &expected_pressure, &pressures);
    let results = vec![("pressure_deviation", pressure_error), ("leakage_area_deviation", 1e6 * area_error)];
    let caption = "The plant's valve at rest, and the polynomials of Table 1.";
    Ok(Evidence::new(results).drawing(caption, Figure::new().row([leakage, pressure])).note(
        "The paper compares with unpublished measurements. Here the polynomials are model parameters, and the figure \
         shows that the plant reproduces them.",
    ))
}
