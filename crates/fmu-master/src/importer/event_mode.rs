//! Event Mode: time events and clocks, in Model Exchange and in co-simulation of FMI 3.0.

use std::ffi::c_int;
use std::rc::Rc;

use anyhow::{Result, bail};
use fmu_abi::fmi2::c_types::ValueReference;
use fmu_io::terminal::number;
use fmu_solve::display::Seconds;
use fmu_solve::time::coincidence;
use fmu_solve::{MOST_ITERATIONS, endless};
use fmu_terms::IntervalVariability;

use super::c_boundary::{Clocks, EventHandling};
use super::calls::Calls;
use super::fmu::{input_clocks, reference};
use super::stepping::Stepping;

/// `fmi3IntervalChanged`.
const CHANGED: c_int = 2;

/// The times of an instance's events, and whether it is in Event Mode.
#[derive(Clone)]
pub struct EventMode {
    handle: Rc<dyn EventHandling>,
    phase: Phase,
    /// The time of the FMU's next time event (s).
    announced: Option<f64>,
    /// The time of the last event (s).
    last: f64,
    /// Whether the last step has ended with an event.
    has_event: bool,
    clocks: Vec<InputClock>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Initialization,
    EventMode,
    BetweenEvents,
}

/// A time-based clock, which ticks when its time has come. Triggered clocks do not tick, because nothing here triggers
/// them.
#[derive(Clone)]
struct InputClock {
    handle: Rc<dyn Clocks>,
    name: String,
    reference: ValueReference,
    timing: Timing,
    /// The time from which ticks are counted (s), and the ticks since.
    origin: f64,
    ticks: f64,
    /// The interval between ticks (s).
    interval: f64,
    /// The next tick (s).
    next: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Timing {
    /// The clock ticks at equal intervals.
    Periodic,
    /// The clock ticks at intervals that the FMU may change.
    Changing,
    /// The clock ticks once, when the FMU has given an interval.
    Countdown,
}

impl EventMode {
    /// # Errors
    /// When the value reference of a clock is not a number.
    pub fn new(calls: &Calls, handle: Rc<dyn EventHandling>) -> Result<Self> {
        let mut clocks = vec![];
        for clock in input_clocks(calls.fmu.description()) {
            let Some(handle) = Rc::clone(&handle).clocks() else { break };
            let timing = match clock.interval_variability.meaning() {
                Some(IntervalVariability::Constant | IntervalVariability::Fixed) => Timing::Periodic,
                Some(IntervalVariability::Tunable | IntervalVariability::Changing) => Timing::Changing,
                Some(IntervalVariability::Countdown) => Timing::Countdown,
                _ => continue,
            };
            let reference = reference(clock)?;
            let name = clock.name.clone();
            clocks.push(InputClock {
                handle,
                name,
                reference,
                timing,
                origin: 0.0,
                ticks: 0.0,
                interval: 0.0,
                next: None,
            });
        }
        Ok(Self {
            handle,
            phase: Phase::Initialization,
            announced: None,
            last: f64::NEG_INFINITY,
            has_event: false,
            clocks,
        })
    }

    /// Reads when periodic clocks tick; called in Initialization Mode, at its time (s).
    pub fn initialize(&mut self, calls: &mut Calls, time: f64) -> Result<()> {
        for clock in self.clocks.iter_mut().filter(|clock| clock.timing != Timing::Countdown) {
            let (called, interval, _) = clock.handle.interval(clock.reference);
            calls.check(&[], called)?;
            let (called, shift) = clock.handle.shift(clock.reference);
            calls.check(&[], called)?;
            clock.check(calls, interval)?;
            if !(shift >= 0.0 && shift.is_finite()) {
                bail!("{}: the clock {} has the shift {} s", calls.name, clock.name, number(shift));
            }
            (clock.origin, clock.interval, clock.next) = (time + shift, interval, Some(time + shift));
        }
        Ok(())
    }

    /// The time of the last event (s).
    pub fn last(&self) -> f64 {
        self.last
    }

    /// Begins in Event Mode, in which the initialization leaves the instance.
    pub fn begin(&mut self) {
        self.phase = Phase::EventMode;
    }

    /// Whether the instance is in Event Mode: inputs may have changed.
    pub fn is_entered(&self) -> bool {
        self.phase == Phase::EventMode
    }

    /// When the next event is due (s).
    pub fn next(&self) -> Option<f64> {
        let clocks = self.clocks.iter().filter_map(|clock| clock.next);
        clocks.chain(self.announced).min_by(f64::total_cmp)
    }

    /// Whether there are events until a time (s), or changed inputs.
    pub fn is_due(&self, until: f64) -> bool {
        self.is_entered() || self.has_due(until)
    }

    /// Whether there are events until a time (s).
    pub fn has_due(&self, until: f64) -> bool {
        self.has_event || self.next().is_some_and(|due| due <= until)
    }

    /// The time of the events at a communication point (s), which are until a time (s).
    pub fn time_at(&self, point: f64, until: f64) -> f64 {
        self.next().filter(|due| point < *due && *due <= until).unwrap_or(point)
    }

    /// Enters Event Mode after initialization.
    pub fn enter(&mut self, calls: &mut Calls) -> Result<()> {
        if self.phase != Phase::BetweenEvents {
            return Ok(());
        }
        let called = self.handle.enter_event_mode();
        calls.check(&[], called)?;
        self.phase = Phase::EventMode;
        Ok(())
    }

    /// Handles the events at a time (s), including clocks that are due up to `late` (s) after it, and leaves Event
    /// Mode; if they are watched, the variables are read before and after. In an instance that was in Event Mode before,
    /// only inputs have changed, or it has just been initialized.
    pub fn handle(&mut self, calls: &mut Calls, (time, late): (f64, f64), is_watched: bool) -> Result<()> {
        if is_watched {
            calls.watch_event(time, false)?;
        }
        self.enter(calls)?;
        self.last = time;
        self.has_event = false;
        calls.begin_stretch(time)?;
        for _ in 0..MOST_ITERATIONS {
            for clock in self.clocks.iter_mut().filter(|clock| clock.is_due(time + late)) {
                let called = clock.handle.tick(clock.reference);
                calls.check(&[], called)?;
                clock.has_ticked(time);
            }
            let (called, discrete) = self.handle.update_discrete_states();
            calls.check(&[], called)?;
            if discrete.terminates {
                return calls.end(time);
            }
            self.announced = discrete.next_event.filter(|next| next.is_finite());
            if discrete.needs_update {
                continue;
            }
            for clock in self.clocks.iter_mut().filter(|clock| clock.timing != Timing::Periodic) {
                let (called, interval, qualifier) = clock.handle.interval(clock.reference);
                calls.check(&[], called)?;
                if qualifier == CHANGED {
                    clock.check(calls, interval)?;
                    clock.interval = interval;
                    clock.next = match clock.timing {
                        Timing::Countdown => Some(time + interval),
                        _ if clock.ticks > 0.0 => Some(clock.origin + interval),
                        _ => clock.next,
                    };
                }
            }
            if !self.clocks.iter().any(|clock| clock.is_due(time + late)) {
                let called = self.handle.leave_event_mode();
                calls.check(&[], called)?;
                self.phase = Phase::BetweenEvents;
                return if is_watched { calls.watch_event(time, true) } else { Ok(()) };
            }
        }
        let endless = endless(time, "discrete states still change, or clocks tick");
        bail!("{}: {endless}", calls.name);
    }

    /// Steps an FMU for co-simulation from a time (s) by a size (s), and handles its events before the end.
    pub fn co_simulate(
        &mut self,
        calls: &mut Calls,
        stepping: &mut Stepping,
        start: f64,
        size: f64,
    ) -> Result<()> {
        let end = start + size;
        let mut time = start;
        if self.is_entered() {
            self.handle(calls, (time, 0.0), false)?;
        }
        let late = coincidence(size, end);
        let mut returns = 0;
        while time < end {
            let next = self.next().filter(|due| time < *due && *due < end - late).unwrap_or(end);
            let step = stepping.step(calls, time, next - time)?;
            let reached = step.early_return.unwrap_or(next);
            returns = if reached > time + late { 0 } else { returns + 1 };
            if returns > MOST_ITERATIONS {
                bail!(
                    "{}: the step from {} s does not end: it has returned early {MOST_ITERATIONS} times at {} s",
                    calls.name,
                    Seconds(start),
                    Seconds(reached)
                );
            }
            time = reached;
            self.has_event = step.has_event;
            if time < end && self.has_due(time + late) {
                self.handle(calls, (time, late), true)?;
            }
        }
        Ok(())
    }
}

impl InputClock {
    /// Refuses an interval (s) that is not finite and above 0; that of a clock that is not periodic may be 0
    /// (modelica/fmi-standard, pull request 1937).
    fn check(&self, calls: &Calls, interval: f64) -> Result<()> {
        let is_possible = interval > 0.0 || interval == 0.0 && self.timing != Timing::Periodic;
        if !(is_possible && interval.is_finite()) {
            bail!("{}: the clock {} has the interval {} s", calls.name, self.name, number(interval));
        }
        Ok(())
    }

    fn is_due(&self, time: f64) -> bool {
        self.next.is_some_and(|next| next <= time)
    }

    /// Sets the next tick.
    fn has_ticked(&mut self, time: f64) {
        match self.timing {
            Timing::Periodic => self.ticks += 1.0,
            Timing::Changing => (self.origin, self.ticks) = (self.next.unwrap_or(time), 1.0),
            Timing::Countdown => return self.next = None,
        }
        self.next = (self.interval > 0.0).then_some(self.origin + self.ticks * self.interval);
    }
}
