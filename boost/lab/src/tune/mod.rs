//! Tunes the controller to a plant, as in section 6 of the paper: a first-order model with delay (eq. (10)) at each
//! point of a grid of engine speeds and boost references, and the feedback from it by lambda tuning (eq. (12)).
//!
//! A duty sweep at each engine speed gives the static map, whose inverse is the feedforward. At each reachable grid
//! point the plant settles at its feedforward, and steps up and down from one saved state give the model. The other
//! points are filled and marked as such.

mod actuator_fit;
mod bench;
pub mod comparison;
mod dcm;
mod fit;
mod journal;
mod monotone;
mod procedure;
mod report;
mod response_fit;
pub mod rest;
mod schedule;
mod speed_fit;

use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use boost_fmu::controller::feedback;
use boost_fmu::controller::schedule::LocalModel;
use clap::ValueEnum as _;
use fmu_package::connection::{self, Connection};
use fmu_package::{Parameter, ParameterSet, Value};
use serde::Serialize;

use fmu_master::Fmu;
use fmu_master::measure::{greatest, least};
use fmu_run::journal::Identity;
use fmu_run::workers::Workers;

use self::bench::Bench;
pub use self::bench::{Point, Sweep};
use self::comparison::Compared;
pub use self::dcm::dcm;
pub use self::fit::{Estimate, FirstOrder};
pub use self::journal::{TuningJob, TuningJournal, TuningPart};
pub use self::monotone::Monotone;
use self::procedure::Range;
pub use self::procedure::{Procedure, Strategy};
pub use self::report::{html, json};
pub use self::schedule::{Schedule, ScheduleTable};

pub struct Task {
    pub plant: Arc<Fmu>,
    /// The connections by which the plant is seen, if any.
    pub connections: Vec<Connection>,
    /// The plant's parameters, set in their order.
    pub plant_parameters: Vec<ParameterSet>,
    /// The controller's grid.
    pub schedule: Schedule,
    pub procedure: Procedure,
}

/// The origin of a point's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CellOrigin {
    /// Responses at the point.
    Identified,
    /// The reference is above the reachable range.
    AboveReach,
    /// The reference is below the reachable range.
    BelowReach,
    /// The point's feedforward is outside the stepped duties.
    OutsideFittedDuty,
    /// No model that the controller accepts fits the responses.
    NoModel,
}

impl CellOrigin {
    /// Why a point is not identified.
    fn reason(self) -> &'static str {
        match self {
            Self::AboveReach => "the reference is above the reachable range",
            Self::BelowReach => "the reference is below the reachable range",
            Self::OutsideFittedDuty => "its feedforward is outside the stepped duties",
            Self::NoModel | Self::Identified => "no model fits",
        }
    }
}

/// A point of the tuned schedule.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The row, from 0.
    pub row: usize,
    /// The column, from 0.
    pub column: usize,
    /// The origin of the values.
    pub basis: CellOrigin,
    /// The row and column of the identified point that provides gain, time constant and delay.
    pub taken_from: (usize, usize),
    /// The duty at nominal voltage that holds the reference (%).
    pub feedforward: f64,
    /// The gain (Pa/%).
    pub gain: f64,
    /// Whether the gain was raised to the minimum magnitude.
    pub gain_is_raised: bool,
    /// The time constant (s).
    pub time_constant: f64,
    /// The delay (s).
    pub delay: f64,
    /// Whether the delay was raised to the minimum.
    pub delay_is_raised: bool,
    /// Deviation of boost pressure from rest while engine speed rises by 1 rpm/s (Pa s/rpm); none for the strategy
    /// `by_speed`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_sensitivity: Option<f64>,
    /// The feedback that the controller computes from the point's values.
    pub feedback: Feedback,
}

/// The parameters of the feedback: paper eq. (12).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Feedback {
    /// K in %/Pa.
    pub gain: f64,
    /// `T_i` in s.
    pub integral_time: f64,
    /// `T_d` in s.
    pub derivative_time: f64,
}

impl Feedback {
    /// Lambda tuning of a model with gain (Pa/%), time constant (s) and delay (s).
    pub fn tuned(gain: f64, time_constant: f64, delay: f64, lambda: f64) -> Self {
        let feedback::FeedbackSettings { gain, integral_time, derivative_time, .. } =
            feedback::FeedbackSettings::new(&LocalModel { gain, time_constant, delay }, lambda);
        Self { gain, integral_time, derivative_time }
    }
}

pub struct Tuning {
    pub task: Task,
    pub sweeps: Vec<Sweep>,
    /// The points with responses.
    pub points: Vec<Point>,
    /// The schedule, row by row.
    pub cells: Vec<Cell>,
    /// For each column, the largest duty of the sweep at which the wastegate is shut (%).
    pub lift_offs: Vec<f64>,
    /// For each column, the limit of the boost reference (Pa); none for the strategy `by_speed`.
    pub boost_limits: Vec<f64>,
    /// The loop before and after, if there is a controller to run.
    pub comparison: Vec<Compared>,
    pub notes: Vec<String>,
}

impl Task {
    /// The plant's parameters as text.
    pub fn plant_parameters_written(&self) -> String {
        let written = |parameter: &Parameter| format!("{} = {}", parameter.name, parameter.value);
        let parameters: Vec<_> =
            self.plant_parameters.iter().flat_map(|set| &set.parameters).map(written).collect();
        if parameters.is_empty() { "its start values".to_owned() } else { parameters.join(", ") }
    }

    /// Everything that the experiments depend on; `digest` is that of the plant's file. Taken apart without `..`, so that a
    /// new field does not compile until it is decided.
    pub fn identity(&self, digest: String) -> Identity {
        let Self { plant: _, connections, plant_parameters, schedule, procedure } = self;
        let units: Vec<_> = plant_parameters.iter().map(|set| &set.units).collect();
        let own = [
            ("boost-lab's version", env!("CARGO_PKG_VERSION").to_owned()),
            ("SHA-256 of the plant's file", digest),
            ("the plant's parameters", self.plant_parameters_written()),
            ("the units of the plant's parameters", format!("{units:?}")),
            ("the procedure", format!("{procedure:?}")),
            ("the connections", connection::in_line(connections)),
        ];
        own.into_iter().chain(schedule.identity()).map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// The longest simulated time of a tuning (s).
    pub fn duration(&self) -> f64 {
        let columns = self.schedule.engine_speeds.len() as f64;
        let points = columns * self.schedule.boost_references.len() as f64;
        let sweeps: f64 =
            (0..self.schedule.engine_speeds.len()).map(|column| self.range(column).sweep_duration()).sum();
        sweeps + points * self.procedure.point_duration()
    }

    /// The duties of a column.
    fn range(&self, column: usize) -> Range<'_> {
        self.procedure.range(self.schedule.is_wide(column))
    }

    /// Tunes, by workers that [work](Self::work) for it. Finished parts are read from the journal, others written to it;
    /// several threads call `progress` with the seconds of [`duration`](Self::duration) that each sweep or point took.
    pub fn run(
        self,
        journal: &TuningJournal,
        workers: &Workers<'_>,
        progress: &(impl Fn(f64) + Sync),
    ) -> Result<Tuning> {
        let bench = self.bench()?;
        let duration_of = |part: &TuningPart| match part {
            TuningPart::Sweep(sweep) => self.range(sweep.column).sweep_duration(),
            TuningPart::Point(_) => self.procedure.point_duration(),
        };
        journal.finished().iter().for_each(|part| progress(duration_of(part)));
        let finish = |jobs: &[_]| {
            let failed = |key: &(Option<usize>, usize), reason| {
                let speed = self.schedule.engine_speeds[key.1];
                let part = match key.0 {
                    None => "sweep at".to_owned(),
                    Some(row) => format!("steps at {} kPa and", self.schedule.boost_references[row] / 1e3),
                };
                Err(anyhow!("the {part} {speed} rpm: {reason}"))
            };
            workers.finish(journal, jobs, failed, |part| progress(duration_of(part)))
        };
        let columns = self.schedule.engine_speeds.len();
        let jobs: Vec<_> = (0..columns).map(|column| ((None, column), TuningJob::Sweep(column))).collect();
        let sweeps: Vec<_> = finish(&jobs)?.into_iter().filter_map(TuningPart::sweep).collect();
        let statics: Vec<_> = sweeps.iter().map(|sweep| self.static_map(sweep)).collect::<Result<_>>()?;

        let mut jobs = vec![];
        for row in 0..self.schedule.boost_references.len() {
            for (column, map) in statics.iter().enumerate() {
                match self.placed(map, row, column) {
                    (CellOrigin::Identified, duty) => {
                        jobs.push(((Some(row), column), TuningJob::Point(row, column, duty)));
                    }
                    _ => progress(self.procedure.point_duration()),
                }
            }
        }
        let points: Vec<_> = finish(&jobs)?.into_iter().filter_map(TuningPart::point).collect();
        let cells = self.cells(&statics, &points)?;
        let lift_offs = sweeps.iter().map(|sweep| self.lift_off(sweep)).collect();
        let boost_limits = sweeps.iter().filter_map(|sweep| self.boost_limit(sweep)).collect();
        let notes = bench.notes;
        let comparison = vec![];
        Ok(Tuning { task: self, sweeps, points, cells, lift_offs, boost_limits, comparison, notes })
    }

    /// Does a worker's job.
    pub fn work(&self, job: TuningJob) -> Result<TuningPart> {
        let bench = self.bench()?;
        match job {
            TuningJob::Sweep(column) => bench.sweep(column).map(TuningPart::Sweep),
            TuningJob::Point(row, column, duty) => {
                bench.step_both_ways(row, column, duty).map(|point| TuningPart::Point(Box::new(point)))
            }
        }
    }

    fn bench(&self) -> Result<Bench<'_>> {
        Bench::new(&self.plant, &self.plant_parameters, &self.schedule, &self.procedure)
            .context("cannot tune to this plant")
    }

    /// The largest duty of a sweep (%) below which boost pressure hardly rises.
    fn lift_off(&self, sweep: &Sweep) -> f64 {
        let pressures = || sweep.holds.iter().map(|hold| hold.boost_pressure);
        let (least, most) = (least(pressures()), greatest(pressures()));
        let shut = most - self.procedure.shut_part * (most - least);
        let holds = sweep.holds.iter().filter(|hold| hold.boost_pressure >= shut);
        greatest(holds.map(|hold| hold.duty))
    }

    /// The largest boost reference (Pa) at which the high-pressure shaft keeps its limit at rest.
    fn boost_limit(&self, sweep: &Sweep) -> Option<f64> {
        let (allocation, split) = (self.schedule.allocation.as_ref()?, self.procedure.split_range.as_ref()?);
        let of_shaft = sweep.holds.iter().filter_map(|hold| Some((hold.shaft_speed?, hold.boost_pressure)));
        let reached = limit_of_shaft(of_shaft.collect(), split.shaft_speed_limit);
        Some(reached.map_or(allocation.boost_limit, |reached| reached.min(allocation.boost_limit)))
    }

    /// Duty over boost pressure, from the points of a sweep with ascending pressure.
    fn static_map(&self, sweep: &Sweep) -> Result<Monotone> {
        let points = rising(sweep.holds.iter().map(|hold| (hold.boost_pressure, hold.duty)));
        Monotone::through(points).with_context(|| {
            let speed = self.schedule.engine_speeds[sweep.column];
            format!(
                "at {speed} rpm boost pressure does not rise as duty falls: the procedure needs a wastegate \
                 opened by more duty"
            )
        })
    }

    /// Whether a reference can be reached, and its feedforward.
    fn placed(&self, duty_over_boost: &Monotone, row: usize, column: usize) -> (CellOrigin, f64) {
        let reference = self.schedule.boost_references[row];
        let Range { fitted_duty: (least, most), duty_below_reach, .. } = self.range(column);
        match duty_over_boost.at(reference) {
            Some(duty) if (least..=most).contains(&duty) => (CellOrigin::Identified, duty),
            Some(duty) => (CellOrigin::OutsideFittedDuty, duty),
            None if reference > duty_over_boost.last() => {
                (CellOrigin::AboveReach, self.procedure.duty_above_reach)
            }
            None => (CellOrigin::BelowReach, duty_below_reach),
        }
    }

    /// The schedule, row by row.
    fn cells(&self, statics: &[Monotone], points: &[Point]) -> Result<Vec<Cell>> {
        let identified: Vec<_> = points
            .iter()
            .filter_map(|point| {
                let model = point.model.as_ref().filter(|model| self.is_usable(model))?;
                let sensitivity = match self.procedure.split_range {
                    Some(_) => Some(self.speed_sensitivity(point, model)?),
                    None => None,
                };
                Some(((point.row, point.column), (model, sensitivity)))
            })
            .collect();
        let columns = statics.len();
        let cell = |index: usize| {
            let (row, column) = (index / columns, index % columns);
            let (basis, feedforward) = self.placed(&statics[column], row, column);
            // The nearest row at the same speed, else at the nearest speed.
            let distance = |&(known_row, known_column): &(usize, usize)| {
                let apart = |values: &[f64], one: usize, other: usize| (values[one] - values[other]).abs();
                (
                    apart(&self.schedule.engine_speeds, known_column, column),
                    apart(&self.schedule.boost_references, known_row, row),
                )
            };
            let nearest = identified.iter().min_by(|(one, _), (other, _)| {
                let (one, other) = (distance(one), distance(other));
                one.0.total_cmp(&other.0).then(one.1.total_cmp(&other.1))
            });
            let &(taken_from, (model, speed_sensitivity)) = nearest.context(
                "no grid point could be identified: the boost references are outside the plant's range, or no model \
                 fits the responses",
            )?;
            let is_own = taken_from == (row, column);
            let gain = model.gain.value.min(-self.procedure.least_gain);
            let delay = model.delay.value.max(self.procedure.least_delay);
            let time_constant = model.time_constant.value;
            Ok(Cell {
                row,
                column,
                basis: if basis == CellOrigin::Identified && !is_own { CellOrigin::NoModel } else { basis },
                taken_from,
                feedforward,
                gain,
                gain_is_raised: gain < model.gain.value,
                time_constant,
                delay,
                delay_is_raised: delay > model.delay.value,
                speed_sensitivity,
                feedback: Feedback::tuned(gain, time_constant, delay, self.schedule.lambda),
            })
        };
        (0..self.schedule.boost_references.len() * columns).map(cell).collect()
    }

    /// The effect of engine speed changes at a point: the initial drop of boost pressure times the valves' time to
    /// compensate for it. None if no acceptable model fits.
    fn speed_sensitivity(&self, point: &Point, model: &FirstOrder) -> Option<f64> {
        let sensitivity = point.speed_model.as_ref()?.fall * model.time_constant.value;
        self.schedule.takes(ScheduleTable::SpeedSensitivity, sensitivity).then_some(sensitivity)
    }

    /// Whether the controller accepts a model: falling with the duty, and within the ranges.
    fn is_usable(&self, model: &FirstOrder) -> bool {
        let (least_gain, longest) = self
            .procedure
            .split_range
            .as_ref()
            .map_or((0.0, f64::INFINITY), |split| (split.least_fitted_gain, split.longest_time_constant));
        model.gain.value < -least_gain
            && model.time_constant.value <= longest
            && self.schedule.takes(ScheduleTable::Gain, model.gain.value)
            && self.schedule.takes(ScheduleTable::TimeConstant, model.time_constant.value)
            && self.schedule.takes(ScheduleTable::Delay, model.delay.value)
    }
}

/// The largest boost pressure (Pa) at which a shaft keeps a speed (rpm), from its speeds over ascending boost pressures;
/// none if it keeps it at all of them. If it keeps it at none, the pressure at which it is slowest.
///
/// The bypass, open at low boost pressure, unloads the shaft: its speed rises with boost pressure only from its least on.
fn limit_of_shaft(over_boost: Vec<(f64, f64)>, limit: f64) -> Option<f64> {
    let slowest = least(over_boost.iter().map(|(speed, _)| *speed));
    let over_speed = rising(over_boost.into_iter().skip_while(|(speed, _)| *speed > slowest));
    over_speed.last().filter(|(fastest, _)| *fastest >= limit)?;
    Monotone::through(over_speed)?.at(limit.max(slowest))
}

/// The points beyond all previous ones.
fn rising(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut rising: Vec<(f64, f64)> = vec![];
    for point in points {
        if rising.last().is_none_or(|&(before, _)| point.0 > before) {
            rising.push(point);
        }
    }
    rising
}

impl Cell {
    pub fn value(&self, map: ScheduleTable) -> f64 {
        match map {
            ScheduleTable::Feedforward => self.feedforward,
            ScheduleTable::Gain => self.gain,
            ScheduleTable::TimeConstant => self.time_constant,
            ScheduleTable::Delay => self.delay,
            ScheduleTable::SpeedSensitivity => self.speed_sensitivity.unwrap_or_default(),
        }
    }

    /// Whether a value was raised to its minimum magnitude.
    pub fn is_raised(&self, map: ScheduleTable) -> bool {
        match map {
            ScheduleTable::Gain => self.gain_is_raised,
            ScheduleTable::Delay => self.delay_is_raised,
            _ => false,
        }
    }

    /// Whether a value of the cell was identified, and not filled or raised.
    pub fn is_found(&self, map: ScheduleTable) -> bool {
        match map {
            ScheduleTable::Feedforward => {
                !matches!(self.basis, CellOrigin::AboveReach | CellOrigin::BelowReach)
            }
            _ => self.basis == CellOrigin::Identified && !self.is_raised(map),
        }
    }
}

impl Tuning {
    /// How many points of the grid are identified, and what the others are.
    pub fn counts(&self) -> [String; 2] {
        let count = |basis| self.cells.iter().filter(|cell| cell.basis == basis).count();
        let others = format!(
            "{} above and {} below the reachable range, {} outside the stepped duties, {} without a model",
            count(CellOrigin::AboveReach),
            count(CellOrigin::BelowReach),
            count(CellOrigin::OutsideFittedDuty),
            count(CellOrigin::NoModel)
        );
        [count(CellOrigin::Identified).to_string(), others]
    }

    /// The responses at a point of the grid.
    pub fn point(&self, row: usize, column: usize) -> Option<&Point> {
        self.points.iter().find(|point| (point.row, point.column) == (row, column))
    }

    /// The controller's minimum useful duty (%): a smaller one raises boost pressure at no engine speed.
    ///
    /// The controller's reference model assumes that every duty has an effect. Below lift-off it would run ahead of the
    /// plant near the highest pressure, and the feedback would overshoot.
    pub fn least_duty(&self) -> f64 {
        least(self.lift_offs.iter().copied())
    }

    /// The actuator's lag (s) and the share of the engine speed sensitivity on ramps, each the median over the points that
    /// the schedule takes; none for the strategy `by_speed`.
    pub fn dynamics(&self) -> [(&'static str, &'static str, &'static str, Option<f64>); 2] {
        let points = || {
            self.points.iter().filter(|point| {
                let cell =
                    self.cells.iter().find(|cell| (cell.row, cell.column) == (point.row, point.column));
                cell.is_some_and(|cell| cell.basis == CellOrigin::Identified)
            })
        };
        [
            (
                schedule::ACTUATOR_LAG,
                "s",
                "time until the rate of boost after a duty step has risen to 63 % of its peak; median of the points",
                actuator_fit::median(points().map(|point| point.actuator_lag)),
            ),
            (
                schedule::RAMP_SHARE,
                "1",
                "least square error on an engine speed ramp of 0.8 s; median of the points",
                actuator_fit::median(points().map(|point| point.ramp_share)),
            ),
        ]
    }

    /// The origin of a value as text.
    pub fn provenance(&self, cell: &Cell, map: ScheduleTable) -> String {
        let procedure = &self.task.procedure;
        if map == ScheduleTable::Feedforward {
            return match cell.basis {
                CellOrigin::AboveReach | CellOrigin::BelowReach => format!("filled: {}", cell.basis.reason()),
                _ => "inverse of the sweep".to_owned(),
            };
        }
        let (row, column) = cell.taken_from;
        let mut text = if cell.basis == CellOrigin::Identified {
            let model = self.point(row, column).and_then(|point| point.model.as_ref());
            let error = model.map(|model| match map {
                ScheduleTable::Gain => model.gain.standard_error,
                ScheduleTable::Delay => model.delay.standard_error,
                _ => model.time_constant.standard_error,
            });
            match error.filter(|_| map != ScheduleTable::SpeedSensitivity) {
                Some(error) => format!("identified, standard error {error:.2e} {}", map.unit()),
                None => "identified by engine speed steps".to_owned(),
            }
        } else {
            let schedule = &self.task.schedule;
            format!(
                "filled from {} Pa at {} rpm: {}",
                schedule.boost_references[row],
                schedule.engine_speeds[column],
                cell.basis.reason()
            )
        };
        match map {
            ScheduleTable::Gain if cell.gain_is_raised => {
                text += &format!("; raised to the minimum magnitude, {} Pa/%", procedure.least_gain);
            }
            ScheduleTable::Delay if cell.delay_is_raised => {
                text += &format!("; raised to the minimum delay, {} s", procedure.least_delay);
            }
            _ => {}
        }
        text
    }

    /// The origin of a boost reference limit as text.
    fn source_of_limit(&self, column: usize) -> String {
        let limit =
            self.task.procedure.split_range.as_ref().map_or(f64::NAN, |split| split.shaft_speed_limit);
        let fastest = self.sweeps[column].holds.iter().filter_map(|hold| hold.shaft_speed).reduce(f64::max);
        match fastest {
            None => "high-pressure shaft speed unknown".to_owned(),
            Some(fastest) if fastest < limit => {
                format!("high-pressure shaft speed does not exceed {fastest:.0} rpm")
            }
            Some(_) => format!("high-pressure shaft at {limit} rpm, or slowest if it always exceeds that"),
        }
    }

    pub fn parameter_set(&self, name: &str) -> ParameterSet {
        let schedule = &self.task.schedule;
        let parameter = |name: String, description: String, value: f64, unit: &str| Parameter {
            name,
            description,
            value: Value::Real(value, Some(unit.to_owned())),
        };
        let lift_off =
            "wastegate lift-off: the largest duty of the sweeps below which boost pressure rises no further";
        let given = schedule.given().into_iter().map(|(name, value, unit)| {
            let description = if name == schedule::lambda_parameter(schedule.strategy) {
                schedule.source_of_lambda
            } else {
                ""
            };
            parameter(name, description.to_owned(), value, unit)
        });
        let mut parameters: Vec<_> = given.collect();
        let least_duty =
            parameter(schedule::LEAST_DUTY.to_owned(), lift_off.to_owned(), self.least_duty(), "%");
        parameters.insert(1, least_duty);
        if let Some(strategy) = schedule.strategy.to_possible_value()
            && schedule.description.variable(schedule::STRATEGY).is_some()
        {
            parameters.push(Parameter {
                name: schedule::STRATEGY.to_owned(),
                description: "strategy of this gain schedule".to_owned(),
                value: Value::Enumeration(strategy.get_name().to_owned()),
            });
        }
        let dynamics = self.dynamics().into_iter();
        parameters.extend(dynamics.filter_map(|(name, unit, description, value)| {
            Some(parameter(name.to_owned(), description.to_owned(), value?, unit))
        }));
        for (column, &limit) in self.boost_limits.iter().enumerate() {
            let name = schedule::boost_limit_parameter(column);
            parameters.push(parameter(name, self.source_of_limit(column), limit, "Pa"));
        }
        for &map in ScheduleTable::all(schedule.strategy) {
            for cell in &self.cells {
                let name = schedule.parameter(map, cell.row, cell.column);
                parameters.push(parameter(name, self.provenance(cell, map), cell.value(map), map.unit()));
            }
        }
        let plant = self.task.plant.description().attribute("modelName");
        let with = self.task.plant_parameters.iter().map(|set| format!(" with {}", set.name));
        ParameterSet {
            name: name.to_owned(),
            description: format!(
                "gain schedule of {}, tuned to {plant}{}",
                schedule.controller,
                with.collect::<String>()
            ),
            parameters,
            units: schedule.description.units.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speeds (rpm) over boost pressures (Pa), with a bypass that unloads the shaft at low boost pressure.
    const OVER_BOOST: [(f64, f64); 5] =
        [(230e3, 130e3), (220e3, 150e3), (190e3, 170e3), (200e3, 180e3), (240e3, 220e3)];

    #[test]
    fn the_limit_of_a_shaft_is_above_its_least_speed() {
        let limit = |speed| limit_of_shaft(OVER_BOOST.to_vec(), speed);
        assert_eq!(limit(200e3), Some(180e3));
        assert!(limit(205e3).is_some_and(|boost| (180e3..190e3).contains(&boost)));
        assert_eq!(limit(180e3), Some(170e3), "too fast everywhere");
        assert_eq!(limit(250e3), None, "fast enough nowhere");
    }
}
