//! The gain schedule: tables over boost pressure (rows) and engine speed (columns), interpolated
//! bilinearly and clamped at their edges.
//!
//! The paper linearises the engine "across different desired boost pressures and engine speeds" and
//! identifies, in each point, the first-order system with time delay of eq. (10). The static map of the
//! feedforward lies on the same grid, so that a place in it is searched once for all tables.

use fmu_export::Error;

use super::variables::ScheduleParameters;

/// The engine near an operating point, as the controller sees it: paper, eq. (10),
/// `G(s) = K_p / (1 + T_tf s) · e^(-L s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalModel {
    /// `K_p`: what 1 % of duty at nominal voltage does to the boost pressure at rest (Pa/%).
    pub gain: f64,
    /// `T_tf` (s).
    pub time_constant: f64,
    /// L (s).
    pub delay: f64,
}

/// A place on one axis of a grid: between a grid point and the next.
#[derive(Clone, Copy, Debug, PartialEq)]
struct GridPosition {
    /// The grid point below.
    below: usize,
    /// The fraction of the interval to the next one: 0 to 1.
    fraction: f64,
}

impl GridPosition {
    /// The place of a value on an axis of at least two points; that of the edge for one outside.
    #[inline]
    fn on<const POINTS: usize>(axis: &[f64; POINTS], value: f64) -> Self {
        // One point after the other: the axes are short, and the place seldom moves on, so that the processor
        // foresees where this ends and nothing waits for it.
        let mut below = 0;
        while below + 2 < POINTS && axis[below + 1] <= value {
            below += 1;
        }
        let width = axis[below + 1] - axis[below];
        // An axis that does not increase is refused before the first step, but initialization must get
        // as far as that without dividing by zero.
        let fraction = if width > 0.0 { ((value - axis[below]) / width).clamp(0.0, 1.0) } else { 0.0 };
        Self { below, fraction }
    }
}

/// An operating point in the schedule.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint<'a> {
    schedule: &'a ScheduleParameters,
    row: GridPosition,
    column: GridPosition,
    /// How much each of the four grid points around it counts: those of the row below, then those of the
    /// next row.
    weights: [f64; 4],
}

impl<'a> OperatingPoint<'a> {
    /// The operating point of a boost pressure (Pa) at an engine speed (rpm).
    #[must_use]
    #[inline]
    pub fn new(schedule: &'a ScheduleParameters, boost_pressure: f64, engine_speed: f64) -> Self {
        Self::at(schedule, boost_pressure, GridPosition::on(&schedule.engine_speed, engine_speed))
    }

    #[inline]
    fn at(schedule: &'a ScheduleParameters, boost_pressure: f64, column: GridPosition) -> Self {
        let row = GridPosition::on(&schedule.boost_reference, boost_pressure);
        let (y, x) = (row.fraction, column.fraction);
        let weights = [(1.0 - y) * (1.0 - x), (1.0 - y) * x, y * (1.0 - x), y * x];
        Self { schedule, row, column, weights }
    }

    /// The operating point of another boost pressure (Pa) at the same engine speed.
    #[must_use]
    #[inline]
    pub fn at_pressure(self, boost_pressure: f64) -> Self {
        Self::at(self.schedule, boost_pressure, self.column)
    }

    /// The duty at nominal voltage (%) that holds the boost pressure at rest: the static map of the
    /// paper's fig. 12.
    #[must_use]
    #[inline]
    pub fn feedforward(self) -> f64 {
        self.interpolate(&self.schedule.feedforward)
    }

    /// The engine near this point.
    #[must_use]
    #[inline]
    pub fn local_model(self) -> LocalModel {
        LocalModel {
            gain: self.interpolate(&self.schedule.gain),
            time_constant: self.interpolate(&self.schedule.time_constant),
            delay: self.interpolate(&self.schedule.delay),
        }
    }

    #[inline]
    fn interpolate<const ROWS: usize, const COLUMNS: usize>(self, table: &[[f64; COLUMNS]; ROWS]) -> f64 {
        let (below, next) = (&table[self.row.below], &table[self.row.below + 1]);
        let (left, right) = (self.column.below, self.column.below + 1);
        let [a, b, c, d] = self.weights;
        (a * below[left] + b * below[right]) + (c * next[left] + d * next[right])
    }
}

/// The smallest magnitude of a gain (Pa/%) that is distinguished from 0. The feedback divides by the gain: below
/// this, 1 kPa of error would ask for a million percent of duty.
const LEAST_GAIN: f64 = 1e-3;

/// Refuses a grid that does not increase, and gains that are or pass through 0: between two gains of
/// opposite sign the interpolated one does.
///
/// # Errors
/// Names the elements and their values.
pub fn check(schedule: &ScheduleParameters) -> Result<(), Error> {
    refuse_not_increasing("schedule.engine_speed", &schedule.engine_speed)?;
    refuse_not_increasing("schedule.boost_reference", &schedule.boost_reference)?;
    let first = schedule.gain[0][0];
    for (row, gains) in schedule.gain.iter().enumerate() {
        for (column, &gain) in gains.iter().enumerate() {
            let name = format_args!("schedule.gain[{},{}]", row + 1, column + 1);
            if gain.abs() < LEAST_GAIN {
                return Err(Error::new(format!(
                    "{name} is {gain} Pa/%, but the feedback divides by the gain: it must not be 0 (at least {LEAST_GAIN} Pa/% in magnitude)"
                )));
            }
            if gain.signum() != first.signum() {
                return Err(Error::new(format!(
                    "schedule.gain[1,1] is {first} Pa/% and {name} is {gain} Pa/%, but gains must be of one sign: between them the gain would be 0"
                )));
            }
        }
    }
    Ok(())
}

fn refuse_not_increasing(name: &str, axis: &[f64]) -> Result<(), Error> {
    match axis.windows(2).position(|pair| pair[0] >= pair[1]) {
        None => Ok(()),
        Some(below) => Err(Error::new(format!(
            "{name}[{}] is {} and {name}[{}] is {}, but a grid must increase",
            below + 1,
            axis[below],
            below + 2,
            axis[below + 1]
        ))),
    }
}
