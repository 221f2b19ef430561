//! Fig. 12: the controller structure: its logged terms add up to its output.

use anyhow::Result;

use super::measure::greatest;
use super::{Drawing, Evidence, Laboratory, curve, over_time, shipped};
use fmu_plot::{Figure, Line, color};

/// The drawing in the documentation of `BoostController`.
const STRUCTURE: &str = include_str!("../../../../modelDescription/documentation/controller_structure.svg");

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let scenario = laboratory.scenario(shipped!("figure_12.toml"))?;
    let record = laboratory.run(&scenario)?;
    let get = |name| record.get(name);
    let terms = ["feedforward_pwm", "proportional_term", "integral_term", "derivative_term"];

    // At the start the controller has not yet sampled.
    let [mut sum_error, mut output_error, mut is_at_limit] = <[Vec<f64>; 3]>::default();
    for row in 1..record.time().len() {
        let at = |name| Ok::<_, anyhow::Error>(get(name)?[row]);
        let sum = terms.iter().map(|name| at(name)).sum::<Result<f64>>()?;
        let unsaturated = at("unsaturated_pwm")?;
        sum_error.push((sum - unsaturated).abs());
        let compensation = at("voltage_compensation")?;
        let saturated = unsaturated.clamp(at("pwm_min")?, at("pwm_max")?.min(100.0 / compensation));
        output_error.push((saturated * compensation - at("hp_wastegate_pwm")?).abs());
        is_at_limit.push(at("saturated")?);
    }

    let line = |name, factor| curve(&record, name, factor).map(Line::held);
    let pressures = [
        line("boost_reference", 1e-3)?.thin().color(color::INK).label("reference"),
        line("reference_model_pressure", 1e-3)?.dashed().color(color::GREEN).label("reference model"),
        line("boost_pressure", 1e-3)?.label("actual"),
    ];
    let output = line("hp_wastegate_pwm", 1.0)?.color(color::VERMILION);
    let duties = [
        line("feedforward_pwm", 1.0)?.dashed().color(color::GREEN).label("feedforward"),
        line("unsaturated_pwm", 1.0)?.color(color::INK).thin().label("sum of all terms"),
        output.label("output, limited and compensated for 13 V"),
    ];
    let terms = [
        line("proportional_term", 1.0)?.label("proportional"),
        line("integral_term", 1.0)?.color(color::VERMILION).label("integral"),
        line("derivative_term", 1.0)?.color(color::PURPLE).label("derivative"),
    ];
    let figure = Figure::new()
        .row([over_time("boost pressure (kPa)", 130, pressures)])
        .row([over_time("duty at 12 V (%)", 150, duties)])
        .row([over_time("terms (%)", 130, terms)])
        .shared_x();
    let results = vec![
        ("sum_of_terms", greatest(sum_error)),
        ("compensated_output", greatest(output_error)),
        ("limits_act", is_at_limit.iter().sum()),
    ];
    Ok(Evidence::new(results)
        .drawing(
            "Controller structure. Pale: the reference model, added here; the paper's structure passes the reference \
             straight through. The gain schedule acts along the dashed lines.",
            Drawing::Picture(without_links(STRUCTURE)),
        )
        .drawing("Block outputs in reference steps at 13 V supply.", figure)
        .note(
            "In addition to the paper's blocks there is a reference model (off if the parameter structure is paper): \
             it gives feedforward and feedback the expected pressure and removes the overshoot.",
        ))
}

/// Replaces a picture's links, whose targets are in the documentation, with groups.
fn without_links(svg: &str) -> String {
    let mut parts = svg.split(" href=\"");
    let first = parts.next().unwrap_or_default().to_owned();
    let text = parts.fold(first, |text, part| text + part.split_once('"').map_or("", |(_, rest)| rest));
    text.replace("<a", "<g").replace("</a>", "</g>")
}
