//! Fig. 13: boost reference steps at 1500 rpm.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{Following, greatest, least};
use super::{Evidence, Laboratory, boost_error, curve, shipped};
use fmu_master::scenario::Signal;
use fmu_plot::{Figure, Panel, color};
use fmu_record::Record;

/// The error shown (kPa): larger errors, at the steps themselves, would hide the tracking.
const SHOWN_ERROR: f64 = 7.0;

fn draw(record: &Record, title: &str) -> Result<Figure> {
    let reference = curve(record, "boost_reference", 1e-3)?.held().color(color::INK).thin();
    let actual = curve(record, "boost_pressure", 1e-3)?;
    Ok(Figure::new()
        .row([Panel::new("time (s)", "boost pressure (kPa)")
            .title(title)
            .height(210)
            .line(reference.label("reference"))
            .line(actual.label("actual"))])
        .row([Panel::new("time (s)", "error (kPa)")
            .height(170)
            .y_range(-SHOWN_ERROR, SHOWN_ERROR)
            .band(-1.0, 5.0)
            .line(boost_error(record)?)])
        .row([Panel::new("time (s)", "duty (%)")
            .height(120)
            .line(curve(record, "hp_wastegate_pwm", 1.0)?.held())])
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
