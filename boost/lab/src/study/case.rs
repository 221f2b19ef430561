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

use super::draw::{CONTROLLER, Case, PLANT, Variant};
use super::fault::{self, FaultKind};
use super::names::{ALARM, BOOST, DUTY, FLOWS, LIMP_HOME, PUMP, SHAFT, TANK, TRUE_BOOST, has, recorded};
use super::reach::{DOWN, Measured, OpenLoop, Reach, SHAFT_LIMIT, TURNING_STEPS, UP, VALVES};
use super::situation::{Event, Experiment, SETTLING, STEP, Situation};
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
/// The share of a step after which boost has risen.
const RISEN: f64 = 0.95;
/// The tank's pressure (Pa) above which its vacuum does not open the wastegate: the controller's
/// `diagnosis.vacuum_lost_above`.
const NO_VACUUM: f64 = 50e3;

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
    /// The reference at each row as far as the plant can hold it (Pa).
    pub attainable: Vec<f64>,
    /// Communication points at which something starts.
    pub events: Vec<usize>,
}

/// A case's measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// The largest deviation from the reachable reference after settling (Pa).
    pub deviation: f64,
    /// The time of the largest deviation (s).
    pub deviation_time: f64,
    /// Whether boost is too high at the largest deviation.
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
    /// How far boost moves back on its way to a new reference (Pa).
    pub dip: f64,
    /// The time (s) from a reference step up until boost has risen by 95 % of what the plant can hold of it.
    pub rise: Option<f64>,
    /// The vacuum tank's highest pressure from [`SETTLING`] on (Pa), the share of the time with the pump on, and the way of
    /// the duty (%/s).
    pub tank: Option<f64>,
    pub pump: Option<f64>,
    pub duty_travel: Option<f64>,
    pub unaided: Option<Unaided>,
    pub faulty: Option<Faulty>,
}

/// The loop while the vacuum tank cannot open the wastegate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unaided {
    pub engine_speed: f64,
    /// The highest boost pressure (Pa), and shaft speed (rpm).
    pub boost: f64,
    pub shaft: Option<f64>,
}

/// The loop with a fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Faulty {
    pub kind: FaultKind,
    /// With limp-home, and without, if the controller can do without.
    pub with: Extremes,
    pub without: Option<Extremes>,
    /// The time from the fault to the first code (s), and the largest excess of boost before it (Pa).
    pub code_after: Option<f64>,
    pub excess_before_code: f64,
}

/// How far a loop with a fault goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// The largest excess of boost over the reference, and the largest deficit (Pa).
    pub excess: f64,
    pub deficit: f64,
    pub shaft: Option<f64>,
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

    /// A controller's strategy with limp-home.
    pub fn variant<'a>(&'a self, strategy: Option<&'a str>) -> Variant<'a> {
        Variant { strategy, ignores_findings: false, sets: &self.controller_sets }
    }

    /// A case as the text of a scenario.
    pub fn text(&self, case: &Case, variant: Variant<'_>) -> String {
        let fmus = [&*self.plant, &*self.controller];
        let has_input = |name: &str| fmus.iter().any(|fmu| has(fmu, Causality::Input, name));
        case.scenario(variant, has_input, self.plant.description(), &recorded(fmus), self.seed)
    }

    /// A case as a scenario; its FMUs are the controller and the plant.
    pub fn scenario(&self, case: &Case, variant: Variant<'_>) -> Result<Scenario> {
        let none = Path::new("");
        let name = format!("case {}", case.number);
        Scenario::parse(&name, &self.text(case, variant), none, none)
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

    /// Runs a case and measures it; with a fault, beside the same loop whose findings have no effect.
    pub fn measure(&self, case: &Case, reach: &Reach, variant: Variant<'_>) -> Result<Measures> {
        let mut measures = self.simulate(case, reach, variant)?.measures(case)?;
        let has_limp_home = self.controller.description().variable(LIMP_HOME).is_some();
        if let Some(faulty) = measures.faulty.as_mut().filter(|_| has_limp_home) {
            let without = self.simulate(case, reach, Variant { ignores_findings: true, ..variant })?;
            faulty.without = Some(without.extremes(case)?);
        }
        Ok(measures)
    }

    /// Runs a case.
    pub fn simulate(&self, case: &Case, reach: &Reach, variant: Variant<'_>) -> Result<Simulated> {
        let scenario = self.scenario(case, variant)?;
        let mut events = case.experiment.events.clone();
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
        let (lower, upper) = if case.situation.is_benchmarked() {
            band(case, reach, &fastest, steps)
        } else {
            band_above(case, reach, steps)
        };
        let attainable = (0..=steps).map(|row| {
            let time = (row as f64 - 0.5) * STEP;
            let [speed, throttle] =
                [&case.experiment.engine_speed, &case.experiment.throttle].map(|signal| signal.at(time));
            let (lowest, highest) = (reach.lowest(speed, throttle), reach.highest(speed, throttle));
            case.experiment.reference.at(time).max(lowest).min(highest)
        });
        let attainable = attainable.collect();
        Ok(Simulated { record: master.record().clone(), lower, upper, attainable, events: begins })
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
        let reference = |row: usize| case.experiment.reference.at(time(row));
        let speed = |row: usize| case.experiment.engine_speed.at(time(row));
        let throttle = |row: usize| case.experiment.throttle.at(time(row));
        let moves = |row: usize| {
            case.experiment.events.iter().any(|event| event.begin < time(row) && time(row) < event.end)
        };
        let mut plant = OpenLoop::new(master.instance("plant")?, case)?;
        let shaft_limit = plant.measured()?.shaft.max(SHAFT_LIMIT);
        fastest.up = plant.fastest(
            UP,
            (first, last),
            |row, now: Measured| now.boost <= reference(row) && now.shaft <= shaft_limit,
            |row, boost| {
                !moves(row)
                    && boost >= reference(row).min(reach.highest(speed(row), throttle(row))) - ARRIVES_WITHIN
            },
        )?;
        fastest.down = plant.fastest(
            DOWN,
            (first, last),
            |row, now: Measured| now.boost >= reference(row),
            |row, boost| {
                !moves(row)
                    && boost <= reference(row).max(reach.lowest(speed(row), throttle(row))) + ARRIVES_WITHIN
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
    let Experiment { engine_speed, throttle, reference, .. } = &case.experiment;
    // What starts at a row acts from the next one.
    let before = |time: f64| time - 0.5 * STEP;
    let edges_at = |time: f64, reference: f64| {
        let (speed, throttle) = (engine_speed.at(time), throttle.at(before(time)));
        (reference.min(reach.highest(speed, throttle)), reference.max(reach.lowest(speed, throttle)))
    };
    let row = |row: usize| {
        let time = row as f64 * STEP;
        let edges = |reference: f64| edges_at(time, reference);
        let (mut lower, mut upper) = edges(reference.at(before(time)));
        let Some(Fastest { event, first, up, down }) = fastest.iter().rfind(|fastest| fastest.first < row)
        else {
            return (lower, upper);
        };
        if event.is_step {
            let old = reference.at(before(event.begin));
            let row_of = |index: usize| first + 1 + index;
            let goals = |index: usize| {
                let time = row_of(index) as f64 * STEP;
                edges_at(time, reference.at(before(time)))
            };
            let is_up = reference.at(event.begin) > old;
            let arrived = |(index, boost): (usize, &f64)| {
                let (lower, upper) = goals(index);
                if is_up { *boost >= lower - ARRIVES_WITHIN } else { *boost <= upper + ARRIVES_WITHIN }
            };
            let fastest = if is_up { up } else { down };
            let arrival = fastest.iter().enumerate().position(arrived).map_or(first + fastest.len(), row_of);
            if row <= arrival + point(ALLOWANCE) {
                let (mut old_lower, old_upper) = edges(old);
                // As a throttle opens, boost falls first: the old reference belongs to the engine before.
                if throttle.at(event.begin).to_bits() != throttle.at(before(event.begin)).to_bits() {
                    old_lower = f64::NEG_INFINITY;
                }
                (lower, upper) = (lower.min(old_lower), upper.max(old_upper));
            }
        }
        let at = |pressures: &[f64]| pressures.get(row - first - 1).copied();
        (lower.min(at(up).unwrap_or(f64::INFINITY)), upper.max(at(down).unwrap_or(f64::NEG_INFINITY)))
    };
    (0..=steps).map(row).unzip()
}

/// The edges where boost is judged only where it is too high: above the reference, and the one before until
/// [`ALLOWANCE`] after it, as far as the plant can go down to it.
fn band_above(case: &Case, reach: &Reach, steps: usize) -> (Vec<f64>, Vec<f64>) {
    let Experiment { engine_speed, throttle, reference, .. } = &case.experiment;
    let upper = (0..=steps).map(|row| {
        let time = row as f64 * STEP;
        let wanted = reference.at(time).max(reference.at(time - ALLOWANCE));
        wanted.max(reach.lowest(engine_speed.at(time), throttle.at(time)))
    });
    (vec![f64::NEG_INFINITY; steps + 1], upper.collect())
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
        self.record.get(TRUE_BOOST).or_else(|_| self.record.get(BOOST))
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
            dip: self.dip(case, boost),
            rise: self.rise(case, boost),
            tank: of(TANK, &|time| time >= SETTLING).map(greatest),
            pump: of(PUMP, &|time| time >= SETTLING).map(|on| mean(on.iter().copied())),
            duty_travel: of(DUTY, &|time| time >= SETTLING)
                .map(|duties| mean(duties.windows(2).map(|pair| (pair[1] - pair[0]).abs())) / STEP),
            unaided: (case.situation == Situation::EmptyTank).then(|| self.unaided(case, boost)).flatten(),
            faulty: self.faulty(case, boost)?,
        })
    }

    /// The reference steps: when, from which reference, to which, and until which row boost is on its way.
    fn reference_steps(&self, case: &Case, rows: usize) -> Vec<(usize, f64, f64, usize)> {
        let Signal::Steps(steps) = &case.experiment.reference else { return vec![] };
        let steps = steps.windows(2).map(|pair| {
            let ((_, before), (begin, after)) = (pair[0], pair[1]);
            let first = point(begin);
            let next = self.events.iter().find(|&&event| event > first).copied().unwrap_or(rows);
            (first, before, after, next.min(rows))
        });
        steps.collect()
    }

    /// The largest movement back on the way to a new reference, or to what of it the plant can hold. While engine speed
    /// moves, boost may have to go back.
    fn dip(&self, case: &Case, boost: &[f64]) -> f64 {
        let steps = self.reference_steps(case, boost.len()).into_iter();
        let is_constant = |first: &usize| case.is_steady(*first as f64 * STEP);
        let dips = steps.filter(|(first, ..)| is_constant(first)).map(|(first, before, after, next)| {
            let sign = (after - before).signum();
            let mut most = f64::NEG_INFINITY;
            greatest((first + 1..next).map(|row| {
                most = most.max(sign * boost[row]);
                most.min(sign * self.attainable[row]) - sign * boost[row]
            }))
        });
        greatest(dips).max(0.0)
    }

    /// The longest time in which boost rises.
    fn rise(&self, case: &Case, boost: &[f64]) -> Option<f64> {
        let steps = self.reference_steps(case, boost.len()).into_iter();
        let steps =
            steps.filter(|&(first, before, after, _)| after > before && case.is_steady(first as f64 * STEP));
        let rises = steps.filter_map(|(first, _, _, next)| {
            let goal = boost[first] + RISEN * (self.attainable[next - 1] - boost[first]);
            (first..next).find(|&row| boost[row] >= goal).map(|row| (row - first) as f64 * STEP)
        });
        rises.max_by(f64::total_cmp)
    }

    /// The loop until the tank has a vacuum.
    fn unaided(&self, case: &Case, boost: &[f64]) -> Option<Unaided> {
        let tank = self.record.get(TANK).ok()?;
        let has_vacuum = tank.iter().position(|pressure| *pressure < NO_VACUUM).unwrap_or(tank.len());
        let most = |values: &[f64]| greatest(values[..has_vacuum].iter().copied());
        Some(Unaided {
            engine_speed: case.speeds().next()?,
            boost: most(boost),
            shaft: self.record.get(SHAFT).ok().map(most),
        })
    }

    /// How far the loop goes from the fault on.
    fn extremes(&self, case: &Case) -> Result<Extremes> {
        let boost = self.boost()?;
        let rows = point(fault::BEGIN)..boost.len();
        let wanted = |row: usize| {
            let time = row as f64 * STEP;
            let reference = &case.experiment.reference;
            reference.at(time).min(reference.at(time - ALLOWANCE)).min(self.attainable[row])
        };
        let shaft = self.record.get(SHAFT).ok();
        Ok(Extremes {
            excess: greatest(rows.clone().map(|row| boost[row] - self.upper[row])),
            deficit: greatest(rows.clone().map(|row| wanted(row) - boost[row])),
            shaft: shaft.map(|speeds| greatest(speeds[rows].iter().copied())),
        })
    }

    fn faulty(&self, case: &Case, boost: &[f64]) -> Result<Option<Faulty>> {
        let Some(fault) = &case.experiment.fault else { return Ok(None) };
        let begin = point(fault::BEGIN);
        let codes = self.record.get(ALARM).ok();
        let found = codes.and_then(|codes| (begin..codes.len()).find(|&row| codes[row] != 0.0));
        let before = begin..found.unwrap_or(boost.len());
        Ok(Some(Faulty {
            kind: fault.kind,
            with: self.extremes(case)?,
            without: None,
            code_after: found.map(|row| (row - begin) as f64 * STEP),
            excess_before_code: greatest(before.map(|row| boost[row] - self.upper[row])).max(0.0),
        }))
    }

    /// The largest overshoot over the new reference, or its reachable part, in the direction of the step.
    fn overshoot(&self, case: &Case, boost: &[f64]) -> f64 {
        let steps = self.reference_steps(case, boost.len()).into_iter();
        let overshoot = steps.map(|(first, before, after, next)| {
            let rows = first..next.min(first + point(OVERSHOOT_WITHIN));
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

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
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
