//! Fig. 14: boost control under supply voltage steps.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{at, greatest, range};
use super::{Evidence, Laboratory, boost_error, curve, shipped, steps};
use fmu_plot::{Figure, Panel, color};
use fmu_record::Record;

/// The end of the start-up (s).
const STARTED: f64 = 3.0;

/// The largest error of boost pressure (Pa).
fn deviation(record: &Record) -> Result<f64> {
    let errors = record.get("boost_pressure")?.iter().zip(record.get("boost_reference")?);
    let errors = record.time().iter().zip(errors).filter(|(time, _)| **time > STARTED);
    Ok(greatest(errors.map(|(_, (boost, reference))| (boost - reference).abs())))
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_14.toml"))?;
    let mut without = scenario.clone();
    without.set_value("controller", "compensate_voltage", Value::Boolean(false))?;
    let record = laboratory.run(&scenario)?;
    let without = laboratory.run(&without)?;
    let ends = steps(&scenario, "supply_voltage").into_iter().map(|(.., end)| end);
    let positions = ends.map(|end| at(&record, "hp_wastegate_position", end)).collect::<Result<Vec<_>>>()?;

    let voltage = curve(&record, "supply_voltage", 1.0)?.held().color(color::INK);
    let duty = curve(&record, "hp_wastegate_pwm", 1.0)?.held().color(color::INK);
    let reference = curve(&record, "boost_reference", 1e-3)?.thin().color(color::INK);
    let actual = curve(&record, "boost_pressure", 1e-3)?;
    let figure = Figure::new()
        .row([Panel::new("time (s)", "supply (V)").height(80).line(voltage)])
        .row([Panel::new("time (s)", "boost pressure (kPa)")
            .height(170)
            .line(reference.label("reference"))
            .line(actual.label("actual"))])
        .row([Panel::new("time (s)", "error (kPa)")
            .height(170)
            .band(-1.0, 1.0)
            .line(boost_error(&without)?.thin().color(color::VERMILION).label("without compensator"))
            .line(boost_error(&record)?.label("with compensator"))])
        .row([Panel::new("time (s)", "duty (%)").height(80).line(duty)])
        .shared_x();
    let results = vec![
        ("deviation", deviation(&record)?),
        ("rejection", deviation(&without)? / deviation(&record)?),
        ("position_at_rest", 100.0 * range(&positions)),
    ];
    Ok(Evidence::new(results)
        .drawing(
            "Supply voltage, reference and actual boost pressure, error (actual minus reference) with and without \
             compensator, and duty. The band is the paper's 1 kPa.",
            figure,
        )
        .note(format!("Without compensation the error is {:.1} kPa.", 1e-3 * deviation(&without)?)))
}
