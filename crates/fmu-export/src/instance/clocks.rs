//! Clocks: their activation, intervals and ticks (FMI 3.0.2, sections 2.2.8 and 2.3.5).
//!
//! In Event Mode, ticks are computed when values are requested, and recomputed if the importer then sets a value or
//! revokes a tick, until `fmi3UpdateDiscreteStates`.

use core::mem;

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_solve::Error;

use super::memory::is_activated;
use super::{Answer, Instance, check_finite};
use crate::kinds::Model;
use crate::model::clock::{IntervalQualifier, check_time};
use crate::model::context::{Context, Timed};
use crate::model::description::{ClockDescription, DataType, IntervalVariability, Name, ValueReference};
use crate::model::variables::{Accessed as _, Described as _};

impl<M: Model> Instance<M> {
    /// The clock of a value reference, with its position among the clocks.
    pub(super) fn clock(reference: ValueReference) -> Result<(usize, &'static ClockDescription), Error> {
        let variable = Self::variable(reference, &[DataType::Clock])?;
        let mut clocks = M::Variables::CLOCKS.iter().enumerate();
        clocks
            .find(|(_, clock)| clock.value_reference == reference)
            .ok_or_else(|| Error::new(format!("{} is not a clock", variable.name())))
    }

    pub(super) fn clock_name(clock: &ClockDescription) -> Name {
        Self::checked(clock.value_reference).name()
    }

    /// Computes the ticks of the clocks that the importer activated, unless this has been done.
    pub(super) fn compute_ticks(&mut self) -> Answer {
        let memory = &mut self.memory;
        let positions = || 0..M::Variables::CLOCKS.len();
        if memory.ticks.are_computed || !positions().any(|at| is_activated::<M>(&memory.variables, at)) {
            return Ok(Status::Ok);
        }
        memory.keep_before_ticks();
        for position in positions() {
            let clock = memory.clock_mut(position);
            clock.ticks &= !M::Variables::CLOCKS[position].is_input;
        }
        // If an error or a panic interrupts a tick, the instance stays in this state.
        let phase = mem::replace(&mut memory.phase, Phase::Error);
        let mut status = Status::Ok;
        for position in positions() {
            if self.memory.ticked(position) {
                status = status.max(self.compute_tick(position, self.memory.time)?);
            }
        }
        let memory = &mut self.memory;
        for position in positions() {
            if memory.ticked(position) {
                memory.clock_mut(position).ticks = true;
            }
        }
        memory.model.refresh(memory.time, &mut memory.variables);
        memory.phase = phase;
        Ok(status)
    }

    /// Computes the tick of one clock at a time in s.
    pub(super) fn compute_tick(&mut self, position: usize, time: f64) -> Answer {
        let memory = &mut self.memory;
        memory.clock_mut(position).begin_tick(M::Variables::CLOCKS[position].interval_variability);
        let mut status = Status::Ok;
        let (logger, recent_messages) = (&self.logger, &mut memory.recent_messages);
        let mut log = Timed::new(time, |category, message| {
            // A recomputed tick logs it once.
            if recent_messages.is_new(&format!("{position} {message}")) {
                status = status.max(logger.message(category, message));
            }
        });
        let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
        memory.model.tick(time, &mut memory.variables, &mut context)?;
        memory.end = context.end()?.or(memory.end);
        memory.clock_mut(position).ticks = false;
        check_finite(&memory.variables, time)?;
        Ok(status)
    }

    /// Rejects variables none of whose clocks ticks.
    pub(super) fn check_ticking(&self, references: &[ValueReference]) -> Result<(), Error> {
        if !matches!(
            self.memory.phase,
            Phase::StepComplete | Phase::EventMode | Phase::StepEventMode | Phase::ContinuousTimeMode
        ) {
            return Ok(());
        }
        let clocked = M::Variables::CLOCKED;
        for &reference in references {
            let Some(variable) = M::Variables::description(reference) else { continue };
            let found = clocked.binary_search_by_key(&variable.value_reference, |(clocked, _)| *clocked);
            let Ok(found) = found else { continue };
            let mut clocks = clocked[found].1.iter().map(|&clock| Self::clock(clock).map(|(place, _)| place));
            let ticks = |position: Result<usize, Error>| {
                position.is_ok_and(|at| self.memory.variables.clock(at).is_some_and(|clock| clock.ticks))
            };
            if !clocks.any(ticks) {
                return Err(Error::new(format!(
                    "the variable {} can be set only while its clock ticks",
                    variable.name()
                )));
            }
        }
        Ok(())
    }

    /// Which clocks tick. In Scheduled Execution an output clock reports each tick once.
    pub(crate) fn get_clock(&mut self, references: &[ValueReference], values: &mut [u8]) -> Answer {
        let is_scheduled = self.memory.phase == Phase::ClockActivationMode;
        for &reference in references {
            let (_, clock) = Self::clock(reference)?;
            if is_scheduled && clock.is_input {
                let name = Self::clock_name(clock);
                return Err(Error::new(format!(
                    "the clock {name} is an input: the importer knows its ticks"
                )));
            }
        }
        let status = self.compute_values()?;
        for (&reference, value) in references.iter().zip(values) {
            let clock = self.memory.clock_mut(Self::clock(reference)?.0);
            *value = u8::from(clock.ticks);
            clock.ticks &= !is_scheduled;
        }
        Ok(status)
    }

    /// Activates clocks, or revokes that.
    pub(crate) fn set_clock(&mut self, references: &[ValueReference], values: &[u8]) -> Answer {
        for (&reference, &value) in references.iter().zip(values) {
            let (position, clock) = Self::clock(reference)?;
            let name = Self::clock_name(clock);
            let state = self.memory.clock_mut(position);
            let refuse = |reason: &str| Err(Error::new(format!("the clock {name} {reason}")));
            if !clock.is_input {
                return refuse("is not an input: it ticks by itself");
            } else if value == 0 && state.ticks && !clock.can_be_deactivated {
                return refuse("cannot be deactivated (canBeDeactivated is false)");
            } else if value != 0 && state.has_ticked && clock.interval_variability.is_periodic() {
                return refuse("is periodic, and has ticked in this event");
            }
        }
        self.memory.rewind();
        for (&reference, &value) in references.iter().zip(values) {
            self.memory.clock_mut(Self::clock(reference)?.0).ticks = value != 0;
        }
        self.memory.stale = true;
        Ok(Status::Ok)
    }

    /// Gets the intervals of time-based clocks in s. Passes each to `write` with its position; `None` if not known
    /// yet.
    pub(crate) fn get_intervals(
        &mut self,
        references: &[ValueReference],
        is_fraction: bool,
        mut write: impl FnMut(usize, Option<f64>, IntervalQualifier) -> Result<(), Error>,
    ) -> Answer {
        let is_scheduled = self.memory.phase == Phase::ClockActivationMode;
        for &reference in references {
            let clock = Self::time_based_clock(reference, is_fraction)?;
            let is_countdown = clock.interval_variability == IntervalVariability::Countdown;
            if is_scheduled && is_countdown && self.clock_updates == 0 {
                let name = Self::clock_name(clock);
                return Err(Error::new(format!(
                    "the interval of the countdown clock {name} is available in Clock Update Mode"
                )));
            }
        }
        let status = self.compute_values()?;
        for (place, &reference) in references.iter().enumerate() {
            let (position, clock) = Self::clock(reference)?;
            let (name, kind) = (Self::clock_name(clock), clock.interval_variability);
            let state = self.memory.clock_mut(position);
            let is_unknown = kind == IntervalVariability::Countdown && state.interval().is_none();
            let interval = if is_unknown { None } else { Some(state.checked_interval(name, kind)?) };
            write(place, interval, state.tell(kind))?;
        }
        Ok(status)
    }

    /// Sets the intervals of clocks in s, or their shifts.
    pub(crate) fn set_times(
        &mut self,
        references: &[ValueReference],
        times: &[f64],
        is_interval: bool,
        is_fraction: bool,
    ) -> Answer {
        let phase = self.memory.phase;
        for (&reference, &time) in references.iter().zip(times) {
            let clock = Self::time_based_clock(reference, is_fraction)?;
            let (name, kind) = (Self::clock_name(clock), clock.interval_variability);
            let is_settable = clock.has_interval
                && match kind {
                    IntervalVariability::Fixed => phase == Phase::InitializationMode,
                    IntervalVariability::Tunable => true,
                    _ => false,
                };
            let what = if is_interval { "interval" } else { "shift" };
            if !is_settable {
                return Err(Error::new(format!(
                    "the {what} of the clock {name} cannot be set in the state {phase}"
                )));
            }
            check_time(what, name, time, time > 0.0 || time >= 0.0 && !is_interval)?;
        }
        self.memory.rewind();
        for (&reference, &time) in references.iter().zip(times) {
            let clock = self.memory.clock_mut(Self::clock(reference)?.0);
            if is_interval { clock.set_interval(time) } else { clock.set_shift(time) }
        }
        self.memory.stale = true;
        Ok(Status::Ok)
    }

    /// Gets the shifts of periodic clocks in s.
    pub(crate) fn get_shifts(
        &mut self,
        references: &[ValueReference],
        is_fraction: bool,
        mut write: impl FnMut(usize, f64) -> Result<(), Error>,
    ) -> Answer {
        for &reference in references {
            let clock = Self::time_based_clock(reference, is_fraction)?;
            if !clock.interval_variability.is_periodic() {
                let name = Self::clock_name(clock);
                return Err(Error::new(format!("the clock {name} is aperiodic, so it has no shift")));
            }
        }
        let status = self.compute_values()?;
        for (place, &reference) in references.iter().enumerate() {
            let (position, clock) = Self::clock(reference)?;
            let shift = self.memory.clock_mut(position).checked_shift(Self::clock_name(clock))?;
            write(place, shift)?;
        }
        Ok(status)
    }

    /// A clock with intervals, if required as fractions.
    fn time_based_clock(
        reference: ValueReference,
        is_fraction: bool,
    ) -> Result<&'static ClockDescription, Error> {
        let (_, clock) = Self::clock(reference)?;
        let name = Self::clock_name(clock);
        if clock.interval_variability == IntervalVariability::Triggered {
            return Err(Error::new(format!("the clock {name} is triggered, so it has no interval")));
        }
        if is_fraction && !clock.supports_fraction {
            return Err(Error::new(format!("the clock {name} has no fractions (supportsFraction is false)")));
        }
        Ok(clock)
    }
}

/// A fraction in seconds.
#[expect(clippy::cast_precision_loss, reason = "it is a time in s, rounded")]
pub(crate) fn seconds(counter: u64, resolution: u64) -> f64 {
    counter as f64 / resolution as f64
}
