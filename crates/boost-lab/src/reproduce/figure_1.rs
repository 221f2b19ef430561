//! Fig. 1: 0.8 V less moves the actuator pressure by 2500 Pa and the wastegate by a tenth of its stroke.

use anyhow::Result;

use super::measure::at;
use super::{Basis, Claim, Evidence, Laboratory, shipped};
use fmu_plot::{Figure, Line, Panel, color};

/// The beginning and end of the dip (s).
const DIP: (f64, f64) = (2.0, 6.0);

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let (name, text) = shipped!("figure_1.toml");
    let scenario = laboratory.scenario(name, text)?;
    let record = laboratory.run(&scenario)?;
    let change = |name| Ok::<_, anyhow::Error>(at(&record, name, DIP.1)? - at(&record, name, DIP.0)?);

    let panel = |name, label, factor: f64| {
        let values = record.get(name)?.iter().map(move |value| factor * value);
        let line = Line::new(record.time(), values.collect::<Vec<_>>());
        Ok::<_, anyhow::Error>(Panel::new("time (s)", label).height(120).x_band(DIP.0, DIP.1).line(line))
    };
    let voltage =
        Line::new(record.time(), record.get("supply_voltage")?.iter().copied()).held().color(color::INK);
    let figure = Figure::new()
        .row([Panel::new("time (s)", "supply (V)").height(80).x_band(DIP.0, DIP.1).line(voltage)])
        .row([panel("actuator_pressure", "actuator (kPa)", 1e-3)?])
        .row([panel("hp_wastegate_position", "wastegate (%)", 100.0)?])
        .row([panel("boost_pressure", "boost (kPa)", 1e-3)?])
        .shared_x();
    Ok(Evidence {
        drawings: vec![(
            "Supply voltage, actuator pressure, wastegate position and boost pressure.".into(),
            figure.into(),
        )],
        claims: vec![
            Claim {
                name: "actuator_pressure_change",
                paper: "From 11.9 V to 11.1 V, the chamber pressure changes by 2500 Pa.",
                paper_value: Some(2500.0),
                value: change("actuator_pressure")?,
                unit: "Pa",
                least: Some(2450.0),
                most: Some(2550.0),
                basis: Basis::Prediction,
                how: "Difference of actuator_pressure between 6 s and 2 s. It follows from the printed coefficients \
                      of Table 1, with the sign of the third corrected, and the duty's proportionality to the \
                      voltage. The range takes the paper's number as rounded to hundreds.",
            },
            Claim {
                name: "position_change",
                paper: "The wastegate valve position changes by about 10 %.",
                paper_value: Some(10.0),
                value: 100.0 * -change("hp_wastegate_position")?,
                unit: "% of stroke",
                least: Some(9.0),
                most: Some(11.0),
                basis: Basis::Calibration,
                how: "Difference of hp_wastegate_position between 2 s and 6 s. The spring stiffness was chosen to \
                      match it. \u{201c}About 10 %\u{201d} is read as within one point.",
            },
        ],
        notes: vec![format!(
            "Boost pressure, not shown in the paper's figure, rises by {:.1} kPa: the effect of a voltage dip without \
             compensation.",
            1e-3 * change("boost_pressure")?
        )],
    })
}
