//! Calls to an instance; their statuses become results.

use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::{Result, bail};
use fmu_solve::display::Seconds;

use super::c_boundary::{Handle, Vector};
use super::fmu::Fmu;
use super::followed::Followed;
use super::messages::{self, CallFailed, Called, Ended, Message, Status};
use super::selection::{Group, Selection};
use super::watch::Watch;

/// Calls an instance, and keeps what it says.
pub struct Calls {
    pub fmu: Arc<Fmu>,
    pub name: String,
    pub handle: Rc<Handle>,
    /// Whether the FMU has directional derivatives that were not found wrong.
    pub has_directional_derivatives: bool,
    /// The variables that are read at communication points and events, if there are any.
    pub watch: Option<Watch>,
    /// The inputs that follow functions of time, in Model Exchange, if there are any.
    pub followed: Option<Followed>,
    warnings: Vec<Message>,
    /// Whether a warning has said that a step returned early though it may not.
    has_returned_early: bool,
    /// The variables of which a warning has said that they are not numbers.
    not_numbers: BTreeSet<String>,
}

impl Calls {
    pub fn new(fmu: Arc<Fmu>, name: &str, handle: Handle) -> Self {
        let has_directional_derivatives = fmu.has_directional_derivatives();
        Self {
            fmu,
            name: name.to_owned(),
            handle: Rc::new(handle),
            has_directional_derivatives,
            watch: None,
            followed: None,
            warnings: vec![],
            has_returned_early: false,
            not_numbers: BTreeSet::new(),
        }
    }

    /// The FMU's warnings since the last call of this function, the oldest first.
    pub fn take_warnings(&mut self) -> Vec<Message> {
        self.collect();
        std::mem::take(&mut self.warnings)
    }

    /// Warns of the FMU.
    pub fn warn(&mut self, text: String) {
        self.collect();
        self.warnings.push(Message { status: Status::WARNING, text, time: self.handle.time.get() });
    }

    /// Warns of values that are not numbers, once for each variable.
    pub fn warn_of_no_numbers(&mut self, names: &[String], values: &[f64]) {
        for (name, _) in names.iter().zip(values).filter(|(_, value)| value.is_nan()) {
            if self.not_numbers.insert(name.clone()) {
                self.warn(format!("{name} is not a number (NaN)"));
            }
        }
    }

    /// Keeps the warnings among messages.
    fn collect(&mut self) {
        let messages = self.handle.take_messages().into_iter();
        let warnings = messages.filter(|message| message.status == Status::WARNING);
        self.warnings.extend(warnings.map(|message| messages::with_names(message, self.fmu.description())));
    }

    /// Turns a call's status into a result.
    pub fn check(&mut self, variables: &[String], Called { function, status }: Called) -> Result<()> {
        if status == Status::OK {
            return Ok(());
        }
        if status.succeeded() {
            self.collect();
            return Ok(());
        }
        let function = function.to_string();
        let is_discarded_step = status == Status::DISCARD && function.ends_with("DoStep");
        bail!(CallFailed {
            instance: self.name.clone(),
            function,
            variables: variables.to_owned(),
            time: self.handle.time.get(),
            status: Some(status),
            messages: messages::telling(self.handle.take_messages(), self.fmu.description()),
            last_successful_time: if is_discarded_step { self.handle.last_successful_time() } else { None },
        });
    }

    /// Ends the simulation at a time (s), as the FMU requested.
    ///
    /// # Errors
    /// Always.
    pub fn end(&mut self, time: f64) -> Result<()> {
        self.collect();
        bail!(Ended { instance: self.name.clone(), time });
    }

    /// Lets an FMU for co-simulation step, from a time (s) by a size (s). Returns the time (s) at which it returned early,
    /// if it did.
    pub fn do_step(&mut self, time: f64, size: f64) -> Result<Option<f64>> {
        let called = self.handle.do_step(time, size);
        // In FMI 2.0 the step is then discarded; in FMI 3.0 it succeeds.
        let may_end = if self.fmu.description().is_fmi3() {
            called.status.succeeded()
        } else {
            called.status == Status::DISCARD
        };
        if may_end && self.handle.terminates() {
            return self.end(self.handle.last_successful_time().unwrap_or(time + size)).map(|()| None);
        }
        self.check(&[], called)?;
        let early = self.handle.returned_early().filter(|reached| *reached < time + size);
        if let Some(reached) = early {
            // An event may be due at once.
            let may_stay = self.handle.may_return_early && self.handle.has_event();
            if reached < time || reached <= time && !may_stay {
                bail!("{}: the step from {} s returned early, and has not moved", self.name, Seconds(time));
            }
            if !self.handle.may_return_early && !self.has_returned_early {
                self.has_returned_early = true;
                self.warn(format!(
                    "fmi3DoStep returned early at {} s, though earlyReturnAllowed is false; it is called again",
                    Seconds(reached)
                ));
            }
        }
        self.handle.time.set(Some(early.unwrap_or(time + size)));
        Ok(early)
    }

    /// Reads the variables of a selection of this FMU.
    pub fn read(&mut self, selection: &mut Selection, values: &mut [f64]) -> Result<()> {
        for group in &mut selection.groups {
            self.read_group(group, &selection.names)?;
            group.scatter(values);
        }
        for texts in &mut selection.texts {
            let (called, read) = self.handle.get_strings(texts.reference, texts.count());
            self.check(&selection.names, called)?;
            texts.scatter(read, values);
        }
        self.warn_of_no_numbers(&selection.names, values);
        Ok(())
    }

    pub fn read_group(&mut self, group: &mut Group, names: &[String]) -> Result<()> {
        let called = self.handle.get(group.number_type, &group.references, &mut group.values);
        self.check(names, called)
    }

    /// Sets the variables of a selection of this FMU to values that they take. The elements of arrays that are not
    /// selected keep their values.
    pub fn write(&mut self, selection: &mut Selection, values: &[f64]) -> Result<()> {
        // FMUs may refuse to be read once an input is set.
        for group in selection.groups.iter_mut().filter(|group| group.has_other_elements()) {
            self.read_group(group, &selection.names)?;
        }
        for group in &mut selection.groups {
            group.gather(values);
            let called = self.handle.set(group.number_type, &group.references, &group.values);
            self.check(&selection.names, called)?;
        }
        Ok(())
    }

    /// Sets time (s), the inputs that follow it, and the continuous states.
    pub fn go_to(&mut self, time: f64, states: &[f64]) -> Result<()> {
        self.check(&[], self.handle.set_time(time))?;
        self.follow(time)?;
        if states.is_empty() {
            return Ok(());
        }
        self.check(&[], self.handle.set_states(states))
    }

    /// Gets all numbers of a vector, unless it is empty.
    pub fn get_vector(&mut self, vector: Vector, values: &mut [f64]) -> Result<()> {
        if values.is_empty() {
            return Ok(());
        }
        self.check(&[], self.handle.get_vector(vector, values))
    }
}
