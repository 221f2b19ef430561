//! Fig. 13: steps of the boost reference at 1500 rpm.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{Following, greatest, least};
use super::{Basis, Claim, Evidence, Laboratory, shipped};
use fmu_master::scenario::Signal;
use fmu_plot::{Figure, Line, Panel, color};
use fmu_record::Record;

/// The error (kPa) that is shown: a step itself is larger, and would hide how it is followed.
const SHOWN_ERROR: f64 = 7.0;

fn draw(record: &Record, title: &str) -> Result<Figure> {
    let kilo =
        |name| Ok::<_, anyhow::Error>(record.get(name)?.iter().map(|value| 1e-3 * value).collect::<Vec<_>>());
    let time = record.time();
    let (reference, actual) = (kilo("boost_reference")?, kilo("boost_pressure")?);
    let error: Vec<_> = actual.iter().zip(&reference).map(|(actual, reference)| actual - reference).collect();
    Ok(Figure::new()
        .row([Panel::new("time (s)", "boost pressure (kPa)")
            .title(title)
            .height(210)
            .line(Line::new(time, reference).held().color(color::INK).thin().label("reference"))
            .line(Line::new(time, actual).label("actual"))])
        .row([Panel::new("time (s)", "error (kPa)")
            .height(170)
            .y_range(-SHOWN_ERROR, SHOWN_ERROR)
            .band(-1.0, 5.0)
            .line(Line::new(time, error))])
        .row([Panel::new("time (s)", "duty (%)")
            .height(120)
            .line(Line::new(time, record.get("hp_wastegate_pwm")?.iter().copied()).held())])
        .shared_x())
}

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let (name, text) = shipped!("figure_13.toml");
    let scenario = laboratory.scenario(name, text)?;
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
                "Reference and actual boost pressure, the error, actual minus reference, and the duty. The band is the \
                 paper's 5 kPa above a reference that stepped up and 1 kPa below one that stepped down.".into(),
                draw(&record, "With the reference model (the default)")?.into(),
            ),
            (
                "The same with the feedback structure that the paper prints.".into(),
                draw(&paper, "With the structure of the paper")?.into(),
            ),
        ],
        claims: claims(&following, &papers, least(duty.iter().copied())),
        notes: vec![
            format!(
                "With the paper's own structure the pressure falls {:.1} kPa below the reference after a step down, where \
                 the paper reports 1 kPa: a static feedforward beside an integral overshoots by its design. The \
                 reference model removes this.",
                1e-3 * greatest(papers.down.iter().copied())
            ),
            "The paper prints neither the levels of the steps nor \u{3bb} nor the controller's maps: they are chosen."
                .into(),
        ],
    })
}

/// The claims for the steps with the reference model, and with the paper's own structure.
fn claims(following: &Following, papers: &Following, least_duty: f64) -> Vec<Claim> {
    vec![
        Claim {
            name: "overshoot_up",
            paper: "For a positive step of the reference, the undershoot is limited to 5 kPa.",
            paper_value: Some(5000.0),
            value: greatest(following.up.iter().copied()),
            unit: "Pa",
            least: None,
            most: Some(5000.0),
            basis: Basis::Prediction,
            how: "The most by which boost_pressure exceeds the new reference after a step up. What the \
                      paper calls undershoot and overshoot is taken alike: the deviation beyond the new \
                      reference, for the one on this side of it is the step itself. The paper's own bound.",
        },
        Claim {
            name: "overshoot_down",
            paper: "For a decrease of the reference, the largest overshoot is only 1 kPa.",
            paper_value: Some(1000.0),
            value: greatest(following.down.iter().copied()),
            unit: "Pa",
            least: None,
            most: Some(1000.0),
            basis: Basis::Prediction,
            how: "The most by which boost_pressure falls below the new reference after a step down. The \
                      paper's own bound.",
        },
        Claim {
            name: "rise_time",
            paper: "Boost pressure follows the steps; the saturation of the PWM signal guarantees a fast \
                      response.",
            paper_value: None,
            value: greatest(following.rise.iter().copied()),
            unit: "s",
            least: None,
            most: Some(0.9),
            basis: Basis::Prediction,
            how: "The longest time from a step to the first sample within a tenth of it. The bound is \
                      three times the controller's \u{3bb} of 0.3 s; a lag of \u{3bb} alone takes 2.3 times \
                      it.",
        },
        Claim {
            name: "end_error",
            paper: "Boost pressure follows the steps in reference value correctly.",
            paper_value: None,
            value: greatest(following.end_error.iter().copied()),
            unit: "Pa",
            least: None,
            most: Some(22.0),
            basis: Basis::Prediction,
            how: "The largest error just before the next step. The bound is the reference solution's 2 Pa, and 0.01 % \
                      of a full scale of 200 kPa.",
        },
        Claim {
            name: "least_duty",
            paper: "The PWM signal saturates, which guarantees a fast response.",
            paper_value: None,
            value: least_duty,
            unit: "%",
            least: None,
            most: Some(25.0 + 1e-9),
            basis: Basis::Construction,
            how: "The least duty: it reaches the lower limit, 25 %.",
        },
        Claim {
            name: "paper_structure_overshoot_up",
            paper: "For a positive step, limited to 5 kPa: with the paper's own structure.",
            paper_value: Some(5000.0),
            value: greatest(papers.up.iter().copied()),
            unit: "Pa",
            least: None,
            most: Some(5000.0),
            basis: Basis::Prediction,
            how: "As above, with the parameter structure at paper.",
        },
    ]
}
