//! Fig. 13: boost reference steps at 1500 rpm.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{Following, greatest, least};
use super::{Evidence, Laboratory, boost_error, curve, over_time, shipped};
use fmu_master::scenario::Signal;
use fmu_plot::{Figure, color};
use fmu_record::Record;

/// The error shown (kPa): larger errors, at the steps themselves, would hide the tracking.
const SHOWN_ERROR: f64 = 7.0;

fn draw(record: &Record, title: &str) -> Result<Figure> {
    let reference = curve(record, "boost_reference", 1e-3)?.held().color(color::INK).thin();
    let actual = curve(record, "boost_pressure", 1e-3)?;
    let pressures = [reference.label("reference"), actual.label("actual")];
    let error = over_time("error (kPa)", 170, [boost_error(record)?]);
    Ok(Figure::new()
        .row([over_time("boost pressure (kPa)", 210, pressures).title(title)])
        .row([error.y_range(-SHOWN_ERROR, SHOWN_ERROR).band(-1.0, 5.0)])
        .row([over_time("duty (%)", 120, [curve(record, "hp_wastegate_pwm", 1.0)?.held()])])
        .shared_x())
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_13.toml"))?;
    let mut paper = scenario.clone();
    paper.set_value("controller", "structure", Value::String("paper".to_owned()))?;
    let steps = scenario.input("boost_reference").map_or(&[] as &[_], Signal::points);

    let record = laboratory.run(&scenario)?;
    let paper = laboratory.run(&paper)?;
    let following = Following::new(&record, "boost_pressure", steps)?;
    let papers = Following::new(&paper, "boost_pressure", steps)?;
    let duty = record.get("hp_wastegate_pwm")?;
    let results = vec![
        ("overshoot_up", greatest(following.up)),
        ("overshoot_down", greatest(following.down)),
        ("rise_time", greatest(following.rise)),
        ("end_error", greatest(following.end_error)),
        ("least_duty", least(duty.iter().copied())),
        ("paper_structure_overshoot_up", greatest(papers.up)),
        ("paper_structure_overshoot_down", greatest(papers.down)),
    ];
    Ok(Evidence::new(results)
        .drawing(
            "Reference and actual boost pressure, error (actual minus reference), and duty. The band is the paper's \
             5 kPa above the reference after a step up and 1 kPa below it after a step down.",
            draw(&record, "With the reference model (the default)")?,
        )
        .drawing(
            "The same with the paper's feedback structure.",
            draw(&paper, "With the paper's structure")?,
        )
        .note("The paper prints neither the step levels nor \u{3bb} nor the controller's maps: they are chosen."))
}
