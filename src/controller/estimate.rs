//! A measured signal without its noise: at rest from a long memory, and prompt when it changes.
//!
//! While samples agree with the estimate within their noise, each further one makes it more certain, and the memory grows
//! up to [`LONGEST_MEMORY`]. A sample farther away cannot be noise: the signal has changed, and what is older is
//! forgotten. A linear filter has one memory: as short as engine speed ramps need, noise of 10 rpm drains the vacuum; as
//! long as noise needs, ramps deviate.
//!
//! The gains are those of least squares over the memory, of a constant and of a line (Brookner, Tracking and Kalman
//! Filtering Made Easy, 1998, section 1.2.10: growing-memory filters).

use fmu_export::Persistent;

use super::variables::Real;
use crate::elementary::{larger, smaller};

/// The longest memory (s): noise of 10 rpm leaves 15 rpm/s, 1 % of a fast ramp.
const LONGEST_MEMORY: Real = 0.4;

/// How a signal is measured.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// The sample time (s).
    pub sample_time: Real,
    /// The distance between signal and measurement that noise does not exceed.
    pub noise: Real,
    /// The time (s) in which what the signal moves responds to it, and faster changes of an estimate are of no use.
    pub response: Real,
}

impl Measured {
    /// A time in samples.
    fn samples(self, time: Real) -> Real {
        time / self.sample_time
    }

    /// The longest memory (samples).
    fn longest(self) -> Real {
        larger(self.samples(LONGEST_MEMORY), 2.0)
    }

    /// The memory (samples) with one more sample.
    fn longer(self, memory: Real) -> Real {
        smaller(memory + 1.0, self.longest())
    }
}

/// A signal that is constant but for steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Level {
    value: Real,
    /// The memory in samples; none in the response time after a step, in which the sensor still moves.
    memory: Real,
}

impl Level {
    /// The level at a sample of the signal.
    pub fn sample(&mut self, measured: Measured, signal: Real) -> Real {
        let error = signal - self.value;
        self.memory = if error.abs() > measured.noise {
            1.0 - measured.samples(measured.response)
        } else {
            measured.longer(self.memory)
        };
        self.value += error / larger(self.memory, 1.0);
        self.value
    }
}

/// A signal that is a straight line but for bends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
pub struct Line {
    /// The value at the last sample; none before the first.
    value: Option<Real>,
    /// The rate of change (1/s).
    rate: Real,
    /// The memory in samples.
    memory: Real,
    /// The error of the line, filtered with the response time.
    mean_error: Real,
}

impl Line {
    /// The value and its rate of change (1/s) at a sample of the signal. The line starts level.
    pub fn sample(&mut self, measured: Measured, signal: Real) -> (Real, Real) {
        let before = self.value.unwrap_or(signal);
        let expected = before + measured.sample_time * self.rate;
        let error = signal - expected;
        // A slow bend hides in the noise of a sample, but not in the mean, whose variance is smaller by share / (2 - share).
        let share = 1.0 / larger(measured.samples(measured.response), 1.0);
        self.mean_error += share * (error - self.mean_error);
        let bends_slowly = self.memory >= measured.longest()
            && (2.0 - share) * self.mean_error * self.mean_error > share * measured.noise * measured.noise;
        self.memory = if self.value.is_none() || bends_slowly || error.abs() > measured.noise {
            self.mean_error = 0.0;
            larger(measured.samples(measured.response), 2.0)
        } else {
            measured.longer(self.memory)
        };
        let gain = 1.0 / (self.memory * (self.memory + 1.0));
        let value = expected + gain * (4.0 * self.memory - 2.0) * error;
        self.rate += gain * 6.0 * error / measured.sample_time;
        self.value = Some(value);
        (value, self.rate)
    }
}
