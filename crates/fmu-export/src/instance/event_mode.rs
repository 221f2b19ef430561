//! Co-Simulation with Event Mode and Intermediate Update Mode (FMI 3.0.2, section 4.2).

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_solve::{Error, EventsLeft, Stop, Stops};
use fmu_terms::InstanceType;

use super::{Answer, Instance, IntermediateCallback};
use crate::kinds::Model;
use crate::model::description::{Causality, DataType, ValueReference, Variability, VariableDescription};
use crate::model::variables::Described as _;

impl<M: Model> Instance<M> {
    /// A communication step, which may end at an event, or pause at the end of an internal step for an intermediate
    /// update. Returns whether the importer has an event to handle.
    pub(crate) fn do_step_to_event(&mut self, start: f64, size: f64) -> Result<(Status, bool), Error> {
        let internal_steps = self.intermediate_update.is_some();
        let has_event_mode = self.memory.instance_type == InstanceType::CoSimulationWithEvents;
        if !has_event_mode && !internal_steps {
            return self.do_step(start, size).map(|status| (status, false));
        }
        let events = match (has_event_mode, self.early_return_allowed) {
            (true, true) => EventsLeft::All,
            (true, false) => EventsLeft::AtEnd,
            (false, _) => EventsLeft::None,
        };
        let stops = Stops { events, internal_steps };
        let mut stop = None;
        let status = self.advance(start, size, |model, variables, step, events, context| {
            stop = model.step_to_event(variables, step, has_event_mode.then_some(events), stops, context)?;
            Ok(stop.map(Stop::time))
        })?;
        if let Some(Stop::InternalStep(_)) = stop
            && self.memory.phase == Phase::StepComplete
        {
            self.memory.phase = Phase::IntermediateUpdateMode;
        }
        Ok((status, matches!(stop, Some(Stop::Event(_)))))
    }

    /// The time in s of the intermediate update at which the communication step pauses, if any, and the callback.
    pub(crate) fn interruption(&self) -> Option<(f64, IntermediateCallback)> {
        let update = self.intermediate_update.as_ref().filter(|_| self.is_interrupted())?;
        Some((self.memory.time, update.callback))
    }

    /// Ends an intermediate update. Returns whether the step can continue, which it cannot after an error.
    pub(crate) fn resume(&mut self) -> bool {
        let goes_on = self.is_interrupted();
        if goes_on {
            self.memory.phase = Phase::StepComplete;
        }
        goes_on
    }

    pub(crate) fn enter_step_mode(&mut self) -> Answer {
        self.memory.accept_parameters()?;
        let status = self.compute_values()?;
        self.memory.end_ticks();
        self.memory.model.enter_step_mode();
        self.memory.phase = Phase::StepComplete;
        Ok(status)
    }
}

impl<M: Model> Instance<M> {
    fn is_interrupted(&self) -> bool {
        self.memory.phase == Phase::IntermediateUpdateMode
    }

    /// Rejects, in an intermediate update, variables that the importer did not register for it.
    pub(crate) fn check_registered(&self, references: &[ValueReference]) -> Result<(), Error> {
        let registered = self.intermediate_update.as_ref().map_or(&[][..], |update| &update.registered);
        match references.iter().find(|reference| !registered.contains(reference)) {
            Some(&reference) if self.is_interrupted() => Err(Error::new(format!(
                "the variable {} with the value reference {reference} is not one of requiredIntermediateVariables",
                name_of::<M>(reference)
            ))),
            _ => Ok(()),
        }
    }
}

/// A variable's name for messages.
pub(crate) fn name_of<M: Model>(reference: ValueReference) -> String {
    M::Variables::description(reference).map_or("unknown".to_owned(), |variable| variable.name().to_string())
}

/// Whether intermediate updates can exchange a variable: `intermediateUpdate`.
pub(crate) fn has_intermediate_update(variable: &VariableDescription) -> bool {
    variable.data_type == DataType::Real
        && variable.variability == Variability::Continuous
        && matches!(variable.causality, Causality::Input | Causality::Output)
}
