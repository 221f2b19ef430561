//! The gain schedules: tables over boost pressure (rows) and engine speed (columns), interpolated
//! bilinearly and clamped at their edges.
//!
//! The paper linearises the engine "across different desired boost pressures and engine speeds" and identifies, at each
//! point, the first-order system with time delay of eq. (10). The feedforward's static map shares the grid, so a
//! position is searched once for all tables.

use fmu_export::Error;

use super::compensator::Limits;
use super::variables::{RangeScheduleParameters, Real, ScheduleParameters};
use crate::elementary::{between, larger, smaller};

/// The number of boost pressures of a schedule.
const ROWS: usize = 16;

/// A strategy's maps over a common grid.
#[derive(Clone, Copy, Debug)]
pub struct Schedule<'a, const COLUMNS: usize> {
    engine_speed: &'a [Real; COLUMNS],
    boost_pressure: &'a [Real; ROWS],
    duty: &'a [[Real; COLUMNS]; ROWS],
    gain: &'a [[Real; COLUMNS]; ROWS],
    time_constant: &'a [[Real; COLUMNS]; ROWS],
    delay: &'a [[Real; COLUMNS]; ROWS],
}

impl<'a> From<&'a ScheduleParameters> for Schedule<'a, 7> {
    fn from(parameters: &'a ScheduleParameters) -> Self {
        Self {
            engine_speed: &parameters.engine_speed,
            boost_pressure: &parameters.boost_reference,
            duty: &parameters.feedforward,
            gain: &parameters.gain,
            time_constant: &parameters.time_constant,
            delay: &parameters.delay,
        }
    }
}

impl<'a> From<&'a RangeScheduleParameters> for Schedule<'a, 12> {
    fn from(parameters: &'a RangeScheduleParameters) -> Self {
        Self {
            engine_speed: &parameters.engine_speed,
            boost_pressure: &parameters.boost_reference,
            duty: &parameters.virtual_duty,
            gain: &parameters.gain,
            time_constant: &parameters.time_constant,
            delay: &parameters.delay,
        }
    }
}

/// The engine near an operating point, as the controller sees it: paper, eq. (10),
/// `G(s) = K_p / (1 + T_tf s) · e^(-L s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalModel {
    /// `K_p`: the static gain from duty at nominal voltage to boost pressure (Pa/%).
    pub gain: Real,
    /// `T_tf` (s).
    pub time_constant: Real,
    /// L (s).
    pub delay: Real,
}

/// A position on a grid axis, between a grid point and the next.
#[derive(Clone, Copy, Debug, PartialEq)]
struct GridPosition {
    /// The grid point below; not the last one.
    below: usize,
    /// The fraction of the interval to the next one: 0 to 1.
    fraction: Real,
}

/// The elements at a grid point that is not the last one, and at the next. An ECU must not panic: the index is within
/// bounds for the compiler, too.
#[inline]
fn pair<T, const POINTS: usize>(values: &[T; POINTS], below: usize) -> [&T; 2] {
    let below = below.min(POINTS - 2);
    [&values[below], &values[below + 1]]
}

impl GridPosition {
    /// The position of a value on an axis of at least two points, clamped at the edges.
    #[inline]
    fn on<const POINTS: usize>(axis: &[Real; POINTS], value: Real) -> Self {
        // Linear search: the axes are short and the position rarely changes, so branch prediction works well.
        let mut below = 0;
        while below + 2 < POINTS && axis[below + 1] <= value {
            below += 1;
        }
        let [&before, &after] = pair(axis, below);
        let width = after - before;
        // A non-increasing axis is rejected before the first step, but initialization must get that far without
        // dividing by zero.
        let fraction = if width > 0.0 { ((value - before) / width).clamp(0.0, 1.0) } else { 0.0 };
        Self { below, fraction }
    }
}

/// Linear interpolation over one axis, clamped at its edges.
#[must_use]
pub fn interpolate<const POINTS: usize>(axis: &[Real; POINTS], values: &[Real; POINTS], at: Real) -> Real {
    let GridPosition { below, fraction } = GridPosition::on(axis, at);
    let [&before, &after] = pair(values, below);
    (1.0 - fraction) * before + fraction * after
}

/// An operating point in a schedule.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint<'a, const COLUMNS: usize> {
    schedule: Schedule<'a, COLUMNS>,
    row: GridPosition,
    column: GridPosition,
    /// The weights of the four surrounding grid points: the row below, then the next row.
    weights: [Real; 4],
    /// The factor of time constants.
    time_scale: Real,
    /// What is added to the schedule's delays (s).
    lag: Real,
}

impl<'a, const COLUMNS: usize> OperatingPoint<'a, COLUMNS> {
    /// The operating point of a boost pressure (Pa) at an engine speed (rpm).
    #[must_use]
    #[inline]
    pub fn new(schedule: impl Into<Schedule<'a, COLUMNS>>, boost_pressure: Real, engine_speed: Real) -> Self {
        let schedule = schedule.into();
        Self::at(schedule, boost_pressure, GridPosition::on(schedule.engine_speed, engine_speed))
    }

    #[inline]
    fn at(schedule: Schedule<'a, COLUMNS>, boost_pressure: Real, column: GridPosition) -> Self {
        let row = GridPosition::on(schedule.boost_pressure, boost_pressure);
        let (y, x) = (row.fraction, column.fraction);
        let weights = [(1.0 - y) * (1.0 - x), (1.0 - y) * x, y * (1.0 - x), y * x];
        Self { schedule, row, column, weights, time_scale: 1.0, lag: 0.0 }
    }

    /// The operating point with time constants longer by a factor, and delays by a lag (s).
    #[must_use]
    pub fn slower(self, time_scale: Real, lag: Real) -> Self {
        Self { time_scale, lag, ..self }
    }

    /// The operating point of another boost pressure (Pa) at the same engine speed.
    #[must_use]
    #[inline]
    pub fn at_pressure(self, boost_pressure: Real) -> Self {
        Self::at(self.schedule, boost_pressure, self.column).slower(self.time_scale, self.lag)
    }

    /// The duty at nominal voltage (%) that holds the boost pressure at rest: the static map of the
    /// paper's fig. 12.
    #[must_use]
    #[inline]
    pub fn feedforward(self) -> Real {
        self.interpolate(self.schedule.duty)
    }

    /// The duty (%) that holds another boost pressure (Pa) at the same engine speed, extrapolated beyond the rows with
    /// the gain at the edge.
    #[must_use]
    pub fn extrapolated_feedforward(self, boost_pressure: Real) -> Real {
        let [first, .., last] = *self.schedule.boost_pressure;
        let here = self.at_pressure(boost_pressure);
        let beyond = boost_pressure - smaller(larger(boost_pressure, first), last);
        here.feedforward() + beyond / here.interpolate(self.schedule.gain)
    }

    /// The range of a correction of the duty (%) that moves boost at rest from a pressure by at most another (Pa).
    #[must_use]
    pub fn correction(self, boost_pressure: Real, most: Real) -> Limits {
        let at = |pressure| self.extrapolated_feedforward(pressure);
        let held = at(boost_pressure);
        Limits { least: at(boost_pressure + most) - held, most: at(boost_pressure - most) - held }
    }

    /// The boost pressure (Pa) that a duty (%) holds at rest at the same engine speed: the inverse map. A duty beyond
    /// the map or in its filled, unreachable part gives the pressure at the edge.
    #[must_use]
    pub fn pressure_held_by(self, duty: Real) -> Real {
        let rows = self.schedule.boost_pressure;
        let (column, share) = (self.column.below, self.column.fraction);
        let duty_of = |duties: &[Real; COLUMNS]| {
            let [&left, &right] = pair(duties, column);
            between(left, right, share)
        };
        let least = larger(duty, duty_of(&self.schedule.duty[ROWS - 1]));
        let first = duty_of(&self.schedule.duty[0]);
        if first <= least {
            return rows[0];
        }
        let (mut below, mut duty_below, mut duty_above) = (0, first, duty_of(&self.schedule.duty[1]));
        while duty_above > least && below + 2 < ROWS {
            below += 1;
            duty_below = duty_above;
            duty_above = duty_of(&self.schedule.duty[below + 1]);
        }
        let share = (duty_below - least) / (duty_below - duty_above);
        let [&before, &after] = pair(rows, below);
        before + share.clamp(0.0, 1.0) * (after - before)
    }

    /// The engine near this point.
    #[must_use]
    #[inline]
    pub fn local_model(self) -> LocalModel {
        LocalModel {
            gain: self.interpolate(self.schedule.gain),
            time_constant: self.time_scale * self.interpolate(self.schedule.time_constant),
            delay: self.interpolate(self.schedule.delay) + self.lag,
        }
    }

    /// The share of the way to the schedule's pressure that an engine goes in a sample (s).
    #[must_use]
    pub fn share_of_lag(self, sample_time: Real) -> Real {
        let local = self.local_model();
        sample_time / larger(local.time_constant + local.delay, sample_time)
    }

    /// The value of a table over the schedule's grid.
    #[must_use]
    #[inline]
    pub fn interpolate(self, table: &[[Real; COLUMNS]; ROWS]) -> Real {
        let (row, column) = (self.row.below, self.column.below);
        let [below, next] = pair(table, row).map(|row| pair(row, column).map(|&value| value));
        let [a, b, c, d] = self.weights;
        (a * below[0] + b * below[1]) + (c * next[0] + d * next[1])
    }
}

/// The smallest magnitude of a gain (Pa/%) distinguished from 0. The feedback divides by the gain: below this, 1 kPa of
/// error would demand a million percent of duty.
const LEAST_GAIN: Real = 1e-3;

/// Rejects a non-increasing grid, and gains that are 0 or change sign, since interpolation would pass through 0.
///
/// # Errors
/// Names the elements, of the component with that name, and their values.
pub fn check<'a, const COLUMNS: usize>(
    component: &str,
    schedule: impl Into<Schedule<'a, COLUMNS>>,
) -> Result<(), Error> {
    let schedule = schedule.into();
    refuse_not_increasing(component, "engine_speed", schedule.engine_speed)?;
    refuse_not_increasing(component, "boost_reference", schedule.boost_pressure)?;
    let first = schedule.gain[0][0];
    for (row, gains) in schedule.gain.iter().enumerate() {
        for (column, &gain) in gains.iter().enumerate() {
            let name = format_args!("{component}.gain[{},{}]", row + 1, column + 1);
            if gain.abs() < LEAST_GAIN {
                return Err(Error::new(format_args!(
                    "{name} is {gain} Pa/%, but the feedback divides by it: its magnitude must be at least {LEAST_GAIN} Pa/%"
                )));
            }
            if gain.signum() != first.signum() {
                return Err(Error::new(format_args!(
                    "{component}.gain[1,1] is {first} Pa/% and {name} is {gain} Pa/%, but all gains must have the same sign: between them the gain would be 0"
                )));
            }
        }
    }
    Ok(())
}

fn refuse_not_increasing(component: &str, name: &str, axis: &[Real]) -> Result<(), Error> {
    let mut pairs = (1..).zip(axis.iter().zip(axis.iter().skip(1)));
    pairs.find(|(_, (below, above))| below >= above).map_or(Ok(()), |(number, (below, above))| {
        Err(Error::new(format_args!(
            "{component}.{name}[{number}] is {below} and {component}.{name}[{}] is {above}, but the grid must increase",
            number + 1
        )))
    })
}
