//! The solenoid valve at rest: chamber pressure over duty, eq. (7), and leakage, eq. (6).

use anyhow::{Result, bail};
use nalgebra::{DMatrix, DVector};

use super::data::Data;
use super::phases::{Phase, Rest};
use super::points::{ResidualPoint, curve, drawing, residuals};
use super::statistics::{Solution, linear, mean};
use super::{Fit, FitOutcome, Known, ParameterEstimate, Unidentified};

/// The coefficients of eq. (7).
pub const PRESSURE: [&str; 4] = [
    "valve.pressure_coefficient[1]",
    "valve.pressure_coefficient[2]",
    "valve.pressure_coefficient[3]",
    "valve.pressure_coefficient[4]",
];
/// The coefficients of eq. (6).
pub const LEAKAGE: [&str; 3] =
    ["valve.leakage_coefficient[1]", "valve.leakage_coefficient[2]", "valve.leakage_coefficient[3]"];
pub const PUMP: &str = "pump.mass_flow";
/// The parameters determined by tank pressure.
pub const FROM_TANK: [&str; 4] = [LEAKAGE[0], LEAKAGE[1], LEAKAGE[2], PUMP];
/// Below ambient pressure by this much (Pa), eq. (7) rather than ambient determines chamber pressure.
const BELOW_AMBIENT: f64 = 500.0;
/// The minimum difference of distinct duties (%).
const DIFFERENT: f64 = 0.5;

fn different_duties(duties: impl Iterator<Item = f64>) -> usize {
    let mut duties: Vec<_> = duties.collect();
    duties.sort_by(f64::total_cmp);
    duties.dedup_by(|a, b| (*a - *b).abs() < DIFFERENT);
    duties.len()
}

/// Eq. (7) from the chamber pressure at rest.
pub fn pressure(rests: &[&Rest], known: &Known) -> FitOutcome {
    const LEAST_DUTIES: usize = 6;
    let is_held =
        |rest: &&&Rest| !rest.is_limited_by_tank && rest.chamber < known.ambient_pressure - BELOW_AMBIENT;
    let held: Vec<_> = rests.iter().filter(is_held).collect();
    let tuning: Vec<_> = held.iter().filter(|rest| !rest.validates).collect();
    let duties = different_duties(tuning.iter().map(|rest| rest.duty));
    if duties < LEAST_DUTIES {
        bail!(
            "eq. (7) needs {LEAST_DUTIES} duties at which the chamber rests between tank and ambient pressure for at \
             least a second; the tuning data have {duties}"
        );
    }
    let design = DMatrix::from_fn(tuning.len(), 4, |row, column| {
        tuning[row].duty.powi(3 - i32::try_from(column).unwrap_or(0))
    });
    let observed = DVector::from_fn(tuning.len(), |row, _| tuning[row].chamber);
    let solution = linear(&design, &observed, &vec![1; tuning.len()])?;
    let value = |duty: f64| solution.parameters.iter().fold(0.0, |sum, coefficient| sum * duty + coefficient);

    let points: Vec<_> = held
        .iter()
        .map(|rest| ResidualPoint {
            place: rest.duty,
            measured: 1e-3 * rest.chamber,
            residual: rest.chamber - value(rest.duty),
            validates: rest.validates,
        })
        .collect();
    let (x, y) = curve(&points, |duty| 1e-3 * value(duty));
    Ok((
        Fit {
            title: "Chamber pressure over duty, eq. (7)".to_owned(),
            method: format!(
                "Linear least squares of a cubic through the means of {} phases at rest in which neither tank nor \
                 ambient pressure limits the chamber. Duties are at {} V.",
                tuning.len(),
                known.plant.valve.nominal_voltage
            ),
            residuals: vec![residuals("chamber pressure", "Pa", &points)],
            drawing: drawing(
                ["duty at nominal voltage (%)", "chamber pressure (kPa)", "residual (Pa)"],
                &points,
                (&x, &y),
            ),
            parameters: estimates(&PRESSURE, &solution, known),
        },
        vec![],
    ))
}

/// A phase at rest, in which only leakage and pump change tank pressure.
struct Decay<'a> {
    rest: &'a Rest,
    pump_runs: bool,
    /// Tank pressure (Pa), its rise through 1 m² of leakage and its fall through 1 kg/s of the pump (Pa), all minus
    /// their means over the phase.
    pressure: Vec<f64>,
    leaked: Vec<f64>,
    pumped: Vec<f64>,
}

impl<'a> Decay<'a> {
    fn new(data: &Data, phase: &Phase, rest: &'a Rest, known: &Known) -> Self {
        // Eq. (3) for the tank.
        let per_mass = known.plant.air.gas_constant * known.ambient_temperature / known.plant.tank.volume;
        let (orifice, temperature) = (&known.system.valve.orifice, known.ambient_temperature);
        let ambient = (known.ambient_pressure, temperature);
        let rate = |row: usize| per_mass * orifice.mass_flow(1.0, ambient, (data.tank[row], temperature));
        let rows = rest.rows.clone();
        let mut leaked = vec![0.0];
        for row in rows.clone().skip(1) {
            let step = (data.time[row] - data.time[row - 1]) * f64::midpoint(rate(row - 1), rate(row));
            leaked.push(leaked[leaked.len() - 1] + step);
        }
        let begin = data.time[rows.start];
        let pumped = data.time[rows.clone()].iter().map(|time| per_mass * (time - begin)).collect();
        let pressure = data.tank[rows].to_vec();
        let [pressure, leaked, pumped] = [pressure, leaked, pumped].map(|mut values: Vec<f64>| {
            let mean = mean(&values);
            for value in &mut values {
                *value -= mean;
            }
            values
        });
        Self { rest, pump_runs: phase.pump_runs, pressure, leaked, pumped }
    }

    /// The area of this phase alone (m²), for the drawing.
    fn area(&self, pump: f64) -> f64 {
        let pump = if self.pump_runs { pump } else { 0.0 };
        let pairs = self.pressure.iter().zip(&self.leaked).zip(&self.pumped);
        let (product, square) = pairs.fold((0.0, 0.0), |(product, square), ((pressure, leaked), pumped)| {
            (product + leaked * (pressure + pump * pumped), square + leaked * leaked)
        });
        product / square
    }

    /// The residuals of a solution (Pa).
    fn residuals(&self, area: f64, pump: f64) -> impl Iterator<Item = ResidualPoint> {
        let pump = if self.pump_runs { pump } else { 0.0 };
        let pairs = self.pressure.iter().zip(&self.leaked).zip(&self.pumped);
        pairs.map(move |((&measured, leaked), &pumped)| {
            let residual = measured - area * leaked + pump * pumped;
            ResidualPoint { place: pumped, measured, residual, validates: self.rest.validates }
        })
    }
}

/// Eq. (6) and the pump flow from tank pressure.
pub fn leakage(data: &Data, phases: &[Phase], known: &Known) -> FitOutcome {
    const LEAST_DUTIES: usize = 4;
    let mut decays: Vec<_> = phases
        .iter()
        .filter_map(|phase| Some((phase, phase.rest.as_ref()?)))
        // Where the valve connects both, the balance includes the chamber's air.
        .filter(|(_, rest)| !rest.is_limited_by_tank)
        .map(|(phase, rest)| Decay::new(data, phase, rest, known))
        .collect();
    let pumps = decays.iter().any(|decay| decay.pump_runs && !decay.rest.validates);
    let mut solution;
    loop {
        let tuning: Vec<_> = decays.iter().filter(|decay| !decay.rest.validates).collect();
        let leaking = tuning.iter().filter(|decay| !decay.pump_runs);
        let duties = different_duties(leaking.map(|decay| decay.rest.duty));
        if duties < LEAST_DUTIES {
            bail!(
                "eq. (6) needs {LEAST_DUTIES} duties with phases at rest, pump off and tank pressure below the \
                 chamber's; the tuning data have {duties}"
            );
        }
        solution = solve(&tuning, known, pumps)?;
        // Eq. (6) ends where its area would be below 0, at duties near 0.
        let before = decays.len();
        decays.retain(|decay| area(&solution, decay.rest.duty) > 0.0);
        if decays.len() == before {
            break;
        }
    }
    let scale = known.plant.valve.leakage_area_scale;
    let pump = if pumps { solution.parameters[3] } else { known.value(PUMP) };
    // In 1e-9 m².
    let fitted = |duty: f64| 1e9 * scale * area(&solution, duty);
    let points: Vec<_> = decays
        .iter()
        .filter(|decay| !decay.pump_runs)
        .map(|decay| {
            let (place, measured) = (decay.rest.duty, 1e9 * decay.area(pump));
            ResidualPoint {
                place,
                measured,
                residual: measured - fitted(place),
                validates: decay.rest.validates,
            }
        })
        .collect();
    let of_tank: Vec<_> = decays
        .iter()
        .flat_map(|decay| decay.residuals(scale * area(&solution, decay.rest.duty), pump))
        .collect();
    let (x, y) = curve(&points, fitted);
    let mut parameters = estimates(&LEAKAGE, &solution, known);
    let mut unidentified = vec![];
    if pumps {
        parameters.push(known.estimate(PUMP, pump, solution.standard_error(3)));
    } else {
        let reason = "the tuning data have no phase at rest with the pump on";
        unidentified.push(Unidentified::new(PUMP, reason));
    }
    let tuning = decays.iter().filter(|decay| !decay.rest.validates).count();
    let fit = Fit {
        title: "Leakage over duty, eq. (6)".to_owned(),
        method: format!(
            "Linear least squares of the tank pressure in {tuning} phases at rest: its rise is the leakage by eqs. (1) \
             and (6) minus the flow of the running pump. Only area over tank volume is measured; the volume is assumed \
             to be {} m\u{b3} and the coefficients' unit {scale:e} m\u{b2}. The figure shows the area of each single \
             phase with the pump off.",
            known.plant.tank.volume
        ),
        residuals: vec![residuals("tank pressure", "Pa", &of_tank)],
        drawing: drawing(
            [
                "duty at nominal voltage (%)",
                "leakage area (10\u{207b}\u{2079} m\u{b2})",
                "residual (10\u{207b}\u{2079} m\u{b2})",
            ],
            &points,
            (&x, &y),
        ),
        parameters,
    };
    Ok((fit, unidentified))
}

/// The first parameters of a solution.
fn estimates(names: &[&str], solution: &Solution, known: &Known) -> Vec<ParameterEstimate> {
    let estimate = |(index, name): (usize, &&str)| {
        known.estimate(name, solution.parameters[index], solution.standard_error(index))
    };
    names.iter().enumerate().map(estimate).collect()
}

/// Eq. (6), in units of the scale.
fn area(solution: &Solution, duty: f64) -> f64 {
    solution.parameters.iter().take(3).fold(0.0, |sum, coefficient| sum * duty + coefficient)
}

fn solve(decays: &[&Decay<'_>], known: &Known, pumps: bool) -> Result<Solution> {
    let lengths: Vec<_> = decays.iter().map(|decay| decay.pressure.len()).collect();
    let rows: Vec<_> =
        decays.iter().flat_map(|decay| (0..decay.pressure.len()).map(move |row| (decay, row))).collect();
    let pump = if pumps { 0.0 } else { known.value(PUMP) };
    let design = DMatrix::from_fn(rows.len(), if pumps { 4 } else { 3 }, |index, column| {
        let (decay, row) = rows[index];
        match column {
            0..3 => {
                let power = decay.rest.duty.powi(2 - i32::try_from(column).unwrap_or(0));
                known.plant.valve.leakage_area_scale * decay.leaked[row] * power
            }
            _ if decay.pump_runs => -decay.pumped[row],
            _ => 0.0,
        }
    });
    let observed = DVector::from_fn(rows.len(), |index, _| {
        let (decay, row) = rows[index];
        decay.pressure[row] + if decay.pump_runs { pump * decay.pumped[row] } else { 0.0 }
    });
    linear(&design, &observed, &lengths)
}
