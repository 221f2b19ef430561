//! Fig. 14: boost control under supply voltage steps.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{at, greatest, range};
use super::{Evidence, Laboratory, boost_error, curve, over_time, shipped, steps};
use fmu_plot::{Figure, color};
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
    let pressures = [reference.label("reference"), actual.label("actual")];
    let errors = [
        boost_error(&without)?.thin().color(color::VERMILION).label("without compensator"),
        boost_error(&record)?.label("with compensator"),
    ];
    let figure = Figure::new()
        .row([over_time("supply (V)", 80, [voltage])])
        .row([over_time("boost pressure (kPa)", 170, pressures)])
        .row([over_time("error (kPa)", 170, errors).band(-1.0, 1.0)])
        .row([over_time("duty (%)", 80, [duty])])
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
