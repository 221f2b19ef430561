//! Signals: inputs over time.

use std::f64::consts::TAU;

use anyhow::Result;
use fmu_io::document::{Node, TomlTable};
use fmu_io::terminal::number as shown;
use fmu_solve::time::rounding;

/// A value over time. Points are pairs of a time (s) and a value, sorted by time; there is at least one. Two points of
/// one time are a jump.
#[derive(Clone, Debug, PartialEq)]
pub enum Signal {
    /// One value at all times.
    Constant(f64),
    /// Each value holds from its time; the first also before.
    Steps(Vec<(f64, f64)>),
    /// Straight lines between points; before and after them, the outermost values.
    Lines(Vec<(f64, f64)>),
    /// A sine wave: mean + amplitude · sin(360° · frequency · time + phase).
    Sine {
        /// The mean, in the unit of the variable.
        mean: f64,
        /// The amplitude, in the unit of the variable.
        amplitude: f64,
        /// The frequency (Hz).
        frequency: f64,
        /// The phase at time 0 (degrees).
        phase: f64,
    },
}

impl Signal {
    /// The value at a time (s), from a jump at it on.
    ///
    /// # Panics
    /// When there are no points.
    #[must_use]
    pub fn at(&self, time: f64) -> f64 {
        self.at_within(time, rounding(time))
    }

    /// The value at a time (s), from a jump on that is no more than a difference (s) after it.
    pub(crate) fn at_within(&self, time: f64, difference: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Steps(points) => {
                let begun = points.partition_point(|&(begin, _)| begin <= time + difference);
                points[begun.saturating_sub(1)].1
            }
            Self::Lines(points) => {
                let reached = |time: f64| points.partition_point(|&(instant, _)| instant <= time);
                let (after, begun) = (reached(time), reached(time + difference));
                // Both points of a jump that rounding put just after the time.
                let after = if begun > after + 1 { begun } else { after };
                let (Some(&(t0, y0)), Some(&(t1, y1))) =
                    (points.get(after.wrapping_sub(1)), points.get(after))
                else {
                    return points[after.saturating_sub(1)].1;
                };
                (y1 - y0) / (t1 - t0) * (time.max(t0) - t0) + y0
            }
            Self::Sine { mean, amplitude, frequency, phase } => {
                mean + amplitude * (TAU * (frequency * time + phase / 360.0)).sin()
            }
        }
    }

    /// The value at a time (s), before a jump that is at it or no more than a difference (s) away.
    pub(crate) fn before(&self, time: f64, difference: f64) -> f64 {
        let (Self::Steps(points) | Self::Lines(points)) = self else { return self.at(time) };
        let after = points.partition_point(|&(instant, _)| instant < time - difference);
        let first = points[after.saturating_sub(1)];
        match (self, points.get(after)) {
            (Self::Lines(_), Some(&(t1, y1))) if after > 0 && time >= t1 => y1,
            (Self::Lines(_), Some(&(t1, y1))) if after > 0 => {
                (y1 - first.1) / (t1 - first.0) * (time - first.0) + first.1
            }
            _ => first.1,
        }
    }

    /// The times at which the signal jumps (s), in order.
    pub(crate) fn jumps(&self) -> Vec<f64> {
        let is_jump = |pair: &&[(f64, f64)]| match self {
            Self::Lines(_) => pair[0].0 >= pair[1].0,
            _ => pair[0].1.to_bits() != pair[1].1.to_bits(),
        };
        self.points().windows(2).filter(is_jump).map(|pair| pair[1].0).collect()
    }

    /// The points at which it jumps or bends, each a time (s) and a value; empty for constants and sines.
    #[must_use]
    pub fn points(&self) -> &[(f64, f64)] {
        match self {
            Self::Steps(points) | Self::Lines(points) => points,
            Self::Constant(_) | Self::Sine { .. } => &[],
        }
    }

    /// Reads a signal other than measured data; none if it is of no known kind.
    pub(super) fn read(table: &TomlTable<'_>) -> Result<Option<Self>> {
        Ok(Some(if let Some(points) = table.optional("steps") {
            Self::Steps(read_points(&points)?)
        } else if let Some(points) = table.optional("points") {
            Self::Lines(read_points(&points)?)
        } else if let Some(ramp) = table.optional("ramp") {
            read_ramp(&ramp)?
        } else if let Some(sine) = table.optional("sine") {
            read_sine(&sine)?
        } else {
            return Ok(None);
        }))
    }
}

fn read_points(node: &Node<'_>) -> Result<Vec<(f64, f64)>> {
    const PAIR: &str = "a pair [time in s, value] of numbers";
    let mut points: Vec<(f64, f64)> = vec![];
    for pair in node.list("a list of pairs [time in s, value]")? {
        let [time, value] = pair.list(PAIR)?.try_into().map_err(|_| pair.unexpected(PAIR))?;
        let point = (time.number(PAIR)?, value.number(PAIR)?);
        if let Some(&(before, _)) = points.last()
            && point.0 <= before
        {
            return Err(pair.unexpected(&format!("a time after the previous one, {} s", shown(before))));
        }
        points.push(point);
    }
    if points.is_empty() {
        return Err(node.unexpected("at least one pair [time in s, value]"));
    }
    Ok(points)
}

fn read_ramp(node: &Node<'_>) -> Result<Signal> {
    let table = node.table("a table of from, to, begin and end")?;
    let number = |key, expected| table.required(key, expected)?.number(expected);
    let from = number("from", "the value before the ramp")?;
    let to = number("to", "the value after the ramp")?;
    let begin = number("begin", "the time at which the ramp begins (s)")?;
    let end = number("end", "the time at which the ramp ends (s)")?;
    if begin >= end {
        return Err(table.location().error(format!(
            "expected an end after the begin, found {} s to {} s",
            shown(begin),
            shown(end)
        )));
    }
    table.finish()?;
    Ok(Signal::Lines(vec![(begin, from), (end, to)]))
}

fn read_sine(node: &Node<'_>) -> Result<Signal> {
    let table = node.table("a table of mean, amplitude, frequency and phase")?;
    let number = |key, expected| table.required(key, expected)?.number(expected);
    let signal = Signal::Sine {
        mean: number("mean", "the mean value")?,
        amplitude: number("amplitude", "the amplitude")?,
        frequency: number("frequency", "the frequency (Hz)")?,
        phase: table
            .optional("phase")
            .map_or(Ok(0.0), |phase| phase.number("the phase at time 0 (degrees)"))?,
    };
    table.finish()?;
    Ok(signal)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the values are exact")]
mod tests {
    use super::*;

    #[test]
    fn steps_hold_from_their_time_on() {
        let signal = Signal::Steps(vec![(0.0, 1.0), (2.0, 5.0)]);
        // The last time is slightly below 2 s, like a sum of steps.
        let values = [-1.0, 0.0, 1.999, 2.0, 9.0, 2.0 - 4e-16].map(|time| signal.at(time));
        assert_eq!(values.map(f64::to_bits), [1.0_f64, 1.0, 1.0, 5.0, 5.0, 5.0].map(f64::to_bits));
    }

    #[test]
    fn points_are_joined_by_lines() {
        let signal = Signal::Lines(vec![(0.0, 1.0), (2.0, 5.0), (4.0, 5.0)]);
        let values = [-1.0, 0.0, 0.5, 2.0, 3.0, 4.0, 9.0].map(|time| signal.at(time));
        assert_eq!(values.map(f64::to_bits), [1.0_f64, 1.0, 2.0, 5.0, 5.0, 5.0, 5.0].map(f64::to_bits));
    }

    #[test]
    fn two_points_of_one_time_are_a_jump() {
        let signal = Signal::Lines(vec![(0.0, 1.0), (2.0, 3.0), (2.0, 8.0), (4.0, 10.0)]);
        // Of the last times, one is slightly below 2 s, like a sum of steps.
        let values = [1.0, 1.5, 2.0, 3.0, 2.0 - 4e-16].map(|time| signal.at(time));
        assert_eq!(values.map(f64::to_bits), [2.0_f64, 2.5, 8.0, 9.0, 8.0].map(f64::to_bits));
    }

    #[test]
    fn jumps_have_a_value_before_them() {
        let steps = Signal::Steps(vec![(0.0, 1.0), (1.0, 1.0), (2.0, 5.0)]);
        assert_eq!(steps.jumps(), [2.0]);
        assert_eq!([1.0, 2.0, 3.0].map(|time| steps.before(time, 0.0)), [1.0, 1.0, 5.0]);
        let lines = Signal::Lines(vec![(0.0, 1.0), (2.0, 3.0), (2.0, 8.0), (4.0, 10.0)]);
        assert_eq!(lines.jumps(), [2.0]);
        assert_eq!(
            [-1.0, 0.0, 1.0, 2.0, 3.0, 5.0].map(|time| lines.before(time, 0.0)),
            [1.0, 1.0, 2.0, 3.0, 9.0, 10.0]
        );
        // Beside it by a rounding.
        for signal in [steps, lines] {
            for time in [2.0 + 1e-12, 2.0, 2.0 - 1e-12] {
                // A line rises by 1 per s.
                assert!((signal.before(time, 1e-9) - signal.before(2.0, 0.0)).abs() < 2e-12, "{time}");
            }
        }
    }

    /// Communication points, start + k · step, are rounded as the start is.
    #[test]
    fn late_points_have_the_values_of_their_jumps() {
        let start = 1.7e9;
        let steps = Signal::Steps((0..100).map(|k| (start + 0.7 * f64::from(k), f64::from(k))).collect());
        for number in 0..100 {
            // The tenth of a step, ten times as often.
            let time = start + f64::from(10 * number) * 0.07;
            assert_eq!(steps.at(time), f64::from(number), "{number}");
        }
    }

    #[test]
    fn a_sine_has_its_mean_amplitude_frequency_and_phase() {
        let signal = Signal::Sine { mean: 3.0, amplitude: 2.0, frequency: 0.25, phase: 90.0 };
        for (time, value) in [(0.0, 5.0), (1.0, 3.0), (2.0, 1.0), (4.0, 5.0)] {
            assert!((signal.at(time) - value).abs() < 1e-12, "at {time} s");
        }
    }
}
