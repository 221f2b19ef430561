//! The clocks of FMI 3.0 (FMI 3.0.2, section 2.2.8), as a model sees them among its variables.

use fmu_solve::Error;
use fmu_solve::display::Shown;

use crate::model::description::{IntervalVariability, Name};

/// A clock: whether it ticks now and, if the model determines it, when it ticks next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    pub(crate) ticks: bool,
    /// For a time-based clock, in s: the time between two ticks, or, if it is aperiodic, until the next tick.
    interval: Option<f64>,
    /// For a periodic clock, in s: the time from the start to the first tick.
    pub(crate) shift: f64,
    /// Whether the model has set the interval since the importer last read it.
    pub(crate) is_new: bool,
    /// The interval last reported to the importer.
    told: Option<f64>,
    /// Whether the clock has ticked since Event Mode was entered.
    pub(crate) has_ticked: bool,
    /// In Scheduled Execution, the time of the last tick in s.
    pub(crate) activated: Option<f64>,
    /// How many samples the clock has activated.
    samples: u64,
}

crate::persistent!(Clock { ticks, interval, shift, is_new, told, has_ticked, activated, samples });

/// The state of a reported interval: `fmi3IntervalQualifier`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub(crate) enum IntervalQualifier {
    NotYetKnown = 0,
    Unchanged = 1,
    Changed = 2,
}

impl Clock {
    /// A clock with an interval and a shift in s, as declared.
    #[doc(hidden)]
    #[must_use]
    pub fn periodic(interval: f64, shift: f64) -> Self {
        Self { interval: Some(interval), shift, ..Self::default() }
    }

    /// Whether the clock ticks now. Only one input clock ticks at a time.
    #[must_use]
    pub fn ticks(&self) -> bool {
        self.ticks
    }

    /// Makes an output or local clock tick, which is reported to the importer.
    pub fn tick(&mut self) {
        self.ticks = true;
    }

    /// The interval in s, if known.
    #[must_use]
    pub fn interval(&self) -> Option<f64> {
        self.interval
    }

    /// Sets the interval in s: for a periodic clock, the interval that parameters determine; otherwise from now to the
    /// next tick.
    pub fn set_interval(&mut self, interval: f64) {
        self.interval = Some(interval);
        self.is_new = true;
    }

    /// The time from the start to the first tick of a periodic clock, in s.
    #[must_use]
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// Sets the time from the start to the first tick of a periodic clock, in s, if parameters determine it.
    pub fn set_shift(&mut self, shift: f64) {
        self.shift = shift;
    }

    /// Begins a tick, after which an aperiodic clock has a new interval.
    pub(crate) fn begin_tick(&mut self, kind: IntervalVariability) {
        self.ticks = true;
        if !kind.is_periodic() {
            self.interval = None;
            self.is_new = false;
        }
    }

    /// The time of the clock's next sample in s, if the interval does not change.
    pub(crate) fn next(&self, start_time: f64) -> Option<f64> {
        Some(start_time + self.shift + self.samples as f64 * self.interval?)
    }

    /// Counts from 0 again.
    pub(crate) fn restart(&mut self) {
        self.samples = 0;
    }

    /// Counts a sample. Returns its number, from 0.
    pub(crate) fn count(&mut self) -> u64 {
        let number = self.samples;
        self.samples += 1;
        number
    }

    /// The interval in s, unless the model has not set it or it is invalid.
    pub(crate) fn checked_interval(&self, name: Name, kind: IntervalVariability) -> Result<f64, Error> {
        let Some(interval) = self.interval else {
            return Err(Error::new(format_args!("the model has not set the interval of the clock {name}")));
        };
        check_time("interval", name, interval, interval > 0.0 || interval >= 0.0 && !kind.is_periodic())?;
        Ok(interval)
    }

    /// The shift in s, unless it is invalid.
    pub(crate) fn checked_shift(&self, name: Name) -> Result<f64, Error> {
        check_time("shift", name, self.shift, self.shift >= 0.0)?;
        Ok(self.shift)
    }

    /// Reports the interval to the importer, and how it relates to the last report.
    pub(crate) fn tell(&mut self, kind: IntervalVariability) -> IntervalQualifier {
        let Some(interval) = self.interval else { return IntervalQualifier::NotYetKnown };
        let told = self.told.replace(interval);
        let is_new = core::mem::take(&mut self.is_new);
        let has_changed =
            if kind.is_periodic() { told.map(f64::to_bits) != Some(interval.to_bits()) } else { is_new };
        if has_changed { IntervalQualifier::Changed } else { IntervalQualifier::Unchanged }
    }
}

/// Rejects invalid clock times.
pub(crate) fn check_time(what: &str, name: Name, time: f64, is_allowed: bool) -> Result<(), Error> {
    if is_allowed && time.is_finite() {
        Ok(())
    } else {
        Err(Error::new(format_args!("{} s for the {what} of the clock {name}", Shown(time))))
    }
}
