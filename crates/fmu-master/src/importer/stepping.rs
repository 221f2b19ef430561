//! The steps of FMUs for co-simulation.

use std::rc::Rc;

use anyhow::{Result, bail};
use fmu_solve::display::Seconds;

use super::c_boundary::CoSimulation;
use super::calls::Calls;
use super::messages::Status;

/// Lets an FMU for co-simulation step.
pub struct Stepping {
    handle: Rc<dyn CoSimulation>,
    /// Whether a step may return early.
    may_return_early: bool,
    /// Whether a warning has said that a step returned early though it may not.
    has_returned_early: bool,
}

/// Where a step has led.
pub struct Reached {
    /// The time at which the step returned early (s), if it did.
    pub early_return: Option<f64>,
    /// Whether an event is to be handled.
    pub has_event: bool,
}

impl Stepping {
    pub fn new(handle: Rc<dyn CoSimulation>, may_return_early: bool) -> Self {
        Self { handle, may_return_early, has_returned_early: false }
    }

    /// Steps from a time (s) by a size (s).
    pub fn step(&mut self, calls: &mut Calls, time: f64, size: f64) -> Result<Reached> {
        let step = self.handle.do_step(time, size);
        let last_successful_time = || self.handle.last_successful_time(&step);
        if step.terminates {
            calls.end(last_successful_time().unwrap_or(time + size))?;
        }
        calls.check_with(&[], step.called, || {
            if step.called.status == Status::DISCARD { last_successful_time() } else { None }
        })?;
        let early_return = step.early_return.filter(|reached| *reached < time + size);
        if let Some(reached) = early_return {
            // An event may be due at once.
            let may_stay = self.may_return_early && step.has_event;
            if reached < time || reached <= time && !may_stay {
                bail!("{}: the step from {} s returned early, and has not moved", calls.name, Seconds(time));
            }
            if !self.may_return_early && !self.has_returned_early {
                self.has_returned_early = true;
                calls.warn(format!(
                    "fmi3DoStep returned early at {} s, though earlyReturnAllowed is false; it is called again",
                    Seconds(reached)
                ));
            }
        }
        calls.set_time(Some(early_return.unwrap_or(time + size)));
        Ok(Reached { early_return, has_event: step.has_event })
    }
}
