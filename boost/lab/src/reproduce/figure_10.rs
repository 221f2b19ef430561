//! Fig. 10: the compensator, eq. (9), in the dip of Fig. 1.

use anyhow::Result;
use fmu_package::Value;

use super::measure::{at, between, greatest, range};
use super::{Evidence, Laboratory, curve, over_time, shipped};
use fmu_master::scenario::Signal;
use fmu_plot::{Figure, color};

/// The voltage edges (s).
const EDGES: [f64; 2] = [2.0, 6.0];
/// The nominal voltage (V).
const NOMINAL: f64 = 12.0;
const POSITION: &str = "hp_wastegate_position";

pub fn reproduce(laboratory: &mut Laboratory) -> Result<Evidence> {
    let compensated = laboratory.scenario(shipped!("figure_10.toml"))?;
    let mut without = compensated.clone();
    without.set_value("controller", "compensate_voltage", Value::Boolean(false))?;
    // The plant on its own, with eq. (9) for the instantaneous voltage.
    let mut exact = laboratory.scenario(shipped!("figure_1.toml"))?;
    let duty = exact.input("hp_wastegate_pwm").map_or(f64::NAN, |signal| signal.at(0.0));
    let voltage = exact.input("supply_voltage").map_or(&[] as &[_], Signal::points);
    let duties = voltage.iter().map(|&(time, voltage)| (time, duty * NOMINAL / voltage)).collect();
    exact.set_input("hp_wastegate_pwm", Signal::Steps(duties))?;

    let exact = laboratory.run(&exact)?;
    let without = laboratory.run(&without)?;
    let compensated = laboratory.run(&compensated)?;

    let (mut pulses, mut left) = (vec![], vec![]);
    for edge in EDGES {
        let before = at(&compensated, POSITION, edge)?;
        let pulse = between(&compensated, POSITION, edge, edge + 1.0)?;
        pulses.push(100.0 * greatest(pulse.iter().map(|position| (position - before).abs())));
        let end = at(&compensated, POSITION, edge + 3.9)?;
        left.push(100.0 * (at(&compensated, POSITION, edge + 0.1)? - end).abs());
    }
    let rest = 100.0 * (at(&compensated, POSITION, 5.9)? - at(&compensated, POSITION, EDGES[0])?).abs();

    let position = |record| curve(record, POSITION, 100.0);
    let voltage = curve(&compensated, "supply_voltage", 1.0)?.held().color(color::INK);
    let duty = curve(&compensated, "hp_wastegate_pwm", 1.0)?.held();
    let positions = [
        position(&without)?.color(color::INK).label("without compensator"),
        position(&compensated)?.dashed().label("with compensator"),
    ];
    let figure = Figure::new()
        .row([over_time("supply (V)", 80, [voltage])])
        .row([over_time("wastegate (%)", 190, positions)])
        .row([over_time("duty (%)", 80, [duty])])
        .shared_x();
    let results = vec![
        ("position_range_exact", 100.0 * range(exact.get(POSITION)?)),
        ("position_at_rest", rest),
        ("position_after_pulse", greatest(left)),
        ("position_range_without", 100.0 * range(without.get(POSITION)?)),
    ];
    let caption = "Supply voltage, wastegate position without and with compensator, and compensated duty.";
    Ok(Evidence::new(results).drawing(caption, figure).note(format!(
        "The measurement lag leaves a pulse of up to {:.1} % of stroke, shorter than 0.1 s, at each edge.",
        greatest(pulses)
    )))
}
