//! Calls to an instance; their statuses become results.

use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::{Result, bail};

use super::c_boundary::{Common, Component, Experiment};
use super::fmu::Fmu;
use super::followed::Followed;
use super::messages::{self, CallFailed, Called, Ended, Message, Status};
use super::selection::{Group, Selection};
use super::watch::Watch;

/// Calls an instance, and keeps what it says.
pub struct Calls {
    pub fmu: Arc<Fmu>,
    pub name: String,
    pub handle: Rc<dyn Common>,
    /// What the FMU is told of the experiment.
    pub experiment: Experiment,
    /// Whether the FMU has directional derivatives that were not found wrong.
    pub has_directional_derivatives: bool,
    /// The variables that are read at communication points and events, if there are any.
    pub watch: Option<Watch>,
    /// The inputs that follow functions of time, in Model Exchange, if there are any.
    pub followed: Option<Followed>,
    warnings: Vec<Message>,
    /// The variables of which a warning has said that they are not numbers.
    not_numbers: BTreeSet<String>,
}

impl Calls {
    pub fn new(fmu: Arc<Fmu>, name: &str, handle: Rc<dyn Common>) -> Self {
        let has_directional_derivatives = fmu.has_directional_derivatives();
        Self {
            fmu,
            name: name.to_owned(),
            handle,
            experiment: Experiment::default(),
            has_directional_derivatives,
            watch: None,
            followed: None,
            warnings: vec![],
            not_numbers: BTreeSet::new(),
        }
    }

    pub fn component(&self) -> &Component {
        self.handle.component()
    }

    /// The time that the instance has reached (s); none before the experiment is set up.
    pub fn time(&self) -> Option<f64> {
        self.component().time.get()
    }

    /// Takes note of the time that the instance has reached (s).
    pub fn set_time(&self, time: Option<f64>) {
        self.component().time.set(time);
    }

    /// The FMU's warnings since the last call of this function, the oldest first.
    pub fn take_warnings(&mut self) -> Vec<Message> {
        self.collect();
        std::mem::take(&mut self.warnings)
    }

    /// Warns of the FMU.
    pub fn warn(&mut self, text: String) {
        self.collect();
        self.warnings.push(Message { status: Status::WARNING, text, time: self.time() });
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
        let messages = self.component().take_messages().into_iter();
        let warnings = messages.filter(|message| message.status == Status::WARNING);
        self.warnings.extend(warnings.map(|message| messages::with_names(message, self.fmu.description())));
    }

    /// Turns a call's status into a result.
    pub fn check(&mut self, variables: &[String], called: Called) -> Result<()> {
        self.check_with(variables, called, || None)
    }

    /// Turns a call's status into a result; an error has the time (s) that a discarded step has reached, if it is known.
    pub fn check_with(
        &mut self,
        variables: &[String],
        Called { function, status }: Called,
        last_successful_time: impl FnOnce() -> Option<f64>,
    ) -> Result<()> {
        if status == Status::OK {
            return Ok(());
        }
        if status.succeeded() {
            self.collect();
            return Ok(());
        }
        bail!(CallFailed {
            instance: self.name.clone(),
            function,
            variables: variables.to_owned(),
            time: self.time(),
            status: Some(status),
            messages: messages::telling(self.component().take_messages(), self.fmu.description()),
            last_successful_time: last_successful_time(),
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

    /// Reads the variables of a selection of this FMU.
    pub fn read(&mut self, selection: &mut Selection, values: &mut [f64]) -> Result<()> {
        for group in &mut selection.groups {
            self.read_group(group, &selection.names)?;
            group.scatter(values);
        }
        for texts in &mut selection.texts {
            let (called, read) = self.handle.get_strings(texts.reference, texts.count())?;
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
}
