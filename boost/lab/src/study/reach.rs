//! What a plant can reach: boost pressure at rest with its valves at their stops, and how fast they move it.

use std::sync::Arc;

use anyhow::{Context, Result};

use super::draw::Case;
use super::names::{BOOST, SHAFT, has};
use super::situation::STEP;
use fmu_master::measure::interpolate;
use fmu_master::scenario::Signal;
use fmu_master::{Fmu, Instance, Selection};
use fmu_terms::Causality;

/// The high-pressure shaft speed at rest (rpm) that limits the reachable range, as the controller's limits.
pub const SHAFT_LIMIT: f64 = 205e3;
/// Settled when boost pressure changes by less than this (Pa) in [`LOOK_BACK`].
const RESTS_WITHIN: f64 = 20.0;
const LOOK_BACK: f64 = 0.5;
/// The longest wait (s).
const LONGEST_WAIT: f64 = 20.0;
/// Engine speeds between which the range is interpolated (rpm).
const SPEEDS: [f64; 8] = [2000.0, 2500.0, 3000.0, 3500.0, 4000.0, 4500.0, 5000.0, 5500.0];
/// Refinements of the duty at which the shaft reaches its limit: to about 100 rpm.
const REFINEMENTS: usize = 5;

/// Longest overrun of boost and shaft speed after the valves reverse, in steps: several times the actuator's time.
pub const TURNING_STEPS: usize = 24;

/// The valves: high-pressure wastegate (%), low-pressure wastegate, bypass of the high-pressure compressor.
pub type Valves = [f64; 3];
const SHUT: Valves = [0.0, 0.0, 0.0];
const OPEN: Valves = [100.0, 1.0, 1.0];
/// Only the high-pressure wastegate open, which slows the shaft.
const SLOWED: Valves = [100.0, 0.0, 0.0];

/// The valve stops between which a control that knows the plant switches.
#[derive(Clone, Copy)]
pub struct Stops {
    drive: Valves,
    back: Valves,
}

/// Towards higher and lower boost.
pub const UP: Stops = Stops { drive: SHUT, back: SLOWED };
pub const DOWN: Stops = Stops { drive: OPEN, back: SHUT };

/// The inputs' names and maximum values.
pub const VALVES: [(&str, f64); 3] = [("hp_wastegate_pwm", 100.0), ("lp_wastegate", 1.0), ("hp_bypass", 1.0)];

/// The boost pressure range that can be held, at each of a case's throttle openings.
pub struct Reach {
    ranges: Vec<(f64, Range)>,
}

/// The range at a throttle opening, over engine speed (Pa over rpm).
struct Range {
    highest: Vec<(f64, f64)>,
    lowest: Vec<(f64, f64)>,
}

impl Reach {
    /// Holds a case's plant at its stops, over the case's range of engine speeds.
    pub fn of(case: &Case, plant: &Arc<Fmu>) -> Result<Self> {
        let [least, most] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|of| case.speeds().reduce(of).unwrap_or(f64::NAN));
        let mut speeds: Vec<_> = SPEEDS.into_iter().filter(|speed| (least..=most).contains(speed)).collect();
        speeds.extend(case.speeds());
        speeds.sort_by(f64::total_cmp);
        speeds.dedup();
        let mut ranges = vec![];
        for throttle in case.throttles() {
            let bench = Bench { case, plant, throttle };
            let mut range = Range { highest: vec![], lowest: vec![] };
            for &speed in &speeds {
                range.highest.push((speed, bench.highest(speed)?));
                range.lowest.push((speed, bench.lowest(speed)?));
            }
            ranges.push((throttle, range));
        }
        Ok(Self { ranges })
    }

    fn range(&self, throttle: f64) -> Option<&Range> {
        let nearest = |(one, _): &&(f64, Range), (other, _): &&(f64, Range)| {
            (one - throttle).abs().total_cmp(&(other - throttle).abs())
        };
        self.ranges.iter().min_by(nearest).map(|(_, range)| range)
    }

    pub fn highest(&self, engine_speed: f64, throttle: f64) -> f64 {
        self.range(throttle).map_or(f64::NAN, |range| interpolate(&range.highest, engine_speed))
    }

    pub fn lowest(&self, engine_speed: f64, throttle: f64) -> f64 {
        self.range(throttle).map_or(f64::NAN, |range| interpolate(&range.lowest, engine_speed))
    }
}

/// A plant's measured state.
#[derive(Clone, Copy)]
pub struct Measured {
    pub boost: f64,
    /// The high-pressure shaft speed (rpm); 0 if the plant does not provide it.
    pub shaft: f64,
}

/// A case's plant with constant inputs.
struct Bench<'a> {
    case: &'a Case,
    plant: &'a Arc<Fmu>,
    throttle: f64,
}

impl Bench<'_> {
    /// The highest boost pressure at rest, with the wastegates shut or the shaft at its limit.
    fn highest(&self, engine_speed: f64) -> Result<f64> {
        let shut = self.rest(engine_speed, SHUT)?;
        if shut.shaft <= SHAFT_LIMIT {
            return Ok(shut.boost);
        }
        // Regula falsi (Illinois) on shaft speed over duty.
        let mut fast = (SHUT[0], shut);
        let mut slow = (OPEN[0], self.rest(engine_speed, SLOWED)?);
        if slow.1.shaft >= SHAFT_LIMIT {
            return Ok(slow.1.boost);
        }
        for _ in 0..REFINEMENTS {
            // The wastegate moves only in part of the range: bisect first.
            let share = (fast.1.shaft - SHAFT_LIMIT) / (fast.1.shaft - slow.1.shaft);
            let duty = fast.0 + share.clamp(0.2, 0.8) * (slow.0 - fast.0);
            let found = self.rest(engine_speed, [duty, 0.0, 0.0])?;
            if found.shaft > SHAFT_LIMIT { fast = (duty, found) } else { slow = (duty, found) }
        }
        let shafts = [(slow.1.shaft, slow.1.boost), (fast.1.shaft, fast.1.boost)];
        Ok(interpolate(&shafts, SHAFT_LIMIT))
    }

    /// The lowest boost pressure at rest, with the high-pressure wastegate open and the shaft within its limit: opening
    /// the bypass unloads the shaft. If it always exceeds its limit, the pressure where it is slowest.
    fn lowest(&self, engine_speed: f64) -> Result<f64> {
        let mut slowest: Option<Measured> = None;
        let mut lowest = f64::INFINITY;
        // The two with the lowest pressure, then the others.
        for openings in [[[1.0, 1.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]]] {
            for [low_pressure, bypass] in openings {
                let found = self.rest(engine_speed, [OPEN[0], low_pressure, bypass])?;
                if found.shaft <= SHAFT_LIMIT {
                    lowest = lowest.min(found.boost);
                }
                if slowest.is_none_or(|slowest| found.shaft < slowest.shaft) {
                    slowest = Some(found);
                }
            }
            if lowest.is_finite() {
                return Ok(lowest);
            }
        }
        Ok(slowest.map_or(f64::NAN, |slowest| slowest.boost))
    }

    /// The plant at rest at an engine speed with given valves.
    fn rest(&self, engine_speed: f64, valves: Valves) -> Result<Measured> {
        let mut plant = self.plant.instantiate("plant")?;
        plant.set_up(0.0, None)?;
        for (name, value) in &self.case.parameters {
            plant.set(name, *value)?;
        }
        let constant = [
            ("engine_speed", engine_speed),
            ("throttle", self.throttle),
            ("ambient_pressure", self.case.experiment.ambient[0]),
            ("ambient_temperature", self.case.experiment.ambient[1]),
        ];
        let inputs = VALVES.iter().zip(valves).map(|((name, _), value)| (*name, value)).chain(constant);
        let inputs: Vec<_> = inputs.filter(|(name, _)| has(self.plant, Causality::Input, name)).collect();
        let mut selection = self.plant.select(inputs.iter().map(|(name, _)| *name))?;
        plant.write(&mut selection, &inputs.iter().map(|(_, value)| *value).collect::<Vec<_>>())?;
        plant.enter_initialization()?;
        plant.exit_initialization()?;
        let mut sensors = Sensors::new(self.plant)?;
        let mut before = sensors.read(&mut plant)?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
        let [look, longest] = [LOOK_BACK, LONGEST_WAIT].map(|time| (time / STEP) as u32);
        for step in 0..longest {
            plant.step(f64::from(step) * STEP, STEP)?;
            if (step + 1) % look == 0 {
                let now = sensors.read(&mut plant)?;
                if (now.boost - before.boost).abs() < RESTS_WITHIN {
                    return Ok(now);
                }
                before = now;
            }
        }
        Ok(before)
    }
}

struct Sensors {
    selection: Selection,
    values: Vec<f64>,
}

impl Sensors {
    fn new(plant: &Fmu) -> Result<Self> {
        let known: Vec<_> =
            [BOOST].into_iter().chain(has(plant, Causality::Output, SHAFT).then_some(SHAFT)).collect();
        Ok(Self { values: vec![0.0; known.len()], selection: plant.select(known)? })
    }

    fn read(&mut self, plant: &mut Instance) -> Result<Measured> {
        plant.read(&mut self.selection, &mut self.values)?;
        let boost = *self.values.first().context("boost pressure")?;
        Ok(Measured { boost, shaft: self.values.get(1).copied().unwrap_or(0.0) })
    }
}

/// A plant taken out of its loop: its valves are commanded directly, its other inputs follow the case.
pub struct OpenLoop<'a> {
    plant: &'a mut Instance,
    valves: Selection,
    /// Which of [`VALVES`] the plant has.
    known: Vec<usize>,
    driven: Selection,
    signals: Vec<Signal>,
    sensors: Sensors,
}

impl<'a> OpenLoop<'a> {
    pub fn new(plant: &'a mut Instance, case: &Case) -> Result<Self> {
        let fmu = Arc::clone(plant.fmu());
        let known: Vec<_> =
            (0..VALVES.len()).filter(|&valve| has(&fmu, Causality::Input, VALVES[valve].0)).collect();
        let driven = [
            ("engine_speed", &case.experiment.engine_speed),
            ("supply_voltage", &case.experiment.supply),
            ("throttle", &case.experiment.throttle),
        ];
        let driven: Vec<_> =
            driven.into_iter().filter(|(name, _)| has(&fmu, Causality::Input, name)).collect();
        Ok(Self {
            plant,
            valves: fmu.select(known.iter().map(|&valve| VALVES[valve].0))?,
            known,
            driven: fmu.select(driven.iter().map(|(name, _)| *name))?,
            signals: driven.into_iter().map(|(_, signal)| signal.clone()).collect(),
            sensors: Sensors::new(&fmu)?,
        })
    }

    pub fn instance(&mut self) -> &mut Instance {
        self.plant
    }

    pub fn measured(&mut self) -> Result<Measured> {
        self.sensors.read(self.plant)
    }

    /// Takes the communication step of an index.
    pub fn step(&mut self, index: usize, valves: Valves) -> Result<Measured> {
        let time = index as f64 * STEP;
        let signals: Vec<_> = self.signals.iter().map(|signal| signal.at(time)).collect();
        self.plant.write(&mut self.driven, &signals)?;
        let commands: Vec<_> = self.known.iter().map(|&valve| valves[valve]).collect();
        self.plant.write(&mut self.valves, &commands)?;
        self.plant.step(time, STEP)?;
        self.sensors.read(self.plant)
    }

    /// Boost pressure from the step of an index until `ends` at a row or the row `last`, under a control that knows the
    /// plant but not the future: the valves stay at the stop that drives towards a bound as long as the plant would
    /// stay within it if they reversed in the next step; otherwise they reverse. The plant's state is restored.
    pub fn fastest(
        &mut self,
        Stops { drive, back }: Stops,
        (first, last): (usize, usize),
        is_within: impl Fn(usize, Measured) -> bool,
        ends: impl Fn(usize, f64) -> bool,
    ) -> Result<Vec<f64>> {
        let begin = self.plant.save()?;
        let mut pressures = vec![];
        for index in first..last {
            let before = self.plant.save()?;
            let mut measured = self.step(index, drive)?;
            if !is_within(index + 1, measured) || !self.turns_back(back, index + 1, measured, &is_within)? {
                self.plant.restore(&before)?;
                measured = self.step(index, back)?;
            }
            pressures.push(measured.boost);
            if ends(index + 1, measured.boost) {
                break;
            }
        }
        self.plant.restore(&begin)?;
        Ok(pressures)
    }

    /// Whether the plant stays within a bound from the row `first` when its valves move to a stop, until boost and
    /// shaft move away from the bound. The plant's state is restored.
    fn turns_back(
        &mut self,
        back: Valves,
        first: usize,
        begin: Measured,
        is_within: &impl Fn(usize, Measured) -> bool,
    ) -> Result<bool> {
        let saved = self.plant.save()?;
        let mut before = begin;
        let mut stays = true;
        for index in first..first + TURNING_STEPS {
            let now = self.step(index, back)?;
            stays = is_within(first, now);
            let is_opening = back[0] > 0.0;
            let has_turned =
                (now.boost < before.boost) == is_opening && (now.shaft < before.shaft) == is_opening;
            if !stays || has_turned {
                break;
            }
            before = now;
        }
        self.plant.restore(&saved)?;
        Ok(stays)
    }
}
