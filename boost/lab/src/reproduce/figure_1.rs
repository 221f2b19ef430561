//! Fig. 1: 0.8 V less moves the actuator pressure by 2500 Pa and the wastegate by a tenth of its stroke.

use anyhow::Result;

use super::measure::at;
use super::{Evidence, Laboratory, curve, over_time, shipped};
use fmu_plot::{Figure, color};

/// The beginning and end of the dip (s).
const DIP: (f64, f64) = (2.0, 6.0);

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_1.toml"))?;
    let record = laboratory.run(&scenario)?;
    let change = |name| Ok::<_, anyhow::Error>(at(&record, name, DIP.1)? - at(&record, name, DIP.0)?);

    let panel = |label, line| over_time(label, 120, [line]).x_band(DIP.0, DIP.1);
    let voltage = curve(&record, "supply_voltage", 1.0)?.held().color(color::INK);
    let figure = Figure::new()
        .row([panel("supply (V)", voltage).height(80)])
        .row([panel("actuator (kPa)", curve(&record, "actuator_pressure", 1e-3)?)])
        .row([panel("wastegate (%)", curve(&record, "hp_wastegate_position", 100.0)?)])
        .row([panel("boost (kPa)", curve(&record, "boost_pressure", 1e-3)?)])
        .shared_x();
    let results = vec![
        ("actuator_pressure_change", change("actuator_pressure")?),
        ("position_change", 100.0 * -change("hp_wastegate_position")?),
    ];
    let caption = "Supply voltage, actuator pressure, wastegate position and boost pressure.";
    Ok(Evidence::new(results).drawing(caption, figure).note(format!(
        "Boost pressure, not shown in the paper's figure, rises by {:.1} kPa: the effect of a voltage dip without \
         compensation.",
        1e-3 * change("boost_pressure")?
    )))
}
