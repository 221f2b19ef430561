//! Scheduled Execution: the model partitions of clocks (FMI 3.0.2, section 5.2).

use core::mem;

use fmu_abi::calling_sequence::Phase;
use fmu_solve::Error;
use fmu_solve::display::Shown;
use fmu_solve::time::summed_rounding;

use super::{Answer, ClockUpdate, Instance};
use crate::kinds::Model;
use crate::model::description::{ClockDescription, IntervalVariability, ValueReference};
use crate::model::variables::{Accessed as _, Described as _};

impl<M: Model> Instance<M> {
    /// Computes a clock's model partition at a time in s.
    pub(crate) fn activate(&mut self, clock: ValueReference, time: f64) -> Answer {
        let (position, description) = Self::clock(clock)?;
        if !description.is_input {
            let name = Self::clock_name(description);
            return Err(Error::new(format!(
                "the clock {name} is not an input, so it has no model partition"
            )));
        }
        self.check_activation(position, time)?;
        let memory = &mut self.memory;
        memory.accept_parameters()?;
        if memory.stale {
            memory.model.refresh(time, &mut memory.variables);
        }
        // If an error or a panic interrupts the partition, the instance stays in this state.
        let phase = mem::replace(&mut memory.phase, Phase::Error);
        let status = self.compute_tick(position, time)?;
        let memory = &mut self.memory;
        if let Some(end) = memory.end {
            // There is no other way to report it.
            return Err(Error::new(format!(
                "the model requests the end of the simulation at {} s",
                Shown(end)
            )));
        }
        memory.clock_mut(position).activated = Some(time);
        memory.time = time;
        memory.stale = false;
        memory.phase = phase;
        Ok(status)
    }

    /// Whom to notify if clocks tick or intervals are new. Begins Clock Update Mode.
    pub(crate) fn begin_clock_update(&mut self) -> Option<ClockUpdate> {
        let is_told = |(position, description): (usize, &ClockDescription)| {
            let is_countdown = description.interval_variability == IntervalVariability::Countdown;
            let clock = self.memory.variables.clock(position);
            clock.is_some_and(|clock| clock.ticks && !description.is_input || clock.is_new && is_countdown)
        };
        let has_update = M::Variables::CLOCKS.iter().enumerate().any(is_told);
        let update = self.clock_update.filter(|_| has_update)?;
        self.clock_updates += 1;
        Some(update)
    }

    /// Ends Clock Update Mode.
    pub(crate) fn end_clock_update(&mut self) {
        self.clock_updates -= 1;
    }

    /// Rejects a time not after the clock's last activation, or outside the experiment.
    fn check_activation(&self, position: usize, time: f64) -> Result<(), Error> {
        let start = self.memory.experiment.start_time;
        let last = self.memory.variables.clock(position).and_then(|clock| clock.activated);
        let stop = self.stop_time().unwrap_or(f64::INFINITY);
        let refuse = |reason: String| Err(Error::new(format!("activationTime is {}{reason}", Shown(time))));
        if !time.is_finite() {
            refuse(String::new())
        } else if time < start {
            refuse(format!(", which is before the startTime {}", Shown(start)))
        } else if let Some(last) = last.filter(|last| time <= *last) {
            refuse(format!("; the last activation was at {}", Shown(last)))
        } else if time > stop + summed_rounding(stop) {
            refuse(format!(", which is after the stopTime {}", Shown(stop)))
        } else {
            Ok(())
        }
    }
}

/// The simplest fraction equal to a positive number: numerator and denominator.
pub(crate) fn fraction(number: f64) -> Option<[u64; 2]> {
    const FRACTION_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    let bits = number.to_bits();
    let mantissa = bits & ((1 << FRACTION_BITS) - 1) | 1 << FRACTION_BITS;
    // The number is mantissa · 2^(exponent - bias).
    let (exponent, bias) = (u32::try_from(bits >> FRACTION_BITS).ok()?, 1023 + FRACTION_BITS);
    let mut divided = u128::from(mantissa).checked_mul(1_u128.checked_shl(exponent.saturating_sub(bias))?)?;
    let mut divisor = 1_u128.checked_shl(bias.saturating_sub(exponent))?;
    // The number's convergents, each closer than any fraction with a smaller denominator.
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
