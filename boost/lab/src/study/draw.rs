//! The random cases, from one Latin hypercube: a plant, and the quantities of a [`Situation`].

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use fmu_package::{FmuDescription, FmuVariable, ParameterSet, Value};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::names::{LIMP_HOME, RUNNING, SHAFT, START, TANK_START, can_start_running};
use super::situation::{Event, Experiment, STEP, Situation};
use fmu_master::scenario::Signal;
use fmu_run::latin_fractions;

/// The FMUs' files in a case's scenario.
pub const CONTROLLER: &str = "BoostController.fmu";
pub const PLANT: &str = "BoostPlant.fmu";
/// The loop is at rest after this time without changes (s).
pub const AT_REST_AFTER: f64 = 3.0;
/// Noises of different inputs have seeds that are farther apart than there are cases.
const SEEDS_APART: usize = 1_000_000;

/// The plants: parameters are drawn between the plant's values and those of each set.
const PLANTS: [&str; 10] = [
    include_str!("../../../../parameters/large_chamber.ssv"),
    include_str!("../../../../parameters/large_wastegate.ssv"),
    include_str!("../../../../parameters/narrow_valve.ssv"),
    include_str!("../../../../parameters/slow_plunger.ssv"),
    include_str!("../../../../parameters/small_wastegate.ssv"),
    include_str!("../../../../parameters/sticky_actuator.ssv"),
    include_str!("../../../../parameters/stiff_sticky_actuator.ssv"),
    include_str!("../../../../parameters/strong_spring.ssv"),
    include_str!("../../../../parameters/strong_turbine.ssv"),
    include_str!("../../../../parameters/weak_turbine.ssv"),
];

/// This repository's sets.
pub fn known_plants() -> Result<Vec<ParameterSet>> {
    Ok(PLANTS.iter().map(|text| ParameterSet::parse(text)).collect::<Result<_, _>>()?)
}

/// A plant's deviation from its own values, by variable.
struct Direction {
    set: String,
    parameters: Vec<(String, f64)>,
}

/// The random cases.
pub struct Cases {
    pub situation: Situation,
    directions: Vec<Direction>,
    /// The plant's own values of the parameters that vary, in the plant's order.
    own: Vec<(String, f64)>,
    /// For each case the positions in the ranges, from 0 to 1: the sets, then the situation's quantities.
    fractions: Vec<Vec<f64>>,
    /// Notes for readers.
    pub notes: Vec<String>,
}

/// A case: the drawn values and the resulting experiment.
#[derive(Clone, Debug)]
pub struct Case {
    /// The number of the case, from 0.
    pub number: usize,
    pub situation: Situation,
    /// Everything drawn, by column.
    pub drawn: Vec<(String, f64)>,
    pub parameters: Vec<(String, f64)>,
    pub experiment: Experiment,
}

/// What of the controller a case runs with.
#[derive(Clone, Copy, Debug)]
pub struct Variant<'a> {
    /// The controller's strategy; none for its default.
    pub strategy: Option<&'a str>,
    /// Whether findings of the controller's diagnosis have no effect.
    pub ignores_findings: bool,
    /// The files of parameter sets.
    pub sets: &'a [PathBuf],
}

impl Cases {
    /// Draws cases for a plant. Parameters that the plant lacks are ignored.
    pub fn draw(
        situation: Situation,
        plant: &FmuDescription,
        sets: &[ParameterSet],
        count: usize,
        seed: u64,
    ) -> Result<Self> {
        let mut own: Vec<(String, f64)> = vec![];
        let mut directions = vec![];
        let mut notes = vec![];
        for set in sets {
            let is_known = |name: &str| plant.variable(name).is_some_and(FmuVariable::is_settable);
            let known =
                set.parameters.iter().filter(|parameter| is_known(&parameter.name)).cloned().collect();
            let known = ParameterSet { parameters: known, ..set.clone() };
            let mut parameters = vec![];
            for parameter in
                known.fit(plant).with_context(|| format!("the parameter set '{}'", set.name))?.parameters
            {
                let Value::Real(value, _) = parameter.value else { continue };
                let start = plant.variable(&parameter.name).map_or("", |variable| &variable.start);
                let start: f64 =
                    start.parse().with_context(|| format!("{} has no start value", parameter.name))?;
                if !own.iter().any(|(name, _)| *name == parameter.name) {
                    own.push((parameter.name.clone(), start));
                }
                parameters.push((parameter.name, value - start));
            }
            if parameters.is_empty() {
                notes.push(format!(
                    "The plant has none of the parameters of the set {}, which is ignored.",
                    set.name
                ));
            } else {
                directions.push(Direction { set: set.name.clone(), parameters });
            }
        }
        if count == 0 {
            bail!("a study needs at least one case");
        }
        let mut generator = Pcg64::seed_from_u64(seed);
        let mut fractions = vec![vec![]; count];
        for _ in 0..directions.len() + situation.quantities().len() {
            for (case, fraction) in fractions.iter_mut().zip(latin_fractions(count, &mut generator)) {
                case.push(fraction);
            }
        }
        Ok(Self { situation, directions, own, fractions, notes })
    }

    pub fn len(&self) -> usize {
        self.fractions.len()
    }

    /// The drawn values, by column of the results.
    pub fn columns(&self) -> Vec<String> {
        let sets = self.directions.iter().map(|direction| direction.set.clone());
        let quantities = self.situation.quantities().iter();
        sets.chain(quantities.map(|(name, ..)| (*name).to_owned())).collect()
    }

    /// The unit of each column: parameter sets are drawn by their share, from 0 (the FMU's value) to 1.
    pub fn units(&self) -> Vec<&'static str> {
        let quantities = self.situation.quantities().iter();
        self.directions.iter().map(|_| "1").chain(quantities.map(|(_, unit, _)| *unit)).collect()
    }

    pub fn case(&self, number: usize) -> Case {
        let (weights, places) = self.fractions[number].split_at(self.directions.len());
        let mut parameters = self.own.clone();
        for (direction, weight) in self.directions.iter().zip(weights) {
            for (name, difference) in &direction.parameters {
                for (_, value) in parameters.iter_mut().filter(|(own, _)| own == name) {
                    *value += weight * difference;
                }
            }
        }
        let quantities = self.situation.quantities().iter().zip(places);
        let values: Vec<_> = quantities.map(|((.., range), place)| range.at(*place)).collect();
        let drawn = self.columns().into_iter().zip(weights.iter().copied().chain(values.iter().copied()));
        Case {
            number,
            situation: self.situation,
            drawn: drawn.collect(),
            parameters,
            experiment: self.situation.experiment(&values),
        }
    }
}

impl Case {
    /// The engine speeds at rest (rpm).
    pub fn speeds(&self) -> impl Iterator<Item = f64> {
        levels(&self.experiment.engine_speed)
    }

    /// The throttle openings.
    pub fn throttles(&self) -> impl Iterator<Item = f64> {
        levels(&self.experiment.throttle)
    }

    /// Whether engine speed is constant around a time (s).
    pub fn is_steady(&self, time: f64) -> bool {
        let moves =
            |event: &Event| !event.is_step && (event.begin..event.end + AT_REST_AFTER).contains(&time);
        !self.experiment.events.iter().any(moves)
    }

    /// Whether nothing has moved for [`AT_REST_AFTER`].
    pub fn is_at_rest(&self, time: f64) -> bool {
        let moves = |event: &Event| (event.begin..event.end + AT_REST_AFTER).contains(&time);
        time >= AT_REST_AFTER && !self.experiment.events.iter().any(moves)
    }

    /// The case as a scenario for `cargo fmu simulate`, with the inputs and records that the FMUs have: `has_input` tells
    /// whether one of them has an input.
    pub fn scenario(
        &self,
        variant: Variant<'_>,
        has_input: impl Fn(&str) -> bool,
        plant: &FmuDescription,
        recorded: &[&str],
        seed: u64,
    ) -> String {
        let Experiment { ambient: [pressure, temperature], fault, .. } = &self.experiment;
        let fault_name = fault.as_ref().map_or_else(String::new, |fault| format!(": {}", fault.kind.name()));
        let mut text = format!(
            "title = \"Case {} of the study with the seed {seed}{fault_name}\"\nstep = {STEP:?}\nstop_time = {:?}\n\
             record = {recorded:?}\n\n[[fmu]]\nname = \"controller\"\nfile = \"{CONTROLLER}\"\n",
            self.number, self.experiment.stop_time
        );
        if !variant.sets.is_empty() {
            let _ = writeln!(text, "parameters = {:?}", variant.sets);
        }
        let strategy = variant.strategy.map(|strategy| format!("strategy = \"{strategy}\""));
        let limp_home = variant.ignores_findings.then(|| format!("\"{LIMP_HOME}\" = false"));
        let values: Vec<_> = strategy.into_iter().chain(limp_home).collect();
        if !values.is_empty() {
            let _ = writeln!(text, "values = {{ {} }}", values.join(", "));
        }
        if !self.experiment.measures_shaft && has_input(SHAFT) {
            let _ = writeln!(text, "inputs = {{ {SHAFT} = 0 }}");
        }
        let _ = writeln!(text, "\n[[fmu]]\nname = \"plant\"\nfile = \"{PLANT}\"\n\n[fmu.values]");
        for (name, value) in &self.parameters {
            let _ = writeln!(text, "\"{name}\" = {value:?}");
        }
        if let Some(pressure) = self.experiment.tank_pressure.filter(|_| plant.variable(TANK_START).is_some())
        {
            let _ = writeln!(text, "\"{TANK_START}\" = {pressure:?}");
        }
        if self.experiment.starts_running && can_start_running(plant) {
            let _ = writeln!(text, "\"{START}\" = \"{RUNNING}\"");
        }
        if let Some(fault) = fault {
            text += "\n[fmu.inputs]\n";
            for (name, signal) in &fault.signals {
                let _ = writeln!(text, "\"{name}\" = {}", written(signal));
            }
        }
        text += "\n[inputs]\n";
        let inputs = [
            ("boost_reference", &self.experiment.reference),
            ("engine_speed", &self.experiment.engine_speed),
            ("supply_voltage", &self.experiment.supply),
            ("throttle", &self.experiment.throttle),
            ("ambient_pressure", &Signal::Constant(*pressure)),
            ("ambient_temperature", &Signal::Constant(*temperature)),
        ];
        for (name, signal) in inputs.into_iter().filter(|(name, _)| has_input(name)) {
            let _ = writeln!(text, "{name} = {}", written(signal));
        }
        text += "\n[noise]\n";
        for (index, (name, deviation)) in self.experiment.noise.iter().enumerate() {
            if has_input(name) {
                let seed = self.number + SEEDS_APART * index;
                let _ = writeln!(
                    text,
                    "\"controller:{name}\" = {{ standard_deviation = {deviation:?}, seed = {seed} }}"
                );
            }
        }
        text
    }
}

/// The values of a signal's points.
fn levels(signal: &Signal) -> impl Iterator<Item = f64> {
    let constant = if let Signal::Constant(value) = signal { Some(*value) } else { None };
    constant.into_iter().chain(signal.points().iter().map(|(_, value)| *value))
}

/// A signal as a scenario has it.
fn written(signal: &Signal) -> String {
    let key = match signal {
        Signal::Constant(value) => return format!("{value:?}"),
        Signal::Steps(_) => "steps",
        Signal::Lines(_) => "points",
        Signal::Sine { mean, amplitude, frequency, phase } => {
            return format!(
                "{{ sine = {{ mean = {mean:?}, amplitude = {amplitude:?}, frequency = {frequency:?}, phase = {phase:?} }} }}"
            );
        }
    };
    let points: Vec<_> =
        signal.points().iter().map(|(time, value)| format!("[{time:?}, {value:?}]")).collect();
    format!("{{ {key} = [{}] }}", points.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plant() -> FmuDescription {
        let variable = |name: &str, start: f64, unit: &str| {
            format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\">\
                 <Real start=\"{start:?}\" unit=\"{unit}\"/></ScalarVariable>"
            )
        };
        let variables = variable("hp_turbine.peak_efficiency", 0.52, "1")
            + &variable("hp_wastegate_port.area", 4e-4, "m2");
        let xml = format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"P\" guid=\"p\"><UnitDefinitions>\
             <Unit name=\"1\"><BaseUnit/></Unit><Unit name=\"m2\"><BaseUnit m=\"2\"/></Unit></UnitDefinitions><ModelVariables>{variables}\
             </ModelVariables><ModelStructure/></fmiModelDescription>"
        );
        FmuDescription::parse(&xml).unwrap()
    }

    #[test]
    fn plants_lie_between_the_default_and_the_sets() {
        let cases = Cases::draw(Situation::Ramps, &plant(), &known_plants().unwrap(), 40, 1).unwrap();
        // Two turbines and two wastegates; the other sets have no parameters of this plant.
        assert_eq!(cases.notes.len(), 6);
        let values = |index: usize| {
            let mut values: Vec<_> = (0..40).map(|number| cases.case(number).parameters[index].1).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        for (index, name, low, high) in
            [(0, "hp_wastegate_port.area", 3e-4, 5e-4), (1, "hp_turbine.peak_efficiency", 0.468, 0.572)]
        {
            assert_eq!(cases.case(0).parameters[index].0, name);
            let values = values(index);
            assert!(values[0] >= low && values[39] <= high, "{values:?}");
            assert!(values[39] - values[0] > 0.6 * (high - low), "{values:?}");
        }
    }

    #[test]
    fn equal_seeds_draw_equal_cases() {
        let drawn = |seed| {
            let cases = Cases::draw(Situation::Ramps, &plant(), &known_plants().unwrap(), 5, seed).unwrap();
            (0..5).map(|number| cases.case(number).drawn).collect::<Vec<_>>()
        };
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn a_case_is_at_rest_between_its_events() {
        let case = Cases::draw(Situation::Ramps, &plant(), &[], 1, 3).unwrap().case(0);
        let [step, ramp, second, _] = case.experiment.events.as_slice() else { panic!("{case:?}") };
        assert!(case.is_at_rest(step.begin - STEP) && !case.is_at_rest(step.begin));
        assert!(case.is_at_rest(ramp.begin - STEP) && !case.is_at_rest(ramp.end));
        assert!(case.is_at_rest(second.begin - STEP) && case.is_at_rest(case.experiment.stop_time));
    }
}
