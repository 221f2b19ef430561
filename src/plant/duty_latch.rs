//! Optionally, a commanded duty takes effect at the start of the next PWM period, as in a PWM unit (paper, section 3.3:
//! 300 Hz, with the controller at 80 Hz).
//!
//! Periods are counted in integers from the experiment's start, so they do not drift. The held duty is part of the
//! model's state. The voltage is not held: it acts at once.

use fmu_export::{Number, Persistent};

use super::variables::{Inputs, Parameters};

/// The held duty and the period count.
#[derive(Clone, Copy, Debug, Default, Persistent)]
pub struct DutyLatch {
    /// When the experiment starts, in s.
    start_time: f64,
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
        self.start_time + self.started as f64 / frequency
    }

    /// Starts a period, with a duty in percent.
    pub fn take(&mut self, duty: f64) {
        self.held = Some(duty);
        self.started += 1;
    }
}
