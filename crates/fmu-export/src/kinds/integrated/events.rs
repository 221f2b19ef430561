//! The events of a model of equations: which indicators have changed, what is due, and what an event does.

use fmu_solve::display::Seconds;
use fmu_solve::{Error, Event, MOST_ITERATIONS};

use super::{Integrate, Integrated};
use crate::kinds::audit::{check_calculated_parameters, check_evaluation};
use crate::kinds::equations::{Equations, calculate_parameters, evaluate, evaluate_values};
use crate::model::context::Context;
use crate::model::variables::{Accessed as _, Described as _};

/// The most events after which tests evaluate twice: later ones, as of a fast clock, repeat the branches.
const MOST_AUDITED: u32 = 1000;

impl<E: Equations, I: Integrate<E>> Integrated<E, I> {
    pub(super) fn check_calculated_parameters(&self, variables: &E::Variables) -> Result<(), Error> {
        check_calculated_parameters(variables, |variables| {
            calculate_parameters::<E, f64>(&self.equations, variables);
        })
    }

    pub(super) fn check_evaluation(&self, variables: &E::Variables) -> Result<(), Error> {
        check_evaluation(variables, &|variables| evaluate(&self.equations, self.time, variables))?;
        check_evaluation(variables, &|variables| evaluate_values(&self.equations, self.time, variables))
    }

    /// Evaluates after an event, whose branch may omit a variable.
    pub(super) fn evaluate_after_event(&self, time: f64, variables: &mut E::Variables) -> Result<(), Error> {
        variables.forget_continuous();
        evaluate_values(&self.equations, time, variables);
        if variables.has_finite_results() { Ok(()) } else { self.check_branch(time, variables) }
    }

    /// What the branch of an event omits, if it does: a variable may be infinite, or not a number, for another reason.
    #[cold]
    pub(super) fn check_branch(&self, time: f64, variables: &E::Variables) -> Result<(), Error> {
        check_evaluation(variables, &|variables| evaluate_values(&self.equations, time, variables))
            .map_err(|omitted| Error::new(format!("after the event at {} s, {omitted}", Seconds(time))))
    }

    /// Finds which indicators have changed since the last event. Returns whether any has.
    pub(super) fn find_changes(&mut self, variables: &E::Variables) -> Result<bool, Error> {
        let Self { equations, events, time, .. } = self;
        events.find_changes(*time, E::Variables::EVENT_INDICATORS, |indicators| {
            equations.event_indicators(*time, variables, indicators);
        })
    }

    /// Asks when the next time event is due, which changed inputs and parameters may have moved, unless it is now,
    /// within a `rounding` (s).
    pub(super) fn ask_again(&mut self, variables: &E::Variables, rounding: f64) -> Result<(), Error> {
        let now = self.events.time(self.time, rounding);
        if self.events.due(now, rounding).is_some() {
            return Ok(());
        }
        let next = self.equations.next_event(now, variables);
        self.events.move_next(next, now)
    }

    /// Handles an event now, and those that it causes at once; `due` is the time in s of a time event.
    pub(super) fn happen(
        &mut self,
        variables: &mut E::Variables,
        is_initial: bool,
        due: Option<f64>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let time = due.unwrap_or(self.time);
        // What has been evaluated must not go back by rounding.
        self.time = self.time.max(time);
        context.at(time);
        let mut event = Event { time, is_initial, is_due: due.is_some(), indicators: &[] };
        for _ in 0..MOST_ITERATIONS {
            event.indicators = self.events.changed();
            self.equations.event(&event, variables, context)?;
            if cfg!(debug_assertions) && self.audited < MOST_AUDITED {
                // Tests of a model check each of its branches.
                self.audited += 1;
                self.check_calculated_parameters(variables)?;
                self.check_evaluation(variables)?;
            }
            self.evaluate_after_event(self.time, variables)?;
            self.events.accept();
            if !self.find_changes(variables)? {
                self.events.check_limits(self.time, E::Variables::EVENT_INDICATORS, E::Variables::LIMITS)?;
                self.integrator.restart();
                let next = self.equations.next_event(time, variables);
                return self.events.set_next(next, time, is_initial);
            }
            event = Event { time, is_initial: false, is_due: false, indicators: &[] };
        }
        Err(self.events.endless(self.time, E::Variables::EVENT_INDICATORS))
    }
}
