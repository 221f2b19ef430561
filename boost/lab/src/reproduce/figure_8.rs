//! Fig. 8: the spring, and the effect of the vacuum pump's current on the wastegate.

use anyhow::{Context, Result, bail};

use super::measure::{at, greatest, least};
use super::{Evidence, Laboratory, curve, shipped};
use fmu_plot::{Figure, Line, Panel, color};

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let spring = spring(laboratory)?;
    pump(laboratory, spring)
}

/// Fig. 8(a).
fn spring(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_7.toml"))?;
    let record = laboratory.run(&scenario)?;
    // Rising duty only: the spring has no hysteresis.
    let half = record.time().len() / 2;
    let positions: Vec<_> = record.get("actuator.position")?[..half].iter().map(|x| 1e3 * x).collect();
    let forces = &record.get("actuator.spring_force")?[..half];
    // The mean stiffness between two positions (N/mm).
    let stiffness = |from: f64, to: f64| {
        let near = |place: f64| {
            let distances = positions.iter().map(|x| (x - place).abs()).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(row, _)| row)
        };
        let [a, b] = [near(from), near(to)];
        (forces[b] - forces[a]) / (positions[b] - positions[a])
    };
    let panel = Panel::new("rod position (mm)", "spring force (N)")
        .title("(a) Spring")
        .height(200)
        .line(Line::new(&positions, forces.iter().copied()));
    let results = vec![("spring_stiffening", stiffness(8.0, 9.5) / stiffness(1.0, 4.0))];
    let caption = "Spring force over rod position, from the ramp of Fig. 7.";
    Ok(Evidence::new(results).drawing(caption, Figure::new().row([panel])))
}

/// Adds Fig. 8(b).
fn pump(laboratory: &mut Laboratory, mut evidence: Evidence) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_8.toml"))?;
    let record = laboratory.run(&scenario)?;
    let time = record.time();
    let runs = record.get("vacuum_pump")?.iter().enumerate().filter(|(_, pump)| **pump > 0.5);
    let rows: Vec<_> = runs.map(|(row, _)| row).collect();
    let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else { bail!("the pump does not run") };
    // A row holds the controller outputs of the previous communication point.
    let before = first.checked_sub(1).context("the pump runs from the start")?;
    let (begin, end) = (time[before], time[last]);
    let change = |name: &str| {
        let values = record.get(name)?;
        Ok::<_, anyhow::Error>(
            values[first..=last].iter().map(|value| value - values[before]).collect::<Vec<_>>(),
        )
    };
    let panel = |name, label, factor, color| {
        let panel = Panel::new("time (s)", label).height(110).x_range(60.0, 90.0).x_band(begin, end);
        Ok::<_, anyhow::Error>(panel.line(curve(&record, name, factor)?.color(color)))
    };
    let moved = change("hp_wastegate_position")?.into_iter().map(|change| 100.0 * change.abs());
    let title = "(b) 2000 rpm, 50 % duty; pump on where shaded";
    let figure = Figure::new()
        .row([panel("valve.voltage", "supply (V)", 1.0, color::INK)?.y_range(11.45, 12.15).title(title)])
        .row([panel("tank_pressure", "tank (kPa)", 1e-3, color::SKY)?.y_range(28.5, 36.5)])
        .row([panel("hp_wastegate_position", "wastegate (%)", 100.0, color::BLUE)?.y_range(62.5, 71.5)])
        .row([panel("exhaust_manifold_pressure", "exhaust (kPa)", 1e-3, color::VERMILION)?
            .y_range(147.0, 163.0)])
        .shared_x();
    evidence.results.extend([
        ("pump_on", begin),
        ("pump_duration", end - begin),
        ("voltage_drop", -least(change("valve.voltage")?)),
        ("position_change", greatest(moved)),
    ]);
    let caption = "Pump run: voltage at the valve, tank pressure, wastegate position, pressure upstream of the turbine.";
    Ok(evidence.drawing(caption, figure).note(format!(
        "The exhaust force on the wastegate is neglected, as in the paper, so the pressure upstream of the turbine, \
         {:.0} kPa, has no effect on it here.",
        1e-3 * at(&record, "exhaust_manifold_pressure", begin)?
    )))
}
