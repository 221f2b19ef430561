//! The random cases, from one Latin hypercube: a plant, ambient conditions, and a manoeuvre of engine speed, boost
//! reference and supply voltage.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use fmu_package::{FmuDescription, FmuVariable, ParameterSet, Value};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use cargo_fmu::run::{Range, latin_fractions};
use fmu_master::scenario::Signal;

/// The FMUs' files in a case's scenario.
pub const CONTROLLER: &str = "BoostController.fmu";
pub const PLANT: &str = "BoostPlant.fmu";
/// The communication step (s): the controller's sample time.
pub const STEP: f64 = 0.0125;
/// Time from the start to the first reference step (s), when judging starts: a plant that differs from the controller's
/// maps starts off its reference.
pub const SETTLING: f64 = 5.0;
/// Time between changes of reference or engine speed (s).
const HOLD: f64 = 5.0;
/// Time from the end of the last ramp to the end (s).
const END: f64 = 6.0;
/// The loop is at rest after this time without changes (s).
pub const AT_REST_AFTER: f64 = 3.0;

type Quantity = (&'static str, &'static str, Range);

const fn range(name: &'static str, unit: &'static str, from: f64, to: f64) -> Quantity {
    (name, unit, Range { from, to, is_logarithmic: false })
}

const fn logarithmic(name: &'static str, unit: &'static str, from: f64, to: f64) -> Quantity {
    (name, unit, Range { from, to, is_logarithmic: true })
}

/// All random quantities except plant parameters: name in the results' columns, unit and range.
const RANGES: [Quantity; 13] = [
    // 0 to 3000 m of altitude.
    range("ambient_pressure", "Pa", 70e3, 101_325.0),
    // -20 to 40 degrees Celsius.
    range("ambient_temperature", "K", 253.15, 313.15),
    // The extremes of the paper's Fig. 14.
    range("supply_voltage_1", "V", 11.1, 13.5),
    range("supply_voltage_2", "V", 11.1, 13.5),
    range("noise", "Pa", 0.0, 100.0),
    range("engine_speed_1", "rpm", 2000.0, 5500.0),
    range("engine_speed_2", "rpm", 2000.0, 5500.0),
    range("engine_speed_3", "rpm", 2000.0, 5500.0),
    logarithmic("ramp_rate_1", "rpm/s", 250.0, 2000.0),
    logarithmic("ramp_rate_2", "rpm/s", 250.0, 2000.0),
    range("boost_reference_1", "Pa", 115e3, 215e3),
    // The largest step of the paper's Fig. 13.
    range("reference_step_1", "Pa", -20e3, 20e3),
    range("reference_step_2", "Pa", -20e3, 20e3),
];

/// The range of references, to which steps are limited (Pa).
const REFERENCES: (f64, f64) = (115e3, 215e3);

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
    directions: Vec<Direction>,
    /// The plant's own values of the parameters that vary, in the plant's order.
    own: Vec<(String, f64)>,
    /// For each case the positions in the ranges, from 0 to 1: the sets, then [`RANGES`].
    fractions: Vec<Vec<f64>>,
    /// Notes for readers.
    pub notes: Vec<String>,
}

/// A case: the drawn values and the resulting experiment.
#[derive(Clone, Debug)]
pub struct Case {
    /// From 0.
    pub number: usize,
    /// Everything drawn, by column.
    pub drawn: Vec<(String, f64)>,
    pub parameters: Vec<(String, f64)>,
    pub ambient: [f64; 2],
    pub supply: Signal,
    pub noise: f64,
    pub engine_speed: Signal,
    pub reference: Signal,
    /// When reference or engine speed start to change (s).
    pub events: Vec<Event>,
    pub stop_time: f64,
}

/// A change of the reference or of engine speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub begin: f64,
    /// The end of a ramp; for a step, its start.
    pub end: f64,
    pub is_step: bool,
}

impl Cases {
    /// Draws cases for a plant. Parameters that the plant lacks are ignored.
    pub fn draw(plant: &FmuDescription, sets: &[ParameterSet], count: usize, seed: u64) -> Result<Self> {
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
        for _ in 0..directions.len() + RANGES.len() {
            for (case, fraction) in fractions.iter_mut().zip(latin_fractions(count, &mut generator)) {
                case.push(fraction);
            }
        }
        Ok(Self { directions, own, fractions, notes })
    }

    pub fn len(&self) -> usize {
        self.fractions.len()
    }

    /// The drawn values, by column of the results.
    pub fn columns(&self) -> Vec<String> {
        let sets = self.directions.iter().map(|direction| direction.set.clone());
        sets.chain(RANGES.iter().map(|(name, ..)| (*name).to_owned())).collect()
    }

    /// The unit of each column: parameter sets are drawn by their share, from 0 (the FMU's value) to 1.
    pub fn units(&self) -> Vec<&'static str> {
        self.directions.iter().map(|_| "1").chain(RANGES.iter().map(|(_, unit, _)| *unit)).collect()
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
        let values: Vec<_> = RANGES.iter().zip(places).map(|((.., range), place)| range.at(*place)).collect();
        let drawn = self.columns().into_iter().zip(weights.iter().copied().chain(values.iter().copied()));
        let [pressure, temperature, supply_1, supply_2, noise, speeds @ .., first, step_1, step_2] =
            values.as_slice()
        else {
            unreachable!("RANGES has more quantities than these")
        };
        let limited = |reference: f64| reference.clamp(REFERENCES.0, REFERENCES.1);
        let references = [*first, limited(first + step_1), limited(limited(first + step_1) + step_2)];
        let duration =
            |ramp: usize| whole((speeds[ramp + 1] - speeds[ramp]).abs() / speeds[3 + ramp]).max(STEP);
        let ramp_1 = SETTLING + HOLD;
        let ramp_1_end = ramp_1 + duration(0);
        let ramp_2 = ramp_1_end + HOLD;
        let ramp_2_end = ramp_2 + duration(1);
        let second_step = whole(0.5 * (ramp_2 + ramp_2_end));
        let ramp = |begin, end| Event { begin, end, is_step: false };
        let step = |begin| Event { begin, end: begin, is_step: true };
        Case {
            number,
            drawn: drawn.collect(),
            parameters,
            ambient: [*pressure, *temperature],
            supply: Signal::Steps(vec![(0.0, *supply_1), (whole(ramp_1_end + 0.5 * HOLD), *supply_2)]),
            noise: *noise,
            engine_speed: Signal::Lines(vec![
                (ramp_1, speeds[0]),
                (ramp_1_end, speeds[1]),
                (ramp_2, speeds[1]),
                (ramp_2_end, speeds[2]),
            ]),
            reference: Signal::Steps(vec![
                (0.0, references[0]),
                (SETTLING, references[1]),
                (second_step, references[2]),
            ]),
            events: vec![
                step(SETTLING),
                ramp(ramp_1, ramp_1_end),
                ramp(ramp_2, ramp_2_end),
                step(second_step),
            ],
            stop_time: whole(ramp_2_end + END),
        }
    }
}

/// A multiple of the communication step.
fn whole(time: f64) -> f64 {
    (time / STEP).round() * STEP
}

impl Case {
    /// The engine speeds at rest (rpm).
    pub fn speeds(&self) -> impl Iterator<Item = f64> {
        self.engine_speed.points().iter().map(|(_, speed)| *speed)
    }

    /// Whether nothing has moved for [`AT_REST_AFTER`].
    pub fn is_at_rest(&self, time: f64) -> bool {
        let moves = |event: &Event| (event.begin..event.end + AT_REST_AFTER).contains(&time);
        time >= AT_REST_AFTER && !self.events.iter().any(moves)
    }

    /// The case as a scenario for `cargo fmu simulate`, with the inputs and records that the FMUs have.
    pub fn scenario(
        &self,
        strategy: Option<&str>,
        controller_sets: &[PathBuf],
        has_input: impl Fn(&str) -> bool,
        recorded: &[&str],
        seed: u64,
    ) -> String {
        let mut text = format!(
            "title = \"Case {} of the study with the seed {seed}\"\nstep = {STEP:?}\nstop_time = {:?}\nrecord = {recorded:?}\n\n\
             [[fmu]]\nname = \"controller\"\nfile = \"{CONTROLLER}\"\n",
            self.number, self.stop_time
        );
        if !controller_sets.is_empty() {
            let _ = writeln!(text, "parameters = {controller_sets:?}");
        }
        if let Some(strategy) = strategy {
            let _ = writeln!(text, "values = {{ strategy = \"{strategy}\" }}");
        }
        let _ = writeln!(text, "\n[[fmu]]\nname = \"plant\"\nfile = \"{PLANT}\"\n\n[fmu.values]");
        for (name, value) in &self.parameters {
            let _ = writeln!(text, "\"{name}\" = {value:?}");
        }
        text += "\n[inputs]\n";
        let pairs = |points: &[(f64, f64)]| {
            let pairs: Vec<_> = points.iter().map(|(time, value)| format!("[{time:?}, {value:?}]")).collect();
            pairs.join(", ")
        };
        let inputs = [
            ("boost_reference", format!("{{ steps = [{}] }}", pairs(self.reference.points()))),
            ("engine_speed", format!("{{ points = [{}] }}", pairs(self.engine_speed.points()))),
            ("supply_voltage", format!("{{ steps = [{}] }}", pairs(self.supply.points()))),
            ("ambient_pressure", format!("{:?}", self.ambient[0])),
            ("ambient_temperature", format!("{:?}", self.ambient[1])),
        ];
        for (name, signal) in inputs.into_iter().filter(|(name, _)| has_input(name)) {
            let _ = writeln!(text, "{name} = {signal}");
        }
        let _ = writeln!(
            text,
            "\n[noise]\nboost_pressure = {{ standard_deviation = {:?}, seed = {} }}",
            self.noise, self.number
        );
        text
    }
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
        let cases = Cases::draw(&plant(), &known_plants().unwrap(), 40, 1).unwrap();
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
            let cases = Cases::draw(&plant(), &known_plants().unwrap(), 5, seed).unwrap();
            (0..5).map(|number| cases.case(number).drawn).collect::<Vec<_>>()
        };
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn a_case_is_at_rest_between_its_events() {
        let case = Cases::draw(&plant(), &[], 1, 3).unwrap().case(0);
        let [step, ramp, second, _] = case.events.as_slice() else { panic!("{:?}", case.events) };
        assert!(case.is_at_rest(step.begin - STEP) && !case.is_at_rest(step.begin));
        assert!(case.is_at_rest(ramp.begin - STEP) && !case.is_at_rest(ramp.end));
        assert!(case.is_at_rest(second.begin - STEP) && case.is_at_rest(case.stop_time));
    }
}
