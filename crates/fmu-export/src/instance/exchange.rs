//! Model Exchange: time, states and events (FMI 2.0.5, section 3.2); and the events of Co-Simulation with Event Mode.

use core::mem;

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_abi::floating_point::in_default_environment;
use fmu_solve::display::{Seconds, Shown};
use fmu_solve::time::summed_rounding;
use fmu_solve::{Error, Event, MOST_ITERATIONS};
use fmu_terms::InstanceType;

use super::memory::{EventUnderWay, Memory};
use super::{Answer, Instance, check_finite};
use crate::kinds::Model;
use crate::model::context::{Context, Timed};
use crate::model::description::ValueReference;
use crate::model::variables::{Described as _, Numbered as _};

/// The outcome of an event: `fmi2EventInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct EventInfo {
    /// Whether another event follows at once.
    pub(crate) again: bool,
    /// Whether the model requests the end of the simulation.
    pub(crate) terminate: bool,
    /// Whether a state changed, in this iteration or an earlier one of the event: the standard's own example importer
    /// (section 3.2.4) checks only the last one.
    pub(crate) states_changed: bool,
    /// When the next time event is due, in s.
    pub(crate) next: Option<f64>,
}

impl<M: Model> Memory<M> {
    /// The states, in the order of the model structure's derivatives.
    fn states(&self) -> impl PartialEq + use<M> {
        let mut states = vec![];
        M::Variables::each_state(&self.variables, |_, state: f64| states.push(state.to_bits()));
        states
    }

    /// Computes the event indicators.
    fn compute_indicators(&self, indicators: &mut [f64]) {
        self.model.event_indicators(self.time, &self.variables, indicators);
    }

    /// Whether an event indicator has changed since the last event.
    fn find_changes(&mut self) -> Result<bool, Error> {
        let Self { model, variables, time, events, .. } = self;
        events.find_changes(*time, M::Variables::EVENT_INDICATORS, |indicators| {
            model.event_indicators(*time, variables, indicators);
        })
    }

    /// When the reached time event was due.
    fn due(&self) -> Option<f64> {
        self.events.due(self.time, summed_rounding(self.time))
    }

    /// The next event after a time (s), as the model says.
    fn next_event(&self, time: f64) -> Option<f64> {
        self.model.next_event(time, &self.variables)
    }

    /// Requests the next event at an event at a time (s).
    fn announce_next(&mut self, time: f64, is_initial: bool) -> Result<(), Error> {
        let next = self.next_event(time);
        self.events.set_next(next, time, is_initial)
    }
}

impl<M: Model> Instance<M> {
    pub(crate) fn exit_initialization_mode(&mut self) -> Answer {
        let status = self.leave_initialization_mode()?;
        let memory = &mut self.memory;
        let event_mode = memory.phase;
        if const { Self::EVENTS.is_made } && memory.instance_type != InstanceType::CoSimulation {
            // It can be repeated after an error.
            memory.phase = Phase::InitializationMode;
            let Memory { model, variables, time, events, .. } = memory;
            events.begin(*time, M::Variables::EVENT_INDICATORS, |indicators| {
                model.event_indicators(*time, variables, indicators);
            })?;
            memory.announce_next(memory.time, true)?;
            memory.phase = event_mode;
        }
        Ok(status)
    }

    #[expect(clippy::unnecessary_wraps, reason = "returns what every callable function does")]
    pub(crate) fn enter_event_mode(&mut self) -> Answer {
        self.memory.phase = match self.memory.instance_type {
            InstanceType::CoSimulationWithEvents => Phase::StepEventMode,
            _ => Phase::EventMode,
        };
        self.memory.event = EventUnderWay::default();
        self.memory.begin_event();
        Ok(Status::Ok)
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Answer {
        self.memory.accept_parameters()?;
        let status = self.compute_values()?;
        self.memory.end_ticks();
        self.memory.phase = Phase::ContinuousTimeMode;
        Ok(status)
    }

    /// One iteration of an event, if there is one now.
    pub(crate) fn new_discrete_states(&mut self) -> Result<(Status, EventInfo), Error> {
        self.memory.accept_parameters()?;
        let mut status = self.compute_values()?;
        let memory = &mut self.memory;
        let has_changed = memory.find_changes()?;
        let due = memory.due();
        let time = due.unwrap_or_else(|| memory.events.time(memory.time, summed_rounding(memory.time)));
        let mut info = EventInfo::default();
        if has_changed || due.is_some() {
            memory.event.iterations += 1;
            if memory.event.iterations > MOST_ITERATIONS {
                memory.phase = Phase::Error;
                return Err(memory.events.endless(memory.time, M::Variables::EVENT_INDICATORS));
            }
            let before = memory.states();
            let logger = &self.logger;
            if memory.events.crowd(time, memory.experiment.length()) {
                let cause = memory
                    .events
                    .first_changed()
                    .map_or("time events", |at| M::Variables::EVENT_INDICATORS[at]);
                status = logger.warning(format_args!(
                    "{MOST_ITERATIONS} events in a row barely advance beyond {} s, the last caused by {cause}: they come \
                     ever faster",
                    Seconds(time)
                ));
            }
            let mut log = Timed::new(time, |category, message| {
                status = status.max(logger.message(category, message));
            });
            let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
            // If an error or a panic interrupts the event, the instance stays in this state.
            let phase = mem::replace(&mut memory.phase, Phase::Error);
            let event =
                Event { time, is_initial: false, is_due: due.is_some(), indicators: memory.events.changed() };
            memory.model.event(&event, &mut memory.variables, &mut context)?;
            memory.end = context.end()?.or(memory.end);
            memory.events.accept();
            memory.model.refresh(memory.time, &mut memory.variables);
            check_finite(&memory.variables, memory.time)?;
            memory.announce_next(time, false)?;
            memory.event.states_changed |= memory.states() != before;
            info.states_changed = memory.event.states_changed;
            info.again = memory.find_changes()? || memory.due().is_some();
            if !info.again {
                memory.events.check_limits(time, M::Variables::EVENT_INDICATORS, M::Variables::LIMITS)?;
            }
            memory.event.states_changed &= info.again;
            memory.phase = phase;
        } else {
            // Newly set inputs and parameters may have moved it.
            let next = memory.next_event(time);
            memory.events.move_next(next, time)?;
            info.again = memory.due().is_some();
        }
        if let Some(end) = self.memory.end {
            info.terminate = true;
            self.logger.event(
                Status::Ok,
                format_args!("the model requests the end of the simulation at {} s", Seconds(end)),
            );
        }
        info.next = self.memory.events.next;
        self.memory.end_ticks();
        Ok((status, info))
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Answer {
        if self.memory.phase == Phase::EventMode && !M::Variables::STATE_NOMINALS.is_empty() {
            return Err(Error::new(
                "must not be called in the state Event Mode of a model with continuous states",
            ));
        }
        if !time.is_finite() {
            return Err(Error::new(format!("time is {}", Shown(time))));
        }
        self.memory.time = time;
        self.memory.stale = true;
        if self.memory.phase == Phase::EventMode {
            self.memory.event = EventUnderWay::default();
        }
        Ok(Status::Ok)
    }

    pub(crate) fn set_continuous_states(&mut self, states: &[f64]) -> Answer {
        if let Some(wrong) = states.iter().position(|state| !state.is_finite()) {
            let name = M::Variables::state_name(wrong);
            return Err(Error::new(format!("{} for the state {name}", Shown(states[wrong]))));
        }
        M::Variables::set_states(&mut self.memory.variables, |state| states[state]);
        self.memory.stale = true;
        Ok(Status::Ok)
    }

    pub(crate) fn get_continuous_states(&mut self, states: &mut [f64]) -> Answer {
        let status = self.compute_values()?;
        M::Variables::each_state(&self.memory.variables, |state, value| states[state] = value);
        // After a failed event they may be anything.
        if let Some(wrong) = states.iter().position(|state| !state.is_finite()) {
            let name = M::Variables::state_name(wrong);
            return Err(Error::new(format!("the state {name} is {}", Shown(states[wrong]))));
        }
        Ok(status)
    }

    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "as the other functions")]
    pub(crate) fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Answer {
        nominals.copy_from_slice(M::Variables::STATE_NOMINALS);
        Ok(Status::Ok)
    }

    /// Non-finite derivatives are discarded, so that the solver tries a shorter step.
    pub(crate) fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Answer {
        if self.is_beyond() {
            return Ok(Status::Discard);
        }
        let status = self.compute_values()?;
        let variables = &self.memory.variables;
        let mut wrong = None;
        M::Variables::each_derivative(variables, |state, value: f64| {
            derivatives[state] = value;
            if !value.is_finite() {
                wrong = wrong.or(Some((state, value)));
            }
        });
        if let Some((state, value)) = wrong {
            self.log_discarded(format_args!(
                "the derivative of {} is {} at {} s",
                M::Variables::state_name(state),
                Shown(value),
                Shown(self.memory.time)
            ));
            return Ok(Status::Discard);
        }
        Ok(status)
    }

    /// Whether a solver tries a state outside the equations' validity; if so, it is logged.
    fn is_beyond(&self) -> bool {
        let is_trial = self.memory.phase == Phase::ContinuousTimeMode;
        let beyond = self.memory.variables.first_beyond().filter(|_| is_trial);
        if let Some((state, value)) = beyond {
            self.log_discarded(format_args!(
                "the state {} is {} at {} s, outside the range in which the equations are valid",
                M::Variables::state_name(state),
                Shown(value),
                Shown(self.memory.time)
            ));
        }
        beyond.is_some()
    }

    /// Gets Reals, possibly including event indicators.
    pub(crate) fn get_real_with_indicators(
        &mut self,
        references: &[ValueReference],
        values: &mut [f64],
    ) -> Answer {
        let status = self.get_real(references, values)?;
        let indicator = |reference: &ValueReference| {
            let position = reference.checked_sub(M::Variables::FIRST_EVENT_INDICATOR)? as usize;
            (position < M::Variables::EVENT_INDICATORS.len()).then_some(position)
        };
        if references.iter().any(|reference| indicator(reference).is_some()) {
            let mut indicators = vec![0.0; M::Variables::EVENT_INDICATORS.len()];
            let of_indicators = in_default_environment(|| self.get_event_indicators(&mut indicators))?;
            for (value, position) in values.iter_mut().zip(references.iter().map(indicator)) {
                if let Some(position) = position {
                    *value = indicators[position];
                }
            }
            return Ok(status.max(of_indicators));
        }
        Ok(status)
    }

    pub(crate) fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Answer {
        if !indicators.is_empty() && self.is_beyond() {
            return Ok(Status::Discard);
        }
        let status = self.compute_values()?;
        indicators.fill(f64::NAN);
        self.memory.compute_indicators(indicators);
        if let Some(wrong) = indicators.iter().position(|indicator| !indicator.is_finite()) {
            self.log_discarded(format_args!(
                "the indicator {} is {} at {} s",
                M::Variables::EVENT_INDICATORS[wrong],
                Shown(indicators[wrong]),
                Shown(self.memory.time)
            ));
            return Ok(Status::Discard);
        }
        self.memory.events.shift(indicators);
        Ok(status)
    }
}
