//! The sampling clock: sample k executes at `startTime + k · sample_time`, whatever the master's
//! communication steps are.
//!
//! Samples are counted in integers, so that they do not drift against the start time however long the
//! experiment. The master's time does drift: a master that computes communication points by `t += h` is off by up to
//! half a unit in the last place of t more after each step, some 4e-5 s after 1e5 s at 80 Hz. A sample that
//! is meant to coincide with a communication point belongs to the step that begins there, so two times
//! are treated as equal when such rounding can explain their difference.

use fmu_export::Persistent;

use crate::elementary::{larger, smaller};

/// Times that differ by less than this part of the sample time are equal, whatever the rounding.
const COINCIDENCE: f64 = 1e-6;

/// Times that differ by more than this part of the sample time are never treated as equal.
const MOST_COINCIDENCE: f64 = 0.05;

/// The clock of a sampled controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct SampleClock {
    /// How many samples have been executed; the next one has this number.
    executed: u64,
    /// The rounding error that the master's additions may have accumulated (s).
    rounding: f64,
}

impl SampleClock {
    /// Begins a communication step between two times (s). Returns the time (s) before which its samples lie.
    pub fn begin_step(&mut self, start: f64, end: f64, sample_time: f64) -> f64 {
        self.rounding += 0.5 * f64::EPSILON * larger(start.abs(), end.abs());
        // The second term covers the comparison's own rounding, at times that are far from 0.
        let coincidence = COINCIDENCE * sample_time + 2.0 * f64::EPSILON * end.abs() + self.rounding;
        end - smaller(coincidence, MOST_COINCIDENCE * sample_time)
    }

    /// The time (s) of the next sample if that is before a time (s). It counts as executed.
    pub fn next_before(&mut self, until: f64, start_time: f64, sample_time: f64) -> Option<f64> {
        let time = start_time + self.executed as f64 * sample_time;
        (time < until).then(|| {
            self.executed += 1;
            time
        })
    }

    /// How many samples have been executed, or the largest Integer.
    pub fn executed(&self) -> i32 {
        i32::try_from(self.executed).unwrap_or(i32::MAX)
    }
}
