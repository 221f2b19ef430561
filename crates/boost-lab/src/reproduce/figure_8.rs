//! Fig. 8: the spring, and what the vacuum pump's current does to the wastegate.

use anyhow::{Context, Result, bail};

use super::measure::{at, greatest, least};
use super::{Basis, Claim, Evidence, Laboratory, shipped};
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
    let (name, text) = shipped!("figure_7.toml");
    let scenario = laboratory.scenario(name, text)?;
    let record = laboratory.run(&scenario)?;
    // The rising duty alone: the spring is the same for both.
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
            "The spring's force over the rod's position, from the ramp of Fig. 7.".into(),
            Figure::new().row([panel]).into(),
        )],
        claims: vec![Claim {
            name: "spring_stiffening",
            paper: "The spring has a nonlinear behaviour.",
            paper_value: None,
            value: stiffness(8.0, 9.5) / stiffness(1.0, 4.0),
            unit: "",
            least: Some(1.5),
            most: None,
            basis: Basis::Calibration,
            how: "The mean stiffness between 8 and 9.5 mm over that between 1 and 4 mm, of actuator.spring_force \
                  over actuator.position. The bound asks for half as much again.",
        }],
        notes: vec![],
    })
}

/// Fig. 8(b).
fn pump(laboratory: &mut Laboratory) -> Result<Evidence> {
    let (name, text) = shipped!("figure_8.toml");
    let scenario = laboratory.scenario(name, text)?;
    let record = laboratory.run(&scenario)?;
    let time = record.time();
    let runs = record.get("vacuum_pump")?.iter().enumerate().filter(|(_, pump)| **pump > 0.5);
    let rows: Vec<_> = runs.map(|(row, _)| row).collect();
    let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else { bail!("the pump does not run") };
    // A row has the controller's outputs of the communication point before.
    let before = first.checked_sub(1).context("the pump runs from the start")?;
    let (begin, end) = (time[before], time[last]);
    let change = |name: &str| {
        let values = record.get(name)?;
        Ok::<_, anyhow::Error>(
            values[first..=last].iter().map(|value| value - values[before]).collect::<Vec<_>>(),
        )
    };
    let panel = |name, label, factor: f64, color| {
        let line = Line::new(time, record.get(name)?.iter().map(|value| factor * value).collect::<Vec<_>>());
        let panel = Panel::new("time (s)", label).height(110).x_range(60.0, 90.0).x_band(begin, end);
        Ok::<_, anyhow::Error>(panel.line(line.color(color)))
    };
    let title = "(b) 2000 rpm and a duty of 50 %; the pump runs in the shaded time";
    let figure = Figure::new()
        .row([panel("valve.voltage", "supply (V)", 1.0, color::INK)?.y_range(11.45, 12.15).title(title)])
        .row([panel("tank_pressure", "tank (kPa)", 1e-3, color::SKY)?.y_range(28.5, 36.5)])
        .row([panel("hp_wastegate_position", "wastegate (%)", 100.0, color::BLUE)?.y_range(62.5, 71.5)])
        .row([panel("exhaust_manifold_pressure", "exhaust (kPa)", 1e-3, color::VERMILION)?
            .y_range(147.0, 163.0)])
        .shared_x();
    Ok(Evidence {
        drawings: vec![(
            "The pump's run: voltage at the valve, tank pressure, wastegate position, pressure before the turbine."
                .into(),
            figure.into(),
        )],
        claims: vec![
            Claim {
                name: "pump_on",
                paper: "The vacuum pump is switched on at 72.5 s.",
                paper_value: Some(PAPER.0),
                value: begin,
                unit: "s",
                least: Some(PAPER.0 - 1.0),
                most: Some(PAPER.0 + 1.0),
                basis: Basis::Calibration,
                how: "The communication point at which the relay switches on, the time counted from a tank at \
                      30 kPa. The tank's volume was chosen by it. The range is one second about the paper's number.",
            },
            Claim {
                name: "pump_duration",
                paper: "The pump runs until 82.2 s, that is for 9.7 s.",
                paper_value: Some(PAPER.1 - PAPER.0),
                value: end - begin,
                unit: "s",
                least: Some(PAPER.1 - PAPER.0 - 0.25),
                most: Some(PAPER.1 - PAPER.0 + 0.25),
                basis: Basis::Calibration,
                how: "From the relay's switching on to its switching off. The pump's mass flow was chosen by it. The \
                      range is a quarter of a second, what can be read from a plot.",
            },
            Claim {
                name: "voltage_drop",
                paper: "The pump generates a voltage drop.",
                paper_value: None,
                value: -least(change("valve.voltage")?),
                unit: "V",
                least: Some(0.1),
                most: None,
                basis: Basis::Calibration,
                how: "By how much valve.voltage falls while the pump runs: the scenario's pump.voltage_drop. The \
                      bound asks for more than nothing.",
            },
            Claim {
                name: "position_change",
                paper: "The voltage drop generates a change in wastegate position.",
                paper_value: None,
                value: greatest(change("hp_wastegate_position")?.iter().map(|change| 100.0 * change.abs())),
                unit: "% of stroke",
                least: Some(1.0),
                most: None,
                basis: Basis::Prediction,
                how: "By how much hp_wastegate_position changes at most while the pump runs. The bound asks for a \
                      change that a plot shows.",
            },
        ],
        notes: vec![format!(
            "The exhaust's force on the wastegate is neglected, as in the paper, which finds its effect negligible: \
             the pressure before the turbine, {:.0} kPa, acts on nothing here.",
            1e-3 * at(&record, "exhaust_manifold_pressure", begin)?
        )],
    })
}
