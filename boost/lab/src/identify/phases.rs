//! Phases of measured data: intervals with constant duty, supply and pump, and whether the system settles in them.

use std::ops::Range;

use serde::Serialize;

use super::Known;
use super::data::Data;
use super::statistics::{mean, root_mean_square};

/// A phase ends where the duty deviates by more than this (%) from the phase's mean.
const DUTY_STEP: f64 = 0.25;
/// A phase ends where the supply deviates by more than this (V): above its noise; it moves the valve by 1 %.
const VOLTAGE_STEP: f64 = 0.25;
/// A phase ends where rows are further apart than this (s): longer than the motion in the paper's Fig. 9.
const LONGEST_INTERVAL: f64 = 0.1;
/// The actuator's settling time (s). The paper's Fig. 9 shows some 0.2 s.
const SETTLING: f64 = 1.0;
/// The minimum number of rows at rest for a mean.
const LEAST_ROWS: usize = 10;
/// Above tank pressure by this much (Pa), the tank does not limit chamber pressure.
const ABOVE_TANK: f64 = 2000.0;
/// The largest difference of the means of both halves at rest, in standard errors.
const AT_REST: f64 = 5.0;
/// A difference always accepted (Pa): a hundredth of the accuracy of a 100 kPa sensor.
const NEGLIGIBLE: f64 = 10.0;

/// Rows between two changes, the last part at rest.
#[derive(Clone, Debug)]
pub struct Phase {
    pub rows: Range<usize>,
    /// The rows after the actuator has settled; none if it did not.
    pub rest: Option<Rest>,
    pub pump_runs: bool,
}

/// A phase's part at rest.
#[derive(Clone, Debug)]
pub struct Rest {
    pub rows: Range<usize>,
    /// The duty at nominal voltage (%).
    pub duty: f64,
    /// The mean of the chamber's pressure (Pa).
    pub chamber: f64,
    /// The mean of the position (m).
    pub position: f64,
    /// Whether the tank, rather than the valve, determines chamber pressure.
    pub is_limited_by_tank: bool,
    /// Whether the part is kept for validation.
    pub validates: bool,
}

/// The standard deviations of measurements at rest.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MeasurementNoise {
    /// The noise of the chamber's pressure (Pa).
    #[serde(rename = "actuator_pressure")]
    pub chamber: f64,
    /// The noise of the position (m).
    pub position: f64,
}

/// The mean duty of some rows, converted to nominal voltage (%), paper section 5.
pub fn plunger_duty(data: &Data, rows: Range<usize>, known: &Known) -> f64 {
    let duties = rows.map(|row| known.system.valve.commanded_duty(data.duty[row], data.voltage[row]));
    mean(&duties.collect::<Vec<_>>())
}

/// Whether an item is kept for validation: a share of them, evenly spread.
pub fn validates(index: usize, share: f64) -> bool {
    ((index + 1) as f64 * share).floor() > (index as f64 * share).floor()
}

/// Whether there are no data just before a row.
pub fn is_after_gap(data: &Data, row: usize) -> bool {
    row > 0 && data.time[row] - data.time[row - 1] > LONGEST_INTERVAL
}

/// Cuts the data into phases.
pub fn phases(data: &Data, known: &Known, validation_share: f64) -> Vec<Phase> {
    let pump_runs = |row: usize| data.pump.as_ref().is_some_and(|pump| pump[row] >= 0.5);
    let mut ranges = vec![];
    let (mut start, mut sums) = (0, [0.0; 2]);
    for row in 0..data.time.len() {
        let values = [data.duty[row], data.voltage[row]];
        let changes = |index: usize, step: f64| {
            let mean: f64 = sums[index] / (row - start) as f64;
            (values[index] - mean).abs() > step
        };
        if row > start
            && (changes(0, DUTY_STEP)
                || changes(1, VOLTAGE_STEP)
                || pump_runs(row) != pump_runs(start)
                || is_after_gap(data, row))
        {
            ranges.push(start..row);
            (start, sums) = (row, [0.0; 2]);
        }
        sums = [sums[0] + values[0], sums[1] + values[1]];
    }
    ranges.push(start..data.time.len());
    let mut at_rest = 0;
    ranges
        .into_iter()
        .map(|rows| {
            let mut rest = rest(data, known, rows.clone());
            if let Some(rest) = &mut rest {
                rest.validates = validates(at_rest, validation_share);
                at_rest += 1;
            }
            Phase { pump_runs: pump_runs(rows.start), rows, rest }
        })
        .collect()
}

fn rest(data: &Data, known: &Known, rows: Range<usize>) -> Option<Rest> {
    let settled = data.time[rows.start] + SETTLING;
    let first = rows.start + data.time[rows.clone()].partition_point(|&time| time < settled);
    let rows = first..rows.end;
    if rows.len() < LEAST_ROWS {
        return None;
    }
    let [early, late] = [rows.start..first + rows.len() / 2, first + rows.len() / 2..rows.end];
    let [before, after] = [mean(&data.chamber[early]), mean(&data.chamber[late])];
    let chamber = mean(&data.chamber[rows.clone()]);
    let scatter = root_mean_square(data.chamber[rows.clone()].iter().map(|value| value - chamber))?;
    // The standard error of the difference of two means, each over half of the rows.
    let error = 2.0 * scatter / (rows.len() as f64).sqrt();
    let tank = mean(&data.tank[rows.clone()]);
    let is_limited_by_tank = chamber < tank + ABOVE_TANK;
    if (before - after).abs() > (AT_REST * error).max(NEGLIGIBLE) && !is_limited_by_tank {
        return None;
    }
    Some(Rest {
        duty: plunger_duty(data, rows.clone(), known),
        chamber,
        position: mean(&data.position[rows.clone()]),
        is_limited_by_tank,
        validates: false,
        rows,
    })
}

/// The scatter of measurements at rest; none without such phases.
pub fn noise(data: &Data, phases: &[Phase]) -> Option<MeasurementNoise> {
    let rests =
        || phases.iter().filter_map(|phase| phase.rest.as_ref()).filter(|rest| !rest.is_limited_by_tank);
    let scatter = |values: &[f64], mean: fn(&Rest) -> f64| {
        root_mean_square(
            rests().flat_map(|rest| values[rest.rows.clone()].iter().map(move |value| value - mean(rest))),
        )
    };
    Some(MeasurementNoise {
        chamber: scatter(&data.chamber, |rest| rest.chamber)?,
        position: scatter(&data.position, |rest| rest.position)?,
    })
}
