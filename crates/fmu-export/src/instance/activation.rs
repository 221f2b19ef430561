//! Scheduled Execution: the clock and its model partition (FMI 3.0.2, sections 2.2.8 and 5.2).

use core::mem;

use super::{Answer, Instance, check_finite};
use crate::calling_sequence::Phase;
use crate::description::{DataType, ValueReference};
use crate::error::{Error, Shown};
use crate::logger::WARNING;
use crate::model::{Context, time_rounding};
use crate::scheduled_execution::ScheduledExecution;
use crate::status::Status;

/// What is told of a clock's interval: `fmi3IntervalQualifier`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub(crate) enum IntervalQualifier {
    Unchanged = 1,
    Changed = 2,
}

impl<M: ScheduledExecution> Instance<M> {
    /// Refuses variables that are not clocks.
    pub(crate) fn check_clocks(references: &[ValueReference]) -> Result<(), Error> {
        references.iter().try_for_each(|&reference| Self::variable(reference, &[DataType::Clock]).map(|_| ()))
    }

    /// The clock's interval in s, and whether the importer has not been told so before. As it follows from parameters, it
    /// is fixed when initialization ends.
    pub(crate) fn interval(&mut self) -> Result<(f64, IntervalQualifier), Error> {
        let interval = M::interval(&self.memory.variables);
        if !(interval > 0.0 && interval.is_finite()) {
            return Err(Error::new(format!(
                "the clock's interval is {} s; it must be finite and above 0",
                Shown(interval)
            )));
        }
        let told = self.memory.told_interval.replace(interval);
        let is_told = told.map(f64::to_bits) == Some(interval.to_bits())
            || self.memory.phase != Phase::InitializationMode;
        Ok((interval, if is_told { IntervalQualifier::Unchanged } else { IntervalQualifier::Changed }))
    }

    /// Computes the model partition of a clock at a time in s.
    pub(crate) fn activate(&mut self, clock: ValueReference, time: f64) -> Answer {
        Self::check_clocks(&[clock])?;
        self.check_activation(time)?;
        let memory = &mut self.memory;
        memory.inputs.update();
        if memory.parameters_changed {
            M::check_parameters(&memory.variables)?;
            memory.parameters_changed = false;
        }
        let mut status = Status::Ok;
        let logger = &self.logger;
        let mut log = |category, message: core::fmt::Arguments<'_>| {
            if category == WARNING {
                status = Status::Warning;
            }
            logger.message(category, message);
        };
        // If an error or a panic interrupts the partition, the instance remains in this state.
        let phase = mem::replace(&mut memory.phase, Phase::Error);
        let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
        memory.model.activate(time, &mut memory.variables, memory.inputs.initial(), &mut context)?;
        if let Some(end) = context.end()? {
            // There is no other way to tell.
            return Err(Error::new(format!(
                "the model asks for the end of the simulation, at {} s",
                Shown(end)
            )));
        }
        check_finite(&memory.variables, time)?;
        memory.events.set_next(None, time, false)?;
        memory.time = time;
        memory.stale = false;
        memory.phase = phase;
        Ok(status)
    }

    /// Refuses a time that is not after that of the last activation, or not in the experiment.
    fn check_activation(&self, time: f64) -> Result<(), Error> {
        let (start, last) = (self.memory.experiment.start_time, self.memory.events.reached());
        let stop = self.stop_time().unwrap_or(f64::INFINITY);
        let refuse = |reason: String| Err(Error::new(format!("activationTime is {}{reason}", Shown(time))));
        if !time.is_finite() {
            refuse(String::new())
        } else if time < start {
            refuse(format!(", which is before the startTime {}", Shown(start)))
        } else if time <= last {
            refuse(format!("; the last activation was at {}", Shown(last)))
        } else if time > stop + time_rounding(stop) {
            refuse(format!(", which is after the stopTime {}", Shown(stop)))
        } else {
            Ok(())
        }
    }
}

/// The simplest fraction that is a number above 0: numerator and denominator.
pub(crate) fn fraction(number: f64) -> Option<[u64; 2]> {
    const FRACTION_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    let bits = number.to_bits();
    let mantissa = bits & ((1 << FRACTION_BITS) - 1) | 1 << FRACTION_BITS;
    // The number is mantissa · 2^(exponent - bias).
    let (exponent, bias) = (u32::try_from(bits >> FRACTION_BITS).ok()?, 1023 + FRACTION_BITS);
    let mut divided = u128::from(mantissa).checked_mul(1_u128.checked_shl(exponent.saturating_sub(bias))?)?;
    let mut divisor = 1_u128.checked_shl(bias.saturating_sub(exponent))?;
    // Its convergents, each closer than all fractions with a smaller denominator.
    let (mut before, mut last) = ([0, 1], [1, 0]);
    while divisor > 0 {
        let whole = divided / divisor;
        (divided, divisor) = (divisor, divided % divisor);
        let next = [0, 1].map(|part: usize| whole * last[part] + before[part]);
        (before, last) = (last, next);
        #[expect(clippy::float_cmp, reason = "it is to be the very number")]
        if next[0] as f64 / next[1] as f64 == number {
            break;
        }
    }
    Some([u64::try_from(last[0]).ok()?, u64::try_from(last[1]).ok()?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_are_the_simplest_of_their_number() {
        for (number, expected) in [
            (0.0125, [1, 80]),
            (1.0 / 3.0, [1, 3]),
            (0.1, [1, 10]),
            (22.0 / 7.0, [22, 7]),
            (3.0, [3, 1]),
            (1e15, [1_000_000_000_000_000, 1]),
            (2.0_f64.powi(-63), [1, 1 << 63]),
        ] {
            assert_eq!(fraction(number), Some(expected), "{number}");
        }
        for number in [core::f64::consts::PI, 0.012_500_000_000_000_1, 1e-9] {
            let [numerator, denominator] = fraction(number).expect("there is one");
            assert_eq!((numerator as f64 / denominator as f64).to_bits(), number.to_bits());
        }
        for number in [1e30, 1e-30, f64::MIN_POSITIVE] {
            assert_eq!(fraction(number), None, "{number}");
        }
    }
}
