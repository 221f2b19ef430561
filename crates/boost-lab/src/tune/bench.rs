//! The test bench: a plant at the operating points of the tuning, whose duty is swept and stepped.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_package::terminal::number;
use fmu_package::{ParameterSet, Value};
use serde::{Deserialize, Serialize};

use super::fit::FirstOrder;
use super::procedure::Procedure;
use super::schedule::{Schedule, check_unit};
use crate::importer::{Fmu, Instance, SavedState, Selection};

const DUTY: &str = "hp_wastegate_pwm";
const BOOST: &str = "boost_pressure";
const SPEED: &str = "engine_speed";
const FROZEN: &str = "tank.frozen";
const START: &str = "initialization.mode";
const RUNNING: &str = "running";

/// The interval at the end of a hold for the drift of boost pressure (s).
const LOOK_BACK: f64 = 1.0;
/// Samples of responses are kept for drawing: all up to this time (s), and then every so many.
const DRAWN_DENSELY: f64 = 1.0;
const DRAWN_EACH: usize = 8;

/// A sweep of the duty at an engine speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// The column of the grid, from 0.
    pub column: usize,
    pub holds: Vec<Hold>,
}

/// A hold of the duty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hold {
    /// The duty (%).
    pub duty: f64,
    /// Boost pressure at the end (Pa).
    pub boost_pressure: f64,
    /// Its change in the last second (Pa).
    pub drift: f64,
}

/// The responses to steps at a point of the grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The row of the grid, from 0.
    pub row: usize,
    /// The column of the grid, from 0.
    pub column: usize,
    /// The hold before the steps.
    pub hold: Hold,
    /// Changes of boost pressure (Pa), up and down, at the samples that are drawn.
    pub responses: [Vec<f64>; 2],
    /// Final change up over final change down, in magnitude; 1 for a linear plant.
    pub asymmetry: f64,
    /// The model of the mean response to 1 % (Pa/%, s); none if no model fits.
    pub model: Option<FirstOrder>,
}

/// The samples of a response that are kept for drawing, from 1.
pub fn drawn_samples(procedure: &Procedure, sample_time: f64) -> impl Iterator<Item = usize> {
    let densely = steps(DRAWN_DENSELY, sample_time);
    (1..=steps(procedure.response_duration, sample_time))
        .filter(move |sample| *sample <= densely || sample.is_multiple_of(DRAWN_EACH))
}

/// The number of samples nearest to a duration.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // durations are positive and short
fn steps(duration: f64, sample_time: f64) -> usize {
    (duration / sample_time).round() as usize
}

/// A plant with its constant inputs.
pub struct Bench<'a> {
    plant: &'a Arc<Fmu>,
    parameters: &'a [ParameterSet],
    schedule: &'a Schedule,
    procedure: &'a Procedure,
    /// The constant inputs.
    held: Vec<(&'static str, f64)>,
    freezes_tank: bool,
    starts_running: bool,
    saves_states: bool,
    /// Notes for readers of the results.
    pub notes: Vec<String>,
}

impl<'a> Bench<'a> {
    /// Puts a plant on the bench.
    pub fn new(
        plant: &'a Arc<Fmu>,
        parameters: &'a [ParameterSet],
        schedule: &'a Schedule,
        procedure: &'a Procedure,
    ) -> Result<Self> {
        for (name, causality, unit) in
            [(DUTY, "input", "%"), (SPEED, "input", "rpm"), (BOOST, "output", "Pa")]
        {
            let variable = plant.variable(name)?;
            if variable.causality != causality {
                bail!("the plant's {name} is not an {causality}");
            }
            check_unit(variable, unit)?;
        }
        let wished = [
            ("lp_wastegate", 0.0),
            ("hp_bypass", 0.0),
            ("surge_valve", 0.0),
            ("vacuum_pump", 0.0),
            ("throttle", 1.0),
            ("supply_voltage", schedule.nominal_voltage),
        ];
        let (held, missing): (Vec<_>, Vec<_>) =
            wished.into_iter().partition(|(name, _)| plant.names("input").any(|input| input == *name));
        let freezes_tank = plant.description().variable(FROZEN).is_some();
        let starts_running = plant.description().variable(START).is_some_and(|variable| {
            let enumeration = plant.description().enumeration(&variable.declared_type);
            enumeration.is_some_and(|known| known.items.iter().any(|(item, _)| item == RUNNING))
        });
        let saves_states = plant.description().has_capability("canGetAndSetFMUstate");

        let mut notes = vec![];
        if !missing.is_empty() {
            let names: Vec<_> = missing.iter().map(|(name, _)| *name).collect();
            notes.push(format!(
                "The plant has no input {}: these quantities were not held constant.",
                names.join(", ")
            ));
        }
        if !freezes_tank {
            notes.push(format!("The plant has no {FROZEN}: the pressure of its vacuum tank was not held."));
        }
        if !starts_running {
            notes.push(format!(
                "The plant has no {START} with {RUNNING}: it started as it does by itself, not from an engine \
                 that was just started with its wastegate shut."
            ));
        }
        if !saves_states {
            notes.push(
                "The plant cannot save its state: each step began with a separate simulation, up to the same \
                 point."
                    .to_owned(),
            );
        }
        Ok(Self {
            plant,
            parameters,
            schedule,
            procedure,
            held,
            freezes_tank,
            starts_running,
            saves_states,
            notes,
        })
    }

    /// Sweeps the duty at the engine speed of a column.
    pub fn sweep(&self, column: usize) -> Result<Sweep> {
        let mut run = None;
        let mut holds = vec![];
        for &(duty, duration) in &self.procedure.sweep {
            let run = match &mut run {
                Some(run) => run,
                None => run.insert(self.start(column, duty)?),
            };
            holds.push(run.hold(duty, duration)?);
        }
        Ok(Sweep { column, holds })
    }

    /// Steps the duty up and down from a settled plant.
    pub fn step_both_ways(&self, row: usize, column: usize, duty: f64) -> Result<Point> {
        let step = self.procedure.duty_step;
        let mut run = self.start(column, duty)?;
        let hold = run.hold(duty, self.procedure.settling_duration)?;
        let saved = if self.saves_states { Some(run.save()?) } else { None };
        let up = run.response(duty + step, hold, self.procedure.response_duration)?;
        if let Some(saved) = &saved {
            run.restore(saved)?;
        } else {
            drop(run);
            run = self.start(column, duty)?;
            run.hold(duty, self.procedure.settling_duration)?;
        }
        let down = run.response(duty - step, hold, self.procedure.response_duration)?;

        let mean: Vec<f64> = up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * step)).collect();
        let ends = [&up, &down].map(|response| response.last().copied().unwrap_or(f64::NAN));
        let sample_time = self.schedule.sample_time;
        let drawn = |response: &[f64]| {
            drawn_samples(self.procedure, sample_time).map(|sample| response[sample - 1]).collect()
        };
        Ok(Point {
            row,
            column,
            hold,
            responses: [drawn(&up), drawn(&down)],
            asymmetry: (ends[0] / ends[1]).abs(),
            model: FirstOrder::fit(&mean, sample_time),
        })
    }

    /// An initialized instance at the engine speed of a column.
    fn start(&self, column: usize, duty: f64) -> Result<SteppedInstance> {
        let mut instance = self.plant.instantiate("plant")?;
        instance.set_up(0.0, None)?;
        for set in self.parameters {
            instance.set_parameters(set)?;
        }
        if self.starts_running {
            instance.set_value(START, &Value::Enumeration(RUNNING.to_owned()))?;
        }
        let frozen = self.freezes_tank.then_some((FROZEN, 1.0));
        let values = self.held.iter().copied().chain(frozen);
        let values: Vec<_> =
            values.chain([(SPEED, self.schedule.engine_speeds[column]), (DUTY, duty)]).collect();
        let mut all = self.plant.select(values.iter().map(|(name, _)| *name))?;
        instance.set(&mut all, &values.iter().map(|(_, value)| *value).collect::<Vec<_>>())?;
        instance.enter_initialization()?;
        instance.exit_initialization()?;
        Ok(SteppedInstance {
            instance,
            steps_done: 0,
            sample_time: self.schedule.sample_time,
            duty: self.plant.select([DUTY])?,
            boost: self.plant.select([BOOST])?,
        })
    }
}

/// An instance with its time.
struct SteppedInstance {
    instance: Instance,
    steps_done: u32,
    sample_time: f64,
    duty: Selection,
    boost: Selection,
}

impl SteppedInstance {
    fn step(&mut self) -> Result<()> {
        self.instance.step(f64::from(self.steps_done) * self.sample_time, self.sample_time)?;
        self.steps_done += 1;
        Ok(())
    }

    fn boost_pressure(&mut self) -> Result<f64> {
        let mut value = [f64::NAN];
        self.instance.get(&mut self.boost, &mut value)?;
        if !value[0].is_finite() {
            let time = f64::from(self.steps_done) * self.sample_time;
            bail!("the plant's {BOOST} is {} at {} s", number(value[0]), number(time));
        }
        Ok(value[0])
    }

    fn hold(&mut self, duty: f64, duration: f64) -> Result<Hold> {
        self.instance.set(&mut self.duty, &[duty])?;
        let count = steps(duration, self.sample_time);
        let look = count.saturating_sub(steps(LOOK_BACK, self.sample_time));
        let mut before = self.boost_pressure()?;
        for step in 0..count {
            if step == look {
                before = self.boost_pressure()?;
            }
            self.step()?;
        }
        let boost_pressure = self.boost_pressure()?;
        Ok(Hold { duty, boost_pressure, drift: boost_pressure - before })
    }

    /// The change of boost pressure at each sample.
    fn response(&mut self, duty: f64, from: Hold, duration: f64) -> Result<Vec<f64>> {
        self.instance.set(&mut self.duty, &[duty])?;
        (0..steps(duration, self.sample_time))
            .map(|_| {
                self.step()?;
                Ok(self.boost_pressure()? - from.boost_pressure)
            })
            .collect()
    }

    fn save(&mut self) -> Result<(SavedState, u32)> {
        Ok((self.instance.save().context("the state before the steps")?, self.steps_done))
    }

    fn restore(&mut self, (state, steps_done): &(SavedState, u32)) -> Result<()> {
        self.steps_done = *steps_done;
        self.instance.restore(state)
    }
}
