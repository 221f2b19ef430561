//! The loop before and after a tuning, on the experiments by which a controller is judged: the steps of Fig. 13, ramps of
//! engine speed, and cases of the study on the plant that it is tuned to.

use std::path::Path;

use anyhow::{Context, Result, bail};
use clap::ValueEnum as _;
use fmu_io::threads::each;
use fmu_package::{ParameterSet, Value};
use serde::Serialize;

use super::Tuning;
use crate::reproduce::shipped;
use crate::study::case::{Measures, Rig};
use crate::study::criteria::NEAR;
use crate::study::draw::{Cases, Variant};
use crate::study::names::BOOST;
use crate::study::reach::Reach;
use crate::study::situation::{SETTLING, Situation};
use fmu_master::measure::{Following, greatest};
use fmu_master::scenario::{Scenario, Signal};

/// The cases of the study, and their seed: enough to see a loop that goes wrong.
const CASES: usize = 20;
const SEED: u64 = 1;

/// A measure of the loop before and after.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    pub experiment: String,
    pub measure: &'static str,
    pub unit: &'static str,
    pub before: f64,
    pub after: f64,
}

/// The loop of a controller with some parameter sets and the plant that a tuning is for.
struct Loop<'a> {
    rig: &'a Rig,
    tuning: &'a Tuning,
    variant: Variant<'a>,
}

/// Runs the experiments with the controller as it is and with the parameter set of a file.
pub fn compare(rig: &Rig, tuning: &Tuning, set: &Path, threads: usize) -> Result<Vec<Compared>> {
    let strategy = tuning.task.schedule.strategy.to_possible_value();
    let strategy = strategy.as_ref().map(clap::builder::PossibleValue::get_name);
    let files = [std::path::absolute(set)?];
    let with = |sets| Loop { rig, tuning, variant: Variant { strategy, ignores_findings: false, sets } };
    let (before, after) = (with(&[]), with(&files));
    let mut compared = vec![];
    let mut add =
        |experiment: &str, measures: &[(&'static str, &'static str)], [before, after]: [Vec<f64>; 2]| {
            for ((&(measure, unit), before), after) in measures.iter().zip(before).zip(after) {
                compared.push(Compared { experiment: experiment.to_owned(), measure, unit, before, after });
            }
        };
    let steps = [("largest overshoot up", "kPa"), ("largest overshoot down", "kPa"), ("slowest 90 %", "s")];
    add("Fig. 13, steps at 1500 rpm", &steps, [before.steps()?, after.steps()?]);
    let ramps = [("largest deviation", "kPa")];
    add("ramps of 250 to 2000 rpm/s at 145 kPa", &ramps, [before.ramps()?, after.ramps()?]);
    let cases = [("within 2 kPa", "%"), ("median deviation", "kPa"), ("largest deviation", "kPa")];
    add(
        &format!("{CASES} cases of the study on this plant"),
        &cases,
        [before.cases(threads)?, after.cases(threads)?],
    );
    Ok(compared)
}

impl Loop<'_> {
    fn scenario(&self, (name, text): (&str, &str)) -> Result<Scenario> {
        let none = Path::new("");
        let mut scenario = Scenario::parse(name, text, none, none)?;
        // A foreign plant may lack what the paper's experiments set and record.
        scenario.has_replaced_fmus = true;
        if let Some(strategy) = self.variant.strategy.filter(|_| self.has_strategy()) {
            scenario.set_value("controller", "strategy", Value::String(strategy.to_owned()))?;
        }
        let [controller, plant] = scenario.fmus.as_mut_slice() else { bail!("{name} has two FMUs") };
        for file in self.variant.sets {
            controller.parameters.push((ParameterSet::read(file)?, controller.location.clone()));
        }
        let sets = self.tuning.task.plant_parameters.iter();
        plant.parameters.extend(sets.map(|set| (set.clone(), plant.location.clone())));
        Ok(scenario)
    }

    fn has_strategy(&self) -> bool {
        self.rig.controller.description().variable("strategy").is_some()
    }

    /// Overshoots (kPa) and rise time (s).
    fn steps(&self) -> Result<Vec<f64>> {
        let scenario = self.scenario(shipped!("figure_13.toml"))?;
        let steps = scenario.input("boost_reference").map_or(&[] as &[_], Signal::points).to_vec();
        let master = self.rig.run_to(&scenario, scenario.steps as usize)?;
        let following = Following::new(master.record(), BOOST, &steps)?;
        Ok(vec![1e-3 * greatest(following.up), 1e-3 * greatest(following.down), greatest(following.rise)])
    }

    /// The largest deviation (kPa).
    fn ramps(&self) -> Result<Vec<f64>> {
        let scenario = self.scenario(shipped!("ramps.toml"))?;
        let reference = scenario.input("boost_reference").context("the ramps have a reference")?.at(0.0);
        let master = self.rig.run_to(&scenario, scenario.steps as usize)?;
        let record = master.record();
        let judged = record.time().iter().zip(record.get(BOOST)?).filter(|(time, _)| **time >= SETTLING);
        Ok(vec![1e-3 * greatest(judged.map(|(_, boost)| (boost - reference).abs()))])
    }

    /// The share of cases near the reachable reference (%), and the median and the largest deviation (kPa).
    fn cases(&self, threads: usize) -> Result<Vec<f64>> {
        let plant = self.rig.plant.description();
        let cases = Cases::draw(Situation::Ramps, plant, &[], CASES, SEED)?;
        let parameters = self.plant_parameters()?;
        let variant =
            Variant { strategy: self.variant.strategy.filter(|_| self.has_strategy()), ..self.variant };
        let deviation = |number| {
            let mut case = cases.case(number);
            case.parameters.clone_from(&parameters);
            let reach = Reach::of(&case, &self.rig.plant)?;
            let Measures { deviation, .. } = self.rig.measure(&case, &reach, variant)?;
            Ok(deviation)
        };
        let mut deviations = each(threads, 0..cases.len(), deviation)?;
        deviations.sort_by(f64::total_cmp);
        let near = deviations.iter().filter(|deviation| **deviation <= NEAR).count();
        Ok(vec![
            100.0 * near as f64 / deviations.len() as f64,
            1e-3 * deviations[deviations.len() / 2],
            1e-3 * greatest(deviations),
        ])
    }

    /// The plant's parameters in its units.
    fn plant_parameters(&self) -> Result<Vec<(String, f64)>> {
        let mut parameters = vec![];
        for set in &self.tuning.task.plant_parameters {
            for parameter in set.fit(self.rig.plant.description())?.parameters {
                let value = match parameter.value {
                    Value::Real(value, _) => value,
                    Value::Integer(value) => f64::from(value),
                    other => bail!("{} is {other}: cases of the study have numbers", parameter.name),
                };
                parameters.push((parameter.name, value));
            }
        }
        Ok(parameters)
    }
}
