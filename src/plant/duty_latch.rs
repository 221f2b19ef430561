//! Optionally, a commanded duty takes effect at the start of the next PWM period, as in a PWM unit (paper, section 3.3:
//! 300 Hz, with the controller at 80 Hz).
//!
//! Periods are counted in integers from the experiment's start, so they do not drift. The held duty is part of the
//! model's state. The voltage is not held: it acts at once.

use fmu_export::{Number, Persistent};

use super::variables::{Inputs, Parameters};

/// Period starts closer than this share of a period to the end of a step belong to the next step.
const ROUNDING: f64 = 1e-6;

/// The held duty and the period count.
#[derive(Clone, Copy, Debug, Default, Persistent)]
pub struct DutyLatch {
    /// When the experiment starts, in s.
    pub start_time: f64,
    /// The duty in percent until the next period starts; none before the first.
    held: Option<f64>,
    /// The number of periods started.
    started: u64,
}

impl DutyLatch {
    /// The state before the first period, which starts with the experiment (s).
    pub fn new(start_time: f64) -> Self {
        Self { start_time, held: None, started: 0 }
    }

    /// The inputs with the duty that the valve sees.
    pub fn hold<D: Number>(&self, parameters: &Parameters<D>, mut inputs: Inputs<D>) -> Inputs<D> {
        if let Some(held) = self.held.filter(|_| parameters.valve.duty_latch) {
            inputs.hp_wastegate_pwm = held.into();
        }
        inputs
    }

    /// The time in s at which the next period starts.
    pub fn next(&self, frequency: f64) -> f64 {
        self.start_time + self.next_after_start(frequency)
    }

    /// The same from the experiment's start.
    fn next_after_start(&self, frequency: f64) -> f64 {
        self.started as f64 / frequency
    }

    /// Starts one period, with a duty in percent.
    pub fn take(&mut self, duty: f64) {
        self.held = Some(duty);
        self.started += 1;
    }

    /// The time in s from the experiment's start to the next period, if it is before `end` (likewise from the start).
    pub fn next_before(&self, end: f64, frequency: f64) -> Option<f64> {
        let instant = self.next_after_start(frequency);
        (instant < end - ROUNDING / frequency).then_some(instant)
    }

    /// Starts all periods before `end` (s from the experiment's start) with a duty in percent.
    pub fn take_until(&mut self, end: f64, frequency: f64, duty: f64) {
        self.held = Some(duty);
        // Rounding may put the product off by one period; the comparison corrects it.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times after the start")]
        let nearly = (end * frequency) as u64;
        self.started = self.started.max(nearly.saturating_sub(1));
        while self.next_before(end, frequency).is_some() {
            self.started += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_counted_without_drift() {
        let mut latch = DutyLatch::new(0.0);
        let mut instants = 0;
        // An hour of controller samples: rounding in the step ends must not affect the count.
        for sample in 1..=288_000 {
            let end = f64::from(sample) * 0.0125;
            let Some(instant) = latch.next_before(end, 300.0) else { continue };
            assert!((instant - f64::from(instants) / 300.0).abs() < 1e-9);
            latch.take_until(end, 300.0, 50.0);
            instants = sample * 300 / 80 + i32::from(sample * 300 % 80 != 0);
        }
        assert_eq!(instants, 1_080_000);
    }
}
