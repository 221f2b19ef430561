//! When two times are the same. Whatever compares a given time with one that is reached, announced or counted asks here.
//!
//! An importer computes its communication points in one of three ways: k·h, start + k·h, or by adding up steps, t += h.
//! The first two differ by some [roundings](rounding) from what they mean. The third one strays further with each step,
//! which the steps show: [`Ahead`] measures it, so that a point of such an importer is known for what it means, and that
//! of another is not blurred.

/// The times of one instant differ by at most this many relative roundings: each is a sum of a start and a product of
/// two factors, one of which is rounded (3/2), and a step's end is one more sum.
const ROUNDINGS: f64 = 4.0;
/// The most relative roundings of a time without a step's size, which may be the sum of some steps.
const SUMMED: f64 = 64.0;
/// The tolerance of a step's start relative to its size: some importers count nanoseconds.
const START: f64 = 1e-6;
/// An importer whose clock is further ahead, relative to its step, is taken at its word.
const MOST_AHEAD: f64 = 0.05;

/// The difference (s) within which a time is the same as another that was computed from the same numbers.
#[must_use]
pub fn rounding(time: f64) -> f64 {
    ROUNDINGS * f64::EPSILON * time.abs()
}

/// The difference (s) within which a time is the same as one that an importer gives without a step's size.
#[must_use]
pub fn summed_rounding(time: f64) -> f64 {
    SUMMED * f64::EPSILON * time.abs()
}

/// The difference (s) within which an event that an FMU of any maker announces is at a communication point (s), between
/// steps of a size (s): FMUs, too, sum their times.
#[must_use]
pub fn coincidence(size: f64, point: f64) -> f64 {
    START * size + summed_rounding(point)
}

/// How much of a difference (s) counts for an event so long after the last one (s): a time between the two is that of the
/// nearer one.
#[must_use]
pub fn nearer(difference: f64, distance: f64) -> f64 {
    let half = 0.5 * distance;
    if difference < half { difference } else { half }
}

/// Whether a step of a size (s) that begins at `start` goes on from the time `reached`, both in s.
#[must_use]
pub fn goes_on(reached: f64, start: f64, size: f64) -> bool {
    (start - reached).abs() <= START * size + summed_rounding(reached)
}

/// Whether a step of a size (s) to `end` goes no further than `last`, both in s.
#[must_use]
pub fn ends_by(last: f64, end: f64, size: f64) -> bool {
    end <= last + START * size + summed_rounding(last)
}

/// By how many seconds an importer's clock is ahead of the sum of its steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ahead {
    seconds: f64,
}

crate::persistent!(Ahead { seconds });

impl Ahead {
    /// The lead at the start (s) of a step from the time reached (s): none if the step begins elsewhere, as it is no
    /// sum of the steps before.
    #[must_use]
    pub fn at_start(self, reached: f64, start: f64) -> Self {
        if start.to_bits() == reached.to_bits() { self } else { Self::default() }
    }

    /// The lead after a step from a start by a size, both in s.
    #[must_use]
    pub fn after(self, start: f64, size: f64) -> Self {
        // The rounding of the sum, exactly if the start is not smaller than the size (Dekker, A floating-point technique
        // for extending the available precision, 1971).
        Self { seconds: self.seconds + ((start + size - start) - size) }
    }

    /// What the importer means by a time (s).
    #[must_use]
    pub fn meant(self, time: f64) -> f64 {
        time - self.seconds
    }
}

/// The end of a communication step, and the times that are the same.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// The end in s.
    pub time: f64,
    rounding: f64,
    /// How far the importer's clock is ahead (s).
    ahead: f64,
}

impl End {
    /// The end of an importer's step from a start by a size, both in s, whose events FMUs of any maker announce.
    #[must_use]
    pub fn of_any(start: f64, size: f64) -> Self {
        let time = start + size;
        Self { time, rounding: coincidence(size, time), ahead: 0.0 }
    }

    /// The end of a step from a start by a size, with the importer's clock at its end, in an experiment since a time,
    /// all in s: since + k·h rounds as the larger of both ends does, even where it passes zero.
    #[must_use]
    pub fn of_sum((start, size): (f64, f64), Ahead { seconds }: Ahead, since: f64) -> Self {
        let (time, since) = (start + size, since.abs());
        let is_ahead = seconds > 0.0 && seconds <= MOST_AHEAD * size;
        Self {
            time,
            rounding: rounding(if time.abs() > since { time } else { since }),
            ahead: if is_ahead { seconds } else { 0.0 },
        }
    }

    /// The difference (s) within which a time is the same.
    #[must_use]
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// Before which time (s) an event so long after the last one (s) is before the end.
    #[must_use]
    pub fn begin(&self, distance: f64) -> f64 {
        self.time - self.ahead - nearer(self.rounding, distance)
    }

    /// Whether an event at a time (s), after one at `last`, is before the end.
    #[must_use]
    pub fn is_after(&self, event: f64, last: f64) -> bool {
        event < self.begin(event - last)
    }

    /// Whether an event at a time (s), after one at `last`, is before the end or at it.
    #[must_use]
    pub fn has(&self, event: f64, last: f64) -> bool {
        event <= self.time + nearer(self.rounding, event - last)
    }
}
