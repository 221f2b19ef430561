//! The test bench: a plant at the operating points of the tuning, whose duty is swept and stepped.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_io::terminal::number;
use fmu_package::ParameterSet;
use serde::{Deserialize, Serialize};

use super::actuator_fit;
use super::fit::FirstOrder;
use super::procedure::{Procedure, SplitRange};
use super::schedule::{Allocation, Schedule, check_unit};
use super::speed_fit::SpeedResponse;
use crate::study::names::{RUNNING, START, can_start_running};
use fmu_master::{Fmu, Instance, SavedState, Selection};
use fmu_terms::Causality;

const DUTY: &str = "hp_wastegate_pwm";
const BOOST: &str = "boost_pressure";
const LOW_PRESSURE: &str = "lp_wastegate";
const BYPASS: &str = "hp_bypass";
const SPEED: &str = "engine_speed";
const SHAFT: &str = "hp_turbo_speed";
const FROZEN: &str = "tank.frozen";

/// The interval at the end of a hold for the drift of boost pressure (s).
const LOOK_BACK: f64 = 1.0;
/// Samples of responses kept for drawing: all up to this time (s), then every n-th.
const DRAWN_DENSELY: f64 = 1.0;
const DRAWN_EACH: usize = 8;

/// A duty sweep at an engine speed.
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
    /// The change of boost pressure in the last second (Pa).
    pub drift: f64,
    /// The high-pressure shaft speed at the end (rpm), if the plant has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaft_speed: Option<f64>,
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
    /// Changes of boost pressure (Pa), up and down, at the drawn samples.
    pub responses: [Vec<f64>; 2],
    /// Final change up over final change down, in magnitude; 1 for a linear plant.
    pub asymmetry: f64,
    /// The model of the mean response to 1 % (Pa/%, s); none if no model fits.
    pub model: Option<FirstOrder>,
    /// The model of the mean response to 1 rpm (Pa/rpm, s); none if no model fits, or none is needed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_model: Option<SpeedResponse>,
    /// The actuator's lag (s), and the share of the engine speed sensitivity that a ramp needs, if they are found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator_lag: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_share: Option<f64>,
}

/// The samples of a response kept for drawing, from 1.
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
#[allow(clippy::struct_excessive_bools, reason = "each is something that a plant may lack")]
pub struct Bench<'a> {
    plant: &'a Arc<Fmu>,
    parameters: &'a [ParameterSet],
    schedule: &'a Schedule,
    procedure: &'a Procedure,
    /// The constant inputs.
    held: Vec<(&'static str, f64)>,
    has_low_pressure: bool,
    has_bypass: bool,
    has_shaft_speed: bool,
    freezes_tank: bool,
    starts_running: bool,
    saves_states: bool,
    /// Notes for readers of the results.
    pub notes: Vec<String>,
}

impl<'a> Bench<'a> {
    pub fn new(
        plant: &'a Arc<Fmu>,
        parameters: &'a [ParameterSet],
        schedule: &'a Schedule,
        procedure: &'a Procedure,
    ) -> Result<Self> {
        for (name, causality, unit) in [
            (DUTY, Causality::Input, "%"),
            (SPEED, Causality::Input, "rpm"),
            (BOOST, Causality::Output, "Pa"),
        ] {
            let variable = plant.variable(name)?;
            if variable.causality != causality {
                bail!("the plant's {name} must be an {causality}");
            }
            check_unit(variable, unit)?;
        }
        let wished = [
            (LOW_PRESSURE, 0.0),
            (BYPASS, 0.0),
            ("surge_valve", 0.0),
            ("vacuum_pump", 0.0),
            ("throttle", 1.0),
            ("supply_voltage", schedule.nominal_voltage),
        ];
        let has_input = |name: &str| plant.names(Causality::Input).any(|input| input == name);
        let [has_low_pressure, has_bypass] =
            [LOW_PRESSURE, BYPASS].map(|name| schedule.allocation.is_some() && has_input(name));
        let has_shaft_speed =
            schedule.allocation.is_some() && plant.names(Causality::Output).any(|output| output == SHAFT);
        if has_shaft_speed {
            check_unit(plant.variable(SHAFT)?, "rpm")?;
        }
        let (held, missing): (Vec<_>, Vec<_>) = wished.into_iter().partition(|(name, _)| has_input(name));
        let (commanded, missing): (Vec<_>, Vec<_>) = missing
            .into_iter()
            .partition(|(name, _)| schedule.allocation.is_some() && [LOW_PRESSURE, BYPASS].contains(name));
        let freezes_tank = plant.description().variable(FROZEN).is_some();
        let starts_running = can_start_running(plant.description());
        let saves_states = plant.has_capability("canGetAndSetFMUstate");

        let mut notes = vec![];
        for (name, _) in commanded {
            notes.push(format!(
                "The plant has no input {name}: the virtual duty cannot move that valve, so the maps are for the others."
            ));
        }
        if schedule.allocation.is_some() && !has_shaft_speed {
            notes.push(format!(
                "The plant has no output {SHAFT}: the boost reference is not limited by this shaft's speed."
            ));
        }
        if !missing.is_empty() {
            let names: Vec<_> = missing.iter().map(|(name, _)| *name).collect();
            notes.push(format!(
                "The plant has no input {}: these quantities were not held constant.",
                names.join(", ")
            ));
        }
        if !freezes_tank {
            notes.push(format!("The plant has no {FROZEN}: its vacuum tank pressure was not held."));
        }
        if !starts_running {
            notes.push(format!(
                "The plant has no {START} with {RUNNING}: it started from its own initial state, not as an engine just \
                 started with its wastegate shut."
            ));
        }
        if !saves_states {
            notes.push(
                "The plant cannot save its state: for each step it was simulated again up to the same point."
                    .to_owned(),
            );
        }
        Ok(Self {
            plant,
            parameters,
            schedule,
            procedure,
            held,
            has_low_pressure,
            has_bypass,
            has_shaft_speed,
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
        for &(duty, duration) in self.procedure.range(self.schedule.is_wide(column)).sweep {
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
        let Procedure { duty_step, response_duration, ref split_range, .. } = *self.procedure;
        let mut changes =
            vec![(Change::Duty(duty_step), response_duration), (Change::Duty(-duty_step), response_duration)];
        if let Some(SplitRange { speed_step, speed_response_duration, .. }) = *split_range {
            changes.extend(
                [speed_step, -speed_step].map(|step| (Change::EngineSpeed(step), speed_response_duration)),
            );
        }
        let (hold, responses) = self.responses(column, duty, &changes)?;
        let sample_time = self.schedule.sample_time;
        let mean = |[up, down]: &[Vec<f64>; 2], step: f64| -> Vec<f64> {
            up.iter().zip(down).map(|(up, down)| (up - down) / (2.0 * step)).collect()
        };
        let (pairs, _) = responses.as_chunks::<2>();
        let of_duty = &pairs[0];
        let ends = of_duty.each_ref().map(|response| response.last().copied().unwrap_or(f64::NAN));
        let drawn = |response: &[f64]| {
            drawn_samples(self.procedure, sample_time).map(|sample| response[sample - 1]).collect()
        };
        let by_duty = mean(of_duty, duty_step);
        let model = FirstOrder::fit(&by_duty, sample_time);
        let speed_model = split_range
            .as_ref()
            .zip(pairs.get(1))
            .and_then(|(split, of_speed)| SpeedResponse::fit(&mean(of_speed, split.speed_step), sample_time));
        let ramp_share = model.as_ref().zip(speed_model.as_ref()).and_then(|(model, speed)| {
            let (gain, sensitivity) = (model.gain.value, speed.fall * model.time_constant.value);
            actuator_fit::ramp_share(&by_duty, speed, gain, sensitivity, sample_time)
        });
        Ok(Point {
            row,
            column,
            hold,
            responses: of_duty.each_ref().map(|response| drawn(response)),
            asymmetry: (ends[0] / ends[1]).abs(),
            model,
            actuator_lag: speed_model.and_then(|_| actuator_fit::actuator_lag(&by_duty, sample_time)),
            speed_model,
            ramp_share,
        })
    }

    /// The changes of boost pressure (Pa) after each change, all from one settled state, and the hold before them.
    fn responses(
        &self,
        column: usize,
        duty: f64,
        changes: &[(Change, f64)],
    ) -> Result<(Hold, Vec<Vec<f64>>)> {
        let mut settled: Option<Settled<'_>> = None;
        let mut responses = vec![];
        for &(change, duration) in changes {
            if let Some((run, _, Some(saved))) = &mut settled {
                run.restore(saved)?;
            } else {
                // The plant may allow only one instance.
                drop(settled.take());
                let mut run = self.start(column, duty)?;
                let hold = run.hold(duty, self.procedure.settling_duration)?;
                let saved = if self.saves_states { Some(run.save()?) } else { None };
                settled = Some((run, hold, saved));
            }
            let (run, hold, _) = settled.as_mut().context("the plant is settled")?;
            match change {
                Change::Duty(step) => run.set_duty(duty + step)?,
                Change::EngineSpeed(step) => {
                    run.instance.set(SPEED, self.schedule.engine_speeds[column] + step)?;
                }
            }
            responses.push(run.response(*hold, duration)?);
        }
        let (_, hold, _) = settled.context("there is a change")?;
        Ok((hold, responses))
    }

    /// The inputs set by a duty at the engine speed of a column, through the controller's allocation if it has one.
    fn valves(&self, column: usize, duty: f64) -> Vec<(&'static str, f64)> {
        let Some(Allocation { parameters, largest_duty, .. }) = &self.schedule.allocation else {
            return vec![(DUTY, duty)];
        };
        let openings = parameters.openings(duty, self.schedule.engine_speeds[column]);
        let mut valves = vec![(DUTY, duty.min(*largest_duty))];
        valves.extend(self.has_low_pressure.then_some((LOW_PRESSURE, openings.lp_wastegate)));
        valves.extend(self.has_bypass.then_some((BYPASS, openings.hp_bypass)));
        valves
    }

    /// An initialized instance at the engine speed of a column.
    fn start(&self, column: usize, duty: f64) -> Result<SteppedInstance<'_>> {
        let mut instance = self.plant.instantiate("plant")?;
        instance.set_up(0.0, None)?;
        for set in self.parameters {
            instance.set_parameters(set)?;
        }
        if self.starts_running {
            instance.set(START, RUNNING)?;
        }
        let frozen = self.freezes_tank.then_some((FROZEN, 1.0));
        let valves = self.valves(column, duty);
        // The valves override the held inputs.
        let held =
            self.held.iter().copied().filter(|(name, _)| valves.iter().all(|(valve, _)| valve != name));
        let values = held.chain(frozen).chain([(SPEED, self.schedule.engine_speeds[column])]);
        let values: Vec<_> = values.chain(valves.iter().copied()).collect();
        let mut all = self.plant.select(values.iter().map(|(name, _)| *name))?;
        instance.write(&mut all, &values.iter().map(|(_, value)| *value).collect::<Vec<_>>())?;
        instance.enter_initialization()?;
        instance.exit_initialization()?;
        Ok(SteppedInstance {
            instance,
            steps_done: 0,
            sample_time: self.schedule.sample_time,
            bench: self,
            column,
            valves: self.plant.select(valves.iter().map(|(name, _)| *name))?,
            boost: self.plant.select([BOOST])?,
        })
    }
}

/// An instance at rest, its hold, and its state if the plant can save it.
type Settled<'a> = (SteppedInstance<'a>, Hold, Option<(SavedState, u32)>);

/// A step from rest.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// A step of the duty (%).
    Duty(f64),
    /// A step of engine speed (rpm), with the valves held.
    EngineSpeed(f64),
}

/// An instance with its time.
struct SteppedInstance<'a> {
    instance: Instance,
    steps_done: u32,
    sample_time: f64,
    bench: &'a Bench<'a>,
    column: usize,
    valves: Selection,
    boost: Selection,
}

impl SteppedInstance<'_> {
    fn set_duty(&mut self, duty: f64) -> Result<()> {
        let values: Vec<_> =
            self.bench.valves(self.column, duty).into_iter().map(|(_, value)| value).collect();
        self.instance.write(&mut self.valves, &values)
    }

    fn step(&mut self) -> Result<()> {
        self.instance.step(f64::from(self.steps_done) * self.sample_time, self.sample_time)?;
        self.steps_done += 1;
        Ok(())
    }

    fn boost_pressure(&mut self) -> Result<f64> {
        let mut value = [f64::NAN];
        self.instance.read(&mut self.boost, &mut value)?;
        self.finite(BOOST, value[0])
    }

    fn shaft_speed(&mut self) -> Result<Option<f64>> {
        let speed = self.bench.has_shaft_speed.then(|| self.instance.get(SHAFT)).transpose()?;
        speed.map(|speed| self.finite(SHAFT, speed)).transpose()
    }

    fn finite(&self, name: &str, value: f64) -> Result<f64> {
        if !value.is_finite() {
            let time = f64::from(self.steps_done) * self.sample_time;
            bail!("the plant's {name} is {} at {} s", number(value), number(time));
        }
        Ok(value)
    }

    fn hold(&mut self, duty: f64, duration: f64) -> Result<Hold> {
        self.set_duty(duty)?;
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
        Ok(Hold { duty, boost_pressure, drift: boost_pressure - before, shaft_speed: self.shaft_speed()? })
    }

    /// The change of boost pressure at each sample.
    fn response(&mut self, from: Hold, duration: f64) -> Result<Vec<f64>> {
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
