//! Fig. 13: boost reference steps at 1500 rpm.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{Following, greatest, least};
use super::{Claim, Evidence, Laboratory, boost_error, curve, shipped};
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
    Ok(Evidence {
        drawings: vec![
            (
                "Reference and actual boost pressure, error (actual minus reference), and duty. The band \
                 is the paper's 5 kPa above the reference after a step up and 1 kPa below it after a step \
                 down."
                    .into(),
                draw(&record, "With the reference model (the default)")?.into(),
            ),
            (
                "The same with the paper's feedback structure.".into(),
                draw(&paper, "With the paper's structure")?.into(),
            ),
        ],
        claims: claims(&following, &papers, least(duty.iter().copied())),
        notes: vec![
            "The paper prints neither the step levels nor \u{3bb} nor the controller's maps: they are chosen."
                .into(),
        ],
    })
}

/// The claims for the steps with the reference model and with the paper's structure.
fn claims(following: &Following, papers: &Following, least_duty: f64) -> Vec<Claim> {
    vec![
        Claim::prediction("overshoot_up", greatest(following.up.iter().copied()), "Pa", ..=5000.0)
            .paper("For a positive step of the reference, the undershoot is limited to 5 kPa.")
            .paper_value(5000.0)
            .how(
                "Largest excess of boost_pressure over the new reference after a step up. The \
                     paper's undershoot and overshoot are both read as the deviation beyond the new \
                     reference, since on this side of it is the step itself. The bound is the paper's.",
            ),
        Claim::prediction("overshoot_down", greatest(following.down.iter().copied()), "Pa", ..=1000.0)
            .paper("For a decrease of the reference, the largest overshoot is only 1 kPa.")
            .paper_value(1000.0)
            .how(
                "Largest drop of boost_pressure below the new reference after a step down. The \
                     bound is the paper's.",
            ),
        Claim::prediction("rise_time", greatest(following.rise.iter().copied()), "s", ..=0.9)
            .paper(
                "Boost pressure follows the steps; the saturation of the PWM signal guarantees a \
                     fast response.",
            )
            .how(
                "Longest time from a step to the first sample within a tenth of it. The bound is \
                     three times the controller's \u{3bb} of 0.3 s; a first-order lag takes 2.3 \
                     \u{3bb}.",
            ),
        Claim::prediction("end_error", greatest(following.end_error.iter().copied()), "Pa", ..=22.0)
            .paper("Boost pressure follows the steps in reference value correctly.")
            .how(
                "Largest error just before the next step. The bound is the reference solution's 2 \
                     Pa plus 0.01 % of a full scale of 200 kPa.",
            ),
        Claim::construction("least_duty", least_duty, "%", ..=25.0 + 1e-9)
            .paper("The PWM signal saturates, which guarantees a fast response.")
            .how("Minimum duty: it reaches the lower limit, 25 %."),
        Claim::prediction(
            "paper_structure_overshoot_up",
            greatest(papers.up.iter().copied()),
            "Pa",
            ..=5000.0,
        )
        .paper("For a positive step, limited to 5 kPa: with the paper's structure.")
        .paper_value(5000.0)
        .how("As above, with the parameter structure set to paper."),
        Claim::prediction(
            "paper_structure_overshoot_down",
            greatest(papers.down.iter().copied()),
            "Pa",
            ..=1000.0,
        )
        .paper("For a decrease, only 1 kPa: with the paper's structure.")
        .paper_value(1000.0)
        .how("As above, with the parameter structure set to paper.")
        .differs(
            "a static feedforward with an integral term overshoots by design; the reference model removes this",
        ),
    ]
}
