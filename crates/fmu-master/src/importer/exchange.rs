//! Model Exchange: an FMU's equations at times and states.

use std::rc::Rc;

use anyhow::{Result, bail};
use fmu_solve::display::Seconds;

use super::c_boundary::{ModelExchange, Vector};
use super::calls::Calls;
use super::differences::nominal;

/// Evaluates an FMU's equations.
#[derive(Clone)]
pub struct Exchange(Rc<dyn ModelExchange>);

impl Exchange {
    pub fn new(handle: Rc<dyn ModelExchange>) -> Self {
        Self(handle)
    }

    /// Sets time (s), the inputs that follow it, and the continuous states.
    pub fn go_to(&self, calls: &mut Calls, time: f64, states: &[f64]) -> Result<()> {
        calls.check(&[], self.0.set_time(time))?;
        calls.follow(time)?;
        if states.is_empty() {
            return Ok(());
        }
        calls.check(&[], self.0.set_states(states))
    }

    /// Gets all numbers of a vector, unless it is empty.
    pub fn get_vector(&self, calls: &mut Calls, vector: Vector, values: &mut [f64]) -> Result<()> {
        if values.is_empty() {
            return Ok(());
        }
        calls.check(&[], self.0.get_vector(vector, values))
    }

    /// Gets the states' [nominals](nominal).
    pub fn get_nominals(&self, calls: &mut Calls, nominals: &mut [f64]) -> Result<()> {
        self.get_vector(calls, Vector::Nominals, nominals)?;
        for given in nominals {
            *given = nominal(*given);
        }
        Ok(())
    }

    /// The derivatives at a time (s) and states.
    pub fn derivatives_at(
        &self,
        calls: &mut Calls,
        time: f64,
        states: &[f64],
        derivatives: &mut [f64],
    ) -> Result<()> {
        self.go_to(calls, time, states)?;
        self.get_vector(calls, Vector::Derivatives, derivatives)
    }

    /// Reads the event indicators at the present time (s), which have signs only if they are finite.
    pub fn read_indicators(&self, calls: &mut Calls, indicators: &mut [f64], time: f64) -> Result<()> {
        self.get_vector(calls, Vector::Indicators, indicators)?;
        match indicators.iter().position(|indicator| !indicator.is_finite()) {
            Some(wrong) => bail!(
                "{}: the event indicator {} is {} at {} s",
                calls.name,
                wrong + 1,
                indicators[wrong],
                Seconds(time)
            ),
            None => Ok(()),
        }
    }

    /// Completes a step of the integrator to a time (s). Returns whether an event follows.
    pub fn complete_step(&self, calls: &mut Calls, time: f64) -> Result<bool> {
        let (called, completed) = self.0.completed_integrator_step();
        calls.check(&[], called)?;
        if completed.terminates {
            calls.end(time)?;
        }
        Ok(completed.has_event)
    }
}
