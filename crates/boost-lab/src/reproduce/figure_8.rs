//! Fig. 8: the spring, and the effect of the vacuum pump's current on the wastegate.

use anyhow::{Context, Result, bail};

use super::measure::{at, greatest, least};
use super::{Claim, Evidence, Laboratory, curve, shipped};
use fmu_plot::{Figure, Line, Panel, color};

/// When the paper's pump runs (s).
const PAPER: (f64, f64) = (72.5, 82.2);

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let mut evidence = spring(laboratory)?;
    let pump = pump(laboratory)?;
    evidence.drawings.extend(pump.drawings);
    evidence.claims.extend(pump.claims);
    evidence.notes.extend(pump.notes);
    Ok(evidence)
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
    Ok(Evidence {
        drawings: vec![(
            "Spring force over rod position, from the ramp of Fig. 7.".into(),
            Figure::new().row([panel]).into(),
        )],
        claims: vec![
            Claim::calibration("spring_stiffening", stiffness(8.0, 9.5) / stiffness(1.0, 4.0), "", 1.5..)
                .paper("The spring has a nonlinear behaviour.")
                .how(
                    "Mean stiffness (actuator.spring_force over actuator.position) between 8 and 9.5 mm \
                     over that between 1 and 4 mm. The bound requires an increase by half.",
                ),
        ],
        notes: vec![],
    })
}

/// Fig. 8(b).
fn pump(laboratory: &mut Laboratory) -> Result<Evidence> {
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
    let duration = PAPER.1 - PAPER.0;
    let moved = change("hp_wastegate_position")?.into_iter().map(|change| 100.0 * change.abs());
    let title = "(b) 2000 rpm, 50 % duty; pump on where shaded";
    let figure = Figure::new()
        .row([panel("valve.voltage", "supply (V)", 1.0, color::INK)?.y_range(11.45, 12.15).title(title)])
        .row([panel("tank_pressure", "tank (kPa)", 1e-3, color::SKY)?.y_range(28.5, 36.5)])
        .row([panel("hp_wastegate_position", "wastegate (%)", 100.0, color::BLUE)?.y_range(62.5, 71.5)])
        .row([panel("exhaust_manifold_pressure", "exhaust (kPa)", 1e-3, color::VERMILION)?
            .y_range(147.0, 163.0)])
        .shared_x();
    Ok(Evidence {
        drawings: vec![(
            "Pump run: voltage at the valve, tank pressure, wastegate position, pressure upstream of the \
             turbine."
                .into(),
            figure.into(),
        )],
        claims: vec![
            Claim::calibration("pump_on", begin, "s", PAPER.0 - 1.0..=PAPER.0 + 1.0)
                .paper("The vacuum pump is switched on at 72.5 s.")
                .paper_value(PAPER.0)
                .how(
                    "Communication point at which the relay switches on, starting from a tank at 30 \
                     kPa. The tank volume was chosen to match it. The range is one second around the \
                     paper's number.",
                ),
            Claim::calibration("pump_duration", end - begin, "s", duration - 0.25..=duration + 0.25)
                .paper("The pump runs until 82.2 s, that is for 9.7 s.")
                .paper_value(duration)
                .how(
                    "Time from the relay switching on to switching off. The pump flow was chosen to \
                     match it. The range is a quarter of a second, the reading accuracy of a plot.",
                ),
            Claim::calibration("voltage_drop", -least(change("valve.voltage")?), "V", 0.1..)
                .paper("The pump generates a voltage drop.")
                .how(
                    "Drop of valve.voltage while the pump runs: the scenario's pump.voltage_drop. The \
                     bound requires a drop.",
                ),
            Claim::prediction("position_change", greatest(moved), "% of stroke", 1.0..)
                .paper("The voltage drop generates a change in wastegate position.")
                .how(
                    "Largest change of hp_wastegate_position while the pump runs. The bound requires a \
                     change visible in a plot.",
                ),
        ],
        notes: vec![format!(
            "The exhaust force on the wastegate is neglected, as in the paper, so the pressure upstream \
             of the turbine, {:.0} kPa, has no effect on it here.",
            1e-3 * at(&record, "exhaust_manifold_pressure", begin)?
        )],
    })
}
