//! Fig. 9: validation of the actuator model with a duty ramp and duty steps.

use anyhow::{Context, Result};

use super::measure::{at, between, greatest, row};
use super::{Claim, Evidence, Laboratory, curve, shipped};
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
    Ok(Evidence {
        drawings: vec![("Model only: the paper's measurements are not published.".into(), figure.into())],
        claims: vec![
            Claim::prediction("ramp_deviation", greatest(lag), "Pa", ..=2000.0)
                .paper(
                    "The dynamic behaviour of the actuator pressure is satisfactorily reproduced: in a \
                     ramp it follows the duty.",
                )
                .how(
                    "Largest difference between actuator_pressure and valve.pressure, eq. (7), or tank \
                     pressure if higher. The bound is the error of a 0.5 s lag on the steepest part of \
                     the ramp, 4 kPa/s.",
                ),
            Claim::calibration("evacuation_time", evacuating(0.95)?, "s", 0.05..=0.5)
                .paper(
                    "The same in a step up of the duty, which evacuates the actuator: it is followed at \
                     once.",
                )
                .how(
                    "Time to 95 % of the change of actuator_pressure after the step from 20 to 80 %. \
                     The area to the tank is printed. The paper's measurements are not published; the \
                     range requires tenths of a second.",
                ),
            Claim::calibration("venting_time", venting(0.95)?, "s", 0.05..=0.5)
                .paper("The same in a step down, which vents it.")
                .how(
                    "Time to 95 % after the step from 80 to 20 %. The area to ambient was corrected \
                     from the printed 8e-9 to 8e-7 m\u{b2}; as printed, venting takes tens of seconds.",
                ),
            Claim::prediction("tank_is_floor", greatest(below_tank), "Pa", ..=10.0)
                .paper("The lowest possible actuator pressure is the tank pressure.")
                .how(
                    "Largest excess of tank_pressure over actuator_pressure; negative if there is none. \
                     The bound is 0.01 % of ambient pressure, the solver's accuracy.",
                ),
            Claim::prediction("tank_pressure_rise", tank, "Pa", 500.0..)
                .paper("Evacuating the actuator raises the tank pressure.")
                .how(
                    "Change of tank_pressure from the step up to the step down 3 s later, including \
                     leakage. The bound requires a rise visible in a plot.",
                ),
        ],
        notes: vec![format!(
            "Times to 63 %: actuator pressure {:.2} s evacuating and {:.2} s venting, wastegate {:.2} s.",
            evacuating(0.63)?,
            venting(0.63)?,
            position(0.63)?
        )],
    })
}
