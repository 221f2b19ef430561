//! A case in closed loop, compared with the reachable reference.
//!
//! The reachable reference is a band. Its edges are the reference itself, limited to what the plant can hold at rest
//! ([`Reach`]). After each reference step and from the start of each ramp, no control has to be better than one that
//! knows the plant, which is tried on the plant itself, from its state at that moment ([`OpenLoop::fastest`]). Between
//! two references the pressure may be anywhere between them, until [`ALLOWANCE`] after that control has arrived.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use super::draw::{CONTROLLER, Case, Event, PLANT, SETTLING, STEP};
use super::names::{ALARM, BOOST, FLOWS, SHAFT, has, recorded};
use super::reach::{DOWN, Measured, OpenLoop, Reach, SHAFT_LIMIT, TURNING_STEPS, UP, VALVES};
use fmu_master::Fmu;
use fmu_master::measure::{greatest, least};
use fmu_master::scenario::{Scenario, Signal};
use fmu_master::{LoadedFmus, Master};
use fmu_record::Record;
use fmu_terms::Causality;

/// The time allowed after the fastest plant's arrival (s): three times the controller's `reference_lambda`, the desired
/// time constant.
const ALLOWANCE: f64 = 1.5;
/// The longest cycle (in steps) of bang-bang control: the actuator's travel both ways.
const CYCLE: usize = 2 * TURNING_STEPS;
/// The distance from the reachable reference at which the fastest plant counts as arrived (Pa).
const ARRIVES_WITHIN: f64 = 100.0;
/// Overshoot counts for this time after a step (s), or until the next event.
const OVERSHOOT_WITHIN: f64 = 3.0;

/// The FMUs of a study.
pub struct Rig {
    fmus: LoadedFmus,
    pub plant: Arc<Fmu>,
    pub controller: Arc<Fmu>,
    pub seed: u64,
    /// The files of the controller's parameter sets.
    pub controller_sets: Vec<PathBuf>,
    /// Whether the plant can be tried from a saved state.
    pub saves_states: bool,
}

/// A closed loop and its band.
pub struct Simulated {
    pub record: Record,
    /// The edges of the reachable reference at each row (Pa).
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// Communication points at which something starts.
    pub events: Vec<usize>,
}

/// A case's measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// The largest deviation from the reachable reference after settling (Pa).
    pub deviation: f64,
    /// Its time (s).
    pub deviation_time: f64,
    /// Whether boost is too high then.
    pub is_above: bool,
    /// The largest overshoot over reference steps (Pa).
    pub overshoot: f64,
    /// The high-pressure shaft's maximum speed at rest, and otherwise (rpm).
    pub shaft_at_rest: Option<f64>,
    pub shaft_in_transients: Option<f64>,
    /// The minimum flow of a compressor (kg/s).
    pub least_flow: Option<f64>,
    /// The largest `fault_code`.
    pub alarm: Option<f64>,
}

/// The plant's response to a control that knows it, from some moment.
struct Fastest {
    event: Event,
    first: usize,
    /// Boost pressure after each step from `first`, towards the reference from below and from above.
    up: Vec<f64>,
    down: Vec<f64>,
}

/// The communication point of a time.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
pub fn point(time: f64) -> usize {
    (time / STEP).round() as usize
}

impl Rig {
    pub fn new(plant: Arc<Fmu>, controller: Arc<Fmu>, seed: u64) -> Result<Self> {
        for (fmu, kind, name) in [
            (&plant, Causality::Input, "hp_wastegate_pwm"),
            (&plant, Causality::Input, "engine_speed"),
            (&plant, Causality::Output, BOOST),
            (&controller, Causality::Input, "boost_reference"),
            (&controller, Causality::Input, BOOST),
        ] {
            let model = fmu.description().attribute("modelName");
            anyhow::ensure!(has(fmu, kind, name), "{model} has no {kind} {name}");
        }
        let mut fmus = LoadedFmus::default();
        for (file, fmu) in [(PLANT, &plant), (CONTROLLER, &controller)] {
            fmus.insert(file.into(), Arc::clone(fmu));
        }
        Ok(Self {
            saves_states: plant.has_capability("canGetAndSetFMUstate"),
            plant,
            controller,
            controller_sets: vec![],
            fmus,
            seed,
        })
    }

    /// A case as the text of a scenario.
    pub fn text(&self, case: &Case, strategy: Option<&str>) -> String {
        let fmus = [&*self.plant, &*self.controller];
        let has_input = |name: &str| fmus.iter().any(|fmu| has(fmu, Causality::Input, name));
        case.scenario(strategy, &self.controller_sets, has_input, &recorded(fmus), self.seed)
    }

    /// A case as a scenario; its FMUs are the controller and the plant.
    pub fn scenario(&self, case: &Case, strategy: Option<&str>) -> Result<Scenario> {
        let none = Path::new("");
        let name = format!("case {}", case.number);
        Scenario::parse(&name, &self.text(case, strategy), none, none)
    }

    /// The closed loop from the start to a communication point.
    pub fn run_to<'a>(&self, scenario: &'a Scenario, end: usize) -> Result<Master<'a>> {
        let mut master = Master::new(scenario, &mut self.fmus.clone())?;
        master.initialize()?;
        for _ in 0..end {
            master.step()?;
        }
        Ok(master)
    }

    /// Runs a case, with a strategy of the controller.
    pub fn simulate(&self, case: &Case, reach: &Reach, strategy: Option<&str>) -> Result<Simulated> {
        let scenario = self.scenario(case, strategy)?;
        let mut events = case.events.clone();
        events.sort_by(|a, b| a.begin.total_cmp(&b.begin));
        let begins: Vec<_> = events.iter().map(|event| point(event.begin)).collect();
        let steps = scenario.steps as usize;
        let mut fastest: Vec<Fastest> = vec![];
        let mut master = self.run_to(&scenario, 0)?;
        for index in 0..steps {
            // A short ramp and the reference step within it may start together.
            for (event, _) in events.iter().zip(&begins).filter(|&(_, &begin)| begin == index) {
                let last = begins.iter().copied().find(|&begin| begin > index).unwrap_or(steps);
                fastest.push(self.fastest(case, reach, *event, &mut master, (index, last))?);
            }
            master.step()?;
        }
        let (lower, upper) = band(case, reach, &fastest, steps);
        Ok(Simulated { record: master.record().clone(), lower, upper, events: begins })
    }

    fn fastest(
        &self,
        case: &Case,
        reach: &Reach,
        event: Event,
        master: &mut Master<'_>,
        (first, last): (usize, usize),
    ) -> Result<Fastest> {
        let mut fastest = Fastest { event, first, up: vec![], down: vec![] };
        if !self.saves_states {
            return Ok(fastest);
        }
        let time = |row: usize| row as f64 * STEP;
        let reference = |row: usize| case.reference.at(time(row));
        let speed = |row: usize| case.engine_speed.at(time(row));
        let moves =
            |row: usize| case.events.iter().any(|event| event.begin < time(row) && time(row) < event.end);
        let mut plant = OpenLoop::new(master.instance("plant")?, case)?;
        let shaft_limit = plant.measured()?.shaft.max(SHAFT_LIMIT);
        fastest.up = plant.fastest(
            UP,
            (first, last),
            |row, now: Measured| now.boost <= reference(row) && now.shaft <= shaft_limit,
            |row, boost| {
                !moves(row) && boost >= reference(row).min(reach.highest(speed(row))) - ARRIVES_WITHIN
            },
        )?;
        fastest.down = plant.fastest(
            DOWN,
            (first, last),
            |row, now: Measured| now.boost >= reference(row),
            |row, boost| {
                !moves(row) && boost <= reference(row).max(reach.lowest(speed(row))) + ARRIVES_WITHIN
            },
        )?;
        for pressures in [&mut fastest.up, &mut fastest.down] {
            smooth(pressures, |index| reference(first + 1 + index));
        }
        Ok(fastest)
    }
}

/// Bang-bang control oscillates around the reference: between two crossings at most a cycle apart, one with finer steps
/// would stay on it.
fn smooth(pressures: &mut [f64], reference: impl Fn(usize) -> f64) {
    let mut last = None;
    for index in 0..pressures.len() {
        if (pressures[index] - reference(index)).abs() > ARRIVES_WITHIN {
            continue;
        }
        if let Some(last) = last.filter(|last| index - last <= CYCLE) {
            (last..index).for_each(|between| pressures[between] = reference(between));
        }
        last = Some(index);
    }
}

/// The edges of the reachable reference at each row.
fn band(case: &Case, reach: &Reach, fastest: &[Fastest], steps: usize) -> (Vec<f64>, Vec<f64>) {
    let row = |row: usize| {
        let time = row as f64 * STEP;
        let speed = case.engine_speed.at(time);
        let edges_at = |speed: f64, reference: f64| {
            (reference.min(reach.highest(speed)), reference.max(reach.lowest(speed)))
        };
        let edges = |reference: f64| edges_at(speed, reference);
        // What starts at a row acts from the next one.
        let (mut lower, mut upper) = edges(case.reference.at(time - 0.5 * STEP));
        let Some(Fastest { event, first, up, down }) = fastest.iter().rfind(|fastest| fastest.first < row)
        else {
            return (lower, upper);
        };
        if event.is_step {
            let before = case.reference.at(event.begin - 0.5 * STEP);
            let row_of = |index: usize| first + 1 + index;
            let goals = |index: usize| {
                let time = row_of(index) as f64 * STEP;
                edges_at(case.engine_speed.at(time), case.reference.at(time - 0.5 * STEP))
            };
            let is_up = case.reference.at(event.begin) > before;
            let arrived = |(index, boost): (usize, &f64)| {
                let (lower, upper) = goals(index);
                if is_up { *boost >= lower - ARRIVES_WITHIN } else { *boost <= upper + ARRIVES_WITHIN }
            };
            let fastest = if is_up { up } else { down };
            let arrival = fastest.iter().enumerate().position(arrived).map_or(first + fastest.len(), row_of);
            if row <= arrival + point(ALLOWANCE) {
                let (old_lower, old_upper) = edges(before);
                (lower, upper) = (lower.min(old_lower), upper.max(old_upper));
            }
        }
        let at = |pressures: &[f64]| pressures.get(row - first - 1).copied();
        (lower.min(at(up).unwrap_or(f64::INFINITY)), upper.max(at(down).unwrap_or(f64::NEG_INFINITY)))
    };
    (0..=steps).map(row).unzip()
}

impl Simulated {
    /// The deviation from the band at a row (Pa), and whether it is above.
    pub fn distance(&self, row: usize, pressure: f64) -> (f64, bool) {
        let (below, above) = (self.lower[row] - pressure, pressure - self.upper[row]);
        // NaN stays NaN.
        if below > above {
            (if below < 0.0 { 0.0 } else { below }, false)
        } else {
            (if above < 0.0 { 0.0 } else { above }, true)
        }
    }

    pub fn boost(&self) -> Result<&[f64]> {
        self.record.get(BOOST)
    }

    /// The valve commands in effect during a communication step.
    pub fn valves(&self, index: usize) -> [f64; 3] {
        VALVES.map(|(name, _)| self.record.get(name).map_or(0.0, |values| values[index + 1]))
    }

    pub fn measures(&self, case: &Case) -> Result<Measures> {
        let boost = self.boost()?;
        anyhow::ensure!(boost.iter().all(|value| value.is_finite()), "boost_pressure is not finite");
        let times = self.record.time();
        let judged = (point(SETTLING)..boost.len()).map(|row| (row, self.distance(row, boost[row])));
        let worst = judged.max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0)).context("the case is empty")?;
        let (row, (deviation, is_above)) = worst;
        let of = |name: &str, is_meant: &dyn Fn(f64) -> bool| {
            let values = self.record.get(name).ok()?.iter().zip(times);
            Some(values.filter(|(_, time)| is_meant(**time)).map(|(value, _)| *value).collect::<Vec<_>>())
        };
        let flows: Vec<_> = FLOWS.iter().filter_map(|name| of(name, &|_| true)).flatten().collect();
        Ok(Measures {
            deviation,
            deviation_time: times[row],
            is_above,
            overshoot: self.overshoot(case, boost),
            shaft_at_rest: of(SHAFT, &|time| case.is_at_rest(time)).map(greatest),
            shaft_in_transients: of(SHAFT, &|time| !case.is_at_rest(time)).map(greatest),
            least_flow: (!flows.is_empty()).then(|| least(flows)),
            alarm: of(ALARM, &|_| true).map(greatest),
        })
    }

    /// The largest overshoot over the new reference, or its reachable part, in the direction of the step.
    fn overshoot(&self, case: &Case, boost: &[f64]) -> f64 {
        let Signal::Steps(steps) = &case.reference else { return 0.0 };
        let overshoot = steps.windows(2).map(|pair| {
            let ((_, before), (begin, after)) = (pair[0], pair[1]);
            let first = point(begin);
            let next = self.events.iter().find(|&&event| event > first).copied().unwrap_or(boost.len());
            let rows = first..next.min(first + point(OVERSHOOT_WITHIN)).min(boost.len());
            greatest(rows.map(|row| {
                if after > before {
                    boost[row] - self.upper[row].max(after)
                } else {
                    self.lower[row].min(after) - boost[row]
                }
            }))
        });
        greatest(overshoot).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_moments_within_a_cycle_a_control_stays_on_its_reference() {
        let mut pressures = vec![9e3; 3];
        pressures.extend([10_050.0, 9e3, 8e3, 9_950.0]);
        pressures.extend(vec![9e3; CYCLE]);
        pressures.push(10e3);
        let mut expected = pressures.clone();
        expected[3..6].fill(10e3);
        smooth(&mut pressures, |_| 10e3);
        assert_eq!(pressures, expected);
    }
}
