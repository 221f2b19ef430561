//! Communication steps (FMI 2.0.5, section 4.2.1).

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_solve::display::Shown;
use fmu_solve::time::{self, summed_rounding};
use fmu_solve::{Error, Events};

use super::memory::Memory;
use super::{Answer, Instance, check_finite};
use crate::kinds::{InputsOf, Model, Step};
use crate::model::context::{Context, Timed};
use crate::model::description::{Capabilities, Version};
use crate::model::variables::Accessed as _;

impl<M: Model> Instance<M> {
    /// Advances by one communication step.
    pub(crate) fn do_step(&mut self, start: f64, size: f64) -> Answer {
        self.advance(start, size, |model, variables, step, _, context| {
            model.step(variables, step, context).map(|()| None)
        })
    }

    /// Advances by one communication step with `step`, or to an event in it, whose time (s) `step` returns.
    pub(super) fn advance(
        &mut self,
        start: f64,
        size: f64,
        step: impl FnOnce(
            &mut M,
            &mut M::Variables,
            &Step<'_, InputsOf<M>>,
            &mut Events,
            &mut Context<'_>,
        ) -> Result<Option<f64>, Error>,
    ) -> Answer {
        let end = start + size;
        if !self.can_step(start, size, end) {
            return Err(self.step_error(start, size, end));
        }
        let memory = &mut self.memory;
        if memory.end.is_some() {
            return Ok(self.discard_for_end(end));
        }
        memory.inputs.go_back(memory.variables.inputs_mut());
        if memory.accept_parameters()? {
            memory.model.refresh(memory.time, &mut memory.variables);
        }
        let mut status = Status::Ok;
        let logger = &self.logger;
        let mut log = Timed::new(start, |category, message| {
            status = status.max(logger.message(category, message));
        });
        let ahead = memory.ahead.at_start(memory.time, start);
        let ahead_at_end = ahead.after(start, size);
        let since = memory.experiment.start_time;
        let of_inputs = Step { start, size, inputs: &memory.inputs, ahead: ahead_at_end, since };
        // If an error or a panic interrupts the step, the instance stays in this state.
        memory.phase = Phase::Error;
        let mut context = Context::new(memory.experiment, &mut log).with_resources(&self.resources);
        let event =
            step(&mut memory.model, &mut memory.variables, &of_inputs, &mut memory.events, &mut context)?;
        let asked = context.end()?;
        check_finite(&memory.variables, event.unwrap_or(end))?;
        memory.stale = false;
        if let Some(asked) = asked {
            return Ok(self.end_step_early(asked, end));
        }
        memory.phase = Phase::StepComplete;
        memory.time = event.unwrap_or(end);
        memory.ahead = if event.is_some() { ahead } else { ahead_at_end };
        let size = event.map_or(size, |event| event - start);
        memory.inputs.end_step(size, memory.variables.inputs_mut());
        Ok(status)
    }

    /// The model requests the end at a time (s) within the step.
    #[cold]
    fn end_step_early(&mut self, asked: f64, end: f64) -> Status {
        // It may be off by rounding.
        let is_at_end = asked >= end - summed_rounding(end);
        self.memory.time = if is_at_end { end } else { asked.max(self.memory.time) };
        self.memory.end = Some(asked);
        self.discard_for_end(end)
    }

    /// The model requests the end: the step to `end` (s) is not completed (section 4.2.1).
    #[cold]
    fn discard_for_end(&mut self, end: f64) -> Status {
        let Capabilities { early_return, .. } = Self::DESCRIPTION.capabilities;
        // FMI 3.0.2, section 4.4: without `mightReturnEarlyFromDoStep` importers rely on whole steps.
        if Self::DESCRIPTION.version == Version::Three && !early_return && self.memory.time < end {
            self.logger.warning(format_args!(
                "the step ends early, at the model's request, which the FMU does not announce: its JSON must declare \
                 \"capabilities\": {{\"termination\": true}}"
            ));
        }
        self.memory.phase = Phase::StepFailed;
        self.log_discarded(format_args!(
            "the model requests the end of the simulation at {} s",
            Shown(self.memory.time)
        ));
        Status::Discard
    }

    /// Whether the model has requested the end.
    pub(crate) fn asks_for_end(&self) -> bool {
        self.memory.end.is_some()
    }

    /// Whether the next step may have this start, size and end (s). False for NaN.
    fn can_step(&self, start: f64, size: f64, end: f64) -> bool {
        size > 0.0
            && size <= M::LONGEST_STEP
            && time::goes_on(self.memory.time, start, size)
            && end > start
            // A step far shorter than the largest times cannot exceed them.
            && (M::LONGEST_STEP < 0.25 * f64::EPSILON * f64::MAX || end.is_finite())
            && self.stop_time().is_none_or(|stop_time| {
                time::ends_by(stop_time, end, size) || self.is_meant_to_end_by(stop_time, start, size)
            })
    }

    /// Whether only the sum of the step sizes is after a time (s).
    #[cold]
    fn is_meant_to_end_by(&self, last: f64, start: f64, size: f64) -> bool {
        let Memory { time, ahead, .. } = self.memory;
        let ahead = ahead.at_start(time, start).after(start, size);
        time::ends_by(last, ahead.meant(start + size), size)
    }

    pub(super) fn stop_time(&self) -> Option<f64> {
        self.memory.experiment.stop_time
    }

    /// Why a step is rejected.
    #[cold]
    fn step_error(&self, start: f64, size: f64, end: f64) -> Error {
        let [start_shown, size_shown] = [Shown(start), Shown(size)];
        Error::new(if !(size.is_finite() && size > 0.0) {
            format!("communicationStepSize is {size_shown}; it must be finite and greater than 0")
        } else if size > M::LONGEST_STEP {
            format!(
                "communicationStepSize is {size_shown} s; this FMU's longest step is {} s",
                Shown(M::LONGEST_STEP)
            )
        } else if !time::goes_on(self.memory.time, start, size) {
            format!(
                "currentCommunicationPoint is {start_shown}, but the last step ended at {}",
                Shown(self.memory.time)
            )
        } else if !end.is_finite() {
            format!("the step from {start_shown} ends at {}", Shown(end))
        } else if end <= start {
            format!(
                "communicationStepSize is {size_shown}, which is lost in the rounding of the time {start_shown}"
            )
        } else {
            format!(
                "the step from {start_shown} to {} goes past the stopTime {} of the experiment",
                Shown(end),
                Shown(self.stop_time().unwrap_or(f64::INFINITY))
            )
        })
    }

    /// The end of the last completed step (s).
    pub(crate) fn last_successful_time(&self) -> f64 {
        self.memory.time
    }
}
