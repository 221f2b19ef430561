//! λ of the feedback: the shortest with which the vacuum pump sustains noise of the measured boost pressure at rest, by
//! runs of the loop.
//!
//! Each movement of the wastegate costs vacuum, and the shorter λ is, the more of the noise moves it.

use anyhow::{Result, bail};
use fmu_package::Value;

use super::schedule::lambda_parameter;
use super::{CellOrigin, Tuning};
use crate::study::case::Rig;
use crate::study::draw::Case;
use crate::study::names::{ALARM, PUMP, has};
use crate::study::situation::{Experiment, Situation};
use fmu_io::threads::each;
use fmu_master::measure::{between, greatest};
use fmu_master::scenario::{Assignment, Scenario};
use fmu_terms::Causality;

/// The standard deviation of the noise (Pa).
const NOISE: f64 = 100.0;
/// The loop is at rest after this time (s), and then judged for another.
const SETTLING: f64 = 10.0;
const JUDGED: f64 = 300.0;
/// The largest shares of that time with the pump on: at a point, and on average over the engine speeds.
const ON_AT_A_POINT: f64 = 0.95;
const ON_ON_AVERAGE: f64 = 0.8;
/// λ is a multiple of 1/100 s.
const PER_SECOND: f64 = 100.0;

/// The shortest λ (s), from the actuator's lag to the reference's time constant; none if the loop has no vacuum pump, or
/// no λ is sustained.
pub fn shortest_lambda(rig: &Rig, tuning: &Tuning, threads: usize) -> Result<Option<f64>> {
    let [(_, _, _, lag), _] = tuning.dynamics();
    let (Some(lag), Some(longest)) = (lag, tuning.task.schedule.reference_lambda) else { return Ok(None) };
    if !has(&rig.plant, Causality::Input, PUMP) || !has(&rig.controller, Causality::Output, PUMP) {
        return Ok(None);
    }
    let cases = at_rest(rig, tuning);
    let scenarios: Vec<_> = cases
        .iter()
        .map(|case| tuned(rig.scenario(case, rig.variant(None))?, tuning))
        .collect::<Result<_>>()?;
    let mut hundredths = (PER_SECOND * lag).ceil();
    while hundredths <= PER_SECOND * longest {
        let lambda = hundredths / PER_SECOND;
        let share = |scenario: &Scenario| share_on(rig, scenario.clone(), tuning, lambda);
        let shares = each(threads, &scenarios, share)?;
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        if greatest(shares) <= ON_AT_A_POINT && mean <= ON_ON_AVERAGE {
            return Ok(Some(lambda));
        }
        hundredths += 1.0;
    }
    Ok(None)
}

/// The loop at rest with noise: at each engine speed, at the middle one of the identified references.
fn at_rest(rig: &Rig, tuning: &Tuning) -> Vec<Case> {
    let schedule = &tuning.task.schedule;
    let ambient = ["ambient_pressure", "ambient_temperature"].map(|name| {
        let start = rig.plant.description().variable(name).and_then(|variable| variable.start.parse().ok());
        start.unwrap_or_default()
    });
    let case = |(column, &engine_speed): (usize, &f64)| {
        let identified = tuning
            .cells
            .iter()
            .filter(|cell| cell.column == column && cell.basis == CellOrigin::Identified)
            .map(|cell| schedule.boost_references[cell.row]);
        let references: Vec<_> = identified.collect();
        let reference = *references.get(references.len() / 2)?;
        let (supply, stop_time) = (schedule.nominal_voltage, SETTLING + JUDGED);
        let at_rest = Experiment::at_rest(ambient, supply, engine_speed, NOISE, reference);
        Some(Case {
            number: column,
            situation: Situation::Rest,
            drawn: vec![],
            parameters: vec![],
            experiment: Experiment { stop_time, ..at_rest },
        })
    };
    schedule.engine_speeds.iter().enumerate().filter_map(case).collect()
}

/// A scenario with the tuned controller and the plant that it is tuned to.
fn tuned(mut scenario: Scenario, tuning: &Tuning) -> Result<Scenario> {
    let [controller, plant] = scenario.fmus.as_mut_slice() else { bail!("a case has two FMUs") };
    controller.parameters.push((tuning.parameter_set("schedule"), controller.location.clone()));
    let sets = tuning.task.plant_parameters.iter();
    plant.parameters.extend(sets.map(|set| (set.clone(), plant.location.clone())));
    Ok(scenario)
}

/// The share of the judged time with the pump on; 1 with an alarm, after which the pump may be off.
fn share_on(rig: &Rig, mut scenario: Scenario, tuning: &Tuning, lambda: f64) -> Result<f64> {
    let controller = &mut scenario.fmus[0];
    controller.values.push(Assignment {
        name: lambda_parameter(tuning.task.schedule.strategy).to_owned(),
        value: Value::Real(lambda, None),
        location: controller.location.clone(),
    });
    let steps = scenario.steps as usize;
    let master = rig.run_to(&scenario, steps)?;
    let record = master.record();
    let judged = |name| between(record, name, SETTLING, SETTLING + JUDGED);
    if has(&rig.controller, Causality::Output, ALARM) && greatest(judged(ALARM)?.iter().copied()) > 0.0 {
        return Ok(1.0);
    }
    let on = judged(PUMP)?;
    Ok(on.iter().sum::<f64>() / on.len() as f64)
}
