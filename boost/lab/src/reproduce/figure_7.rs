//! Fig. 7: a slow duty ramp, up and down.

use anyhow::Result;

use super::measure::{greatest, interpolate};
use super::{Evidence, Laboratory, shipped};
use fmu_plot::{Figure, Line, Panel, color};
use fmu_record::Record;

/// Above this duty (%) the tank pressure, moved by the pump relay, is the lower limit.
const TANK_IS_FLOOR: f64 = 85.0;

/// A variable over rising and falling duty, both branches sorted by duty.
fn branches(record: &Record, name: &str, factor: f64) -> Result<[Vec<(f64, f64)>; 2]> {
    let points = record.get("hp_wastegate_pwm")?.iter().copied();
    let points: Vec<_> = points.zip(record.get(name)?.iter().map(|value| factor * value)).collect();
    let half = points.len() / 2;
    let up = points[..=half].to_vec();
    let down = points[half..].iter().rev().copied().collect();
    // One point for each duty.
    Ok([up, down].map(|mut branch: Vec<(f64, f64)>| {
        branch.dedup_by(|a, b| a.0 <= b.0);
        branch
    }))
}

/// The largest difference between the branches at equal duty, from 5 % to a limit.
fn gap(branches: &[Vec<(f64, f64)>; 2], most: f64) -> f64 {
    let duties = (0..=360).map(|index| 5.0 + 0.25 * f64::from(index)).filter(|&duty| duty < most);
    greatest(duties.map(|duty| (interpolate(&branches[0], duty) - interpolate(&branches[1], duty)).abs()))
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_7.toml"))?;
    let record = laboratory.run(&scenario)?;
    let position = branches(&record, "hp_wastegate_position", 100.0)?;
    let pressure = branches(&record, "actuator_pressure", 1e-3)?;

    let panel = |label, title, [up, down]: &[Vec<(f64, f64)>; 2]| {
        let line = |branch: &[(f64, f64)]| {
            let duties: Vec<_> = branch.iter().map(|point| point.0).collect();
            Line::new(&duties, branch.iter().map(|point| point.1).collect::<Vec<_>>())
        };
        Panel::new("duty (%)", label)
            .title(title)
            .height(240)
            .x_range(0.0, 100.0)
            .line(line(up).label("up"))
            .line(line(down).dashed().color(color::VERMILION).label("down"))
    };
    let figure = Figure::new().row([
        panel("actuator pressure (kPa)", "Actuator pressure", &pressure),
        panel("wastegate position (%)", "Wastegate position", &position),
    ]);
    let results = vec![
        ("position_hysteresis", gap(&position, 95.01)),
        ("pressure_hysteresis", 1e3 * gap(&pressure, TANK_IS_FLOOR)),
    ];
    let caption = "Duty ramp of 1 % per second, up and down, with the pump relay active.";
    Ok(Evidence::new(results).drawing(caption, figure).note(format!(
        "Where tank pressure is the lower limit, the pressure branches differ by up to {:.1} kPa: the relay's band, \
         not friction.",
        gap(&pressure, 95.01)
    )))
}
