//! Measures of records.

use anyhow::{Context, Result};

use crate::scenario::Signal;
use fmu_record::Record;

/// The tolerance of a communication point, computed as a multiple of the step (s).
const ROUNDING: f64 = 1e-6;

/// The row of a communication point.
///
/// # Errors
/// When the record has no row at this time.
pub fn row(record: &Record, time: f64) -> Result<usize> {
    let row = record.time().partition_point(|&point| point < time - ROUNDING);
    let point = record.time().get(row).filter(|&&point| (point - time).abs() <= ROUNDING);
    point.map(|_| row).with_context(|| format!("{time} s was not recorded"))
}

/// A variable's value at a communication point.
///
/// # Errors
/// When the record has no such variable, or no row at this time.
pub fn at(record: &Record, name: &str, time: f64) -> Result<f64> {
    Ok(record.get(name)?[row(record, time)?])
}

/// A variable's values between two communication points, inclusive.
///
/// # Errors
/// When the record has no such variable, or no rows at these times.
pub fn between<'a>(record: &'a Record, name: &str, from: f64, to: f64) -> Result<&'a [f64]> {
    Ok(&record.get(name)?[row(record, from)?..=row(record, to)?])
}

/// The smallest value; infinity without any.
pub fn least(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

/// The largest value; minus infinity if there are none.
pub fn greatest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The difference between the largest and the smallest value.
#[must_use]
pub fn range(values: &[f64]) -> f64 {
    greatest(values.iter().copied()) - least(values.iter().copied())
}

/// Linear interpolation between points with ascending abscissae; beyond them, the outermost values.
#[must_use]
pub fn interpolate(points: &[(f64, f64)], place: f64) -> f64 {
    Signal::Lines(points.to_vec()).at(place)
}

/// How a variable tracked the steps of its reference, in the variable's unit.
#[derive(Default)]
pub struct Following {
    /// Overshoot of each step up.
    pub up: Vec<f64>,
    /// Overshoot of each step down.
    pub down: Vec<f64>,
    /// Time to the first sample within a tenth of each step (s).
    pub rise: Vec<f64>,
    /// The error before the next step.
    pub end_error: Vec<f64>,
}

impl Following {
    /// Measures each step of a variable's reference, which end with the record. Those after its end are left out.
    ///
    /// # Errors
    /// When the record has no such variable, or no rows at these times.
    pub fn new(record: &Record, name: &str, steps: &[(f64, f64)]) -> Result<Self> {
        let mut following = Self::default();
        let last = record.time().last().copied().context("the record is empty")?;
        let ends = steps.iter().skip(2).map(|step| step.0).chain([last]);
        for (pair, end) in steps.windows(2).zip(ends) {
            let [(_, before), (begin, after)] = *pair else { continue };
            if begin > last + ROUNDING {
                break;
            }
            let values = between(record, name, begin, end.min(last))?;
            let overshoot = if after > before {
                let overshoot = greatest(values.iter().copied()) - after;
                following.up.push(overshoot);
                overshoot
            } else {
                let overshoot = after - least(values.iter().copied());
                following.down.push(overshoot);
                overshoot
            };
            anyhow::ensure!(overshoot.is_finite(), "{name} is not a number");
            let reached =
                values.iter().position(|value| (value - after).abs() <= 0.1 * (after - before).abs());
            let first = row(record, begin)?;
            following.rise.push(reached.map_or(f64::INFINITY, |index| record.time()[first + index] - begin));
            following.end_error.push((values[values.len() - 1] - after).abs());
        }
        Ok(following)
    }
}
