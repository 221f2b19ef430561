//! Fig. 9: validation of the actuator model with a duty ramp and duty steps.

use anyhow::{Context, Result};

use super::measure::{at, between, greatest, row};
use super::{Evidence, Laboratory, curve, shipped};
use fmu_plot::{Figure, Panel, color};
use fmu_record::Record;

/// When the duty steps up and down (s).
const STEPS: (f64, f64) = (1.0, 4.0);

/// The time from a step until a variable has completed a share of its change (s).
fn settling(record: &Record, name: &str, begin: f64, end: f64, share: f64) -> Result<f64> {
    let values = between(record, name, begin, end)?;
    let (from, to) = (values[0], values[values.len() - 1]);
    let reached = values.iter().position(|value| (value - from) / (to - from) >= share);
    let reached = reached.with_context(|| format!("{name} does not move"))?;
    Ok(record.time()[row(record, begin)? + reached] - begin)
}

fn panels(record: &Record, letter: &str, end: f64) -> Result<[Panel; 3]> {
    let line = |name, factor| curve(record, name, factor);
    let panel = |label, height| Panel::new("time (s)", label).height(height).x_range(0.0, end);
    Ok([
        panel("duty (%)", 80).title(letter).line(line("hp_wastegate_pwm", 1.0)?.color(color::INK)),
        panel("pressure (kPa)", 190)
            .line(line("valve.pressure", 1e-3)?.thin().color(color::GRAY).label("eq. (7)"))
            .line(line("actuator_pressure", 1e-3)?.color(color::VERMILION).label("actuator"))
            .line(line("tank_pressure", 1e-3)?.color(color::SKY).label("tank")),
        panel("wastegate (%)", 120).line(line("hp_wastegate_position", 100.0)?.color(color::VERMILION)),
    ])
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_9_ramp.toml"))?;
    let ramp = laboratory.run(&scenario)?;
    let scenario = laboratory.scenario(shipped!("figure_9_step.toml"))?;
    let step = laboratory.run(&scenario)?;

    // The chamber follows the valve down to tank pressure.
    let mut lag = vec![];
    let mut below_tank = vec![];
    let pressures = ramp.get("actuator_pressure")?.iter().zip(ramp.get("valve.pressure")?);
    for ((&actuator, &valve), &tank) in pressures.zip(ramp.get("tank_pressure")?) {
        lag.push((actuator - valve.max(tank)).abs());
        below_tank.push(tank - actuator);
    }
    let evacuating = |share| settling(&step, "actuator_pressure", STEPS.0, STEPS.1, share);
    let venting = |share| settling(&step, "actuator_pressure", STEPS.1, 7.0, share);
    let position = |share| settling(&step, "hp_wastegate_position", STEPS.0, STEPS.1, share);
    let tank = at(&step, "tank_pressure", STEPS.1)? - at(&step, "tank_pressure", STEPS.0)?;

    let figure = panels(&ramp, "(a) Duty ramp", 25.0)?
        .into_iter()
        .zip(panels(&step, "(b) Duty steps", 7.0)?)
        .fold(Figure::new(), |figure, (left, right)| figure.row([left, right]))
        .shared_x();
    let results = vec![
        ("ramp_deviation", greatest(lag)),
        ("evacuation_time", evacuating(0.95)?),
        ("venting_time", venting(0.95)?),
        ("tank_is_floor", greatest(below_tank)),
        ("tank_pressure_rise", tank),
    ];
    let caption = "Model only: the paper's measurements are not published.";
    Ok(Evidence::new(results).drawing(caption, figure).note(format!(
        "Times to 63 %: actuator pressure {:.2} s evacuating and {:.2} s venting, wastegate {:.2} s.",
        evacuating(0.63)?,
        venting(0.63)?,
        position(0.63)?
    )))
}
