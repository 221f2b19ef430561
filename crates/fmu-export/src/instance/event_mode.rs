//! Co-Simulation with Event Mode (FMI 3.0.2, section 4.2).

use super::{Answer, Instance};
use crate::calling_sequence::{Interface, Phase};
use crate::event_mode::{EventMode, EventsLeft};
use crate::status::Status;

impl<M: EventMode> Instance<M> {
    /// A communication step, which may end at an event. Whether the importer is to handle one.
    pub(crate) fn do_step_to_event(&mut self, start: f64, size: f64) -> Result<(Status, bool), crate::Error> {
        if self.memory.interface != Interface::CoSimulationWithEvents {
            return self.do_step(start, size).map(|status| (status, false));
        }
        let left = if self.early_return_allowed { EventsLeft::All } else { EventsLeft::AtEnd };
        let mut has_event = false;
        let status = self.advance(start, size, |model, variables, step, events, context| {
            let event = model.step_to_event(variables, step, events, left, context)?;
            has_event = event.is_some();
            Ok(event)
        })?;
        Ok((status, has_event))
    }

    pub(crate) fn enter_step_mode(&mut self) -> Answer {
        self.check_changed_parameters()?;
        let status = self.compute_values()?;
        self.memory.model.enter_step_mode();
        self.memory.phase = Phase::StepComplete;
        Ok(status)
    }
}
