//! Reading what connections and the record need of an instance: at communication points, and before and after events.

use anyhow::Result;
use fmu_package::{FmuVariable, ValueType};

use super::calls::Calls;
use super::fmu::Fmu;
use super::instance::Instance;
use super::selection::Selection;
use super::watch::{EventRow, Watch};

impl Fmu {
    /// Whether the FMU can tell the values of a variable that are numbers or texts.
    pub(crate) fn can_tell(&self, variable: &FmuVariable) -> bool {
        match variable.value_type() {
            ValueType::Other => false,
            ValueType::String => self.loaded.refuse_no_texts().is_ok(),
            _ => true,
        }
    }
}

impl Instance {
    /// Whether the FMU tells when it has events: in Model Exchange, and in co-simulation with Event Mode.
    #[must_use]
    pub fn reports_events(&self) -> bool {
        self.events().is_some()
    }

    /// Selects what [`Instance::read_watched`] reads.
    pub(crate) fn watch(&mut self, selection: Selection) -> Result<()> {
        self.refuse_other(&selection)?;
        let values = vec![0.0; selection.names().len()];
        self.calls.watch = Some(Watch { selection, values, events: None });
        Ok(())
    }

    /// From now on, reads the watched variables before and after each event, too.
    pub(crate) fn watch_events(&mut self) {
        let is_reported = self.reports_events();
        if let Some(watch) = self.calls.watch.as_mut().filter(|watch| is_reported && !watch.values.is_empty())
        {
            watch.events = Some(vec![]);
        }
    }

    /// Reads the watched variables.
    pub(crate) fn read_watched(&mut self) -> Result<&[f64]> {
        self.calls.read_watched()?;
        Ok(self.watched())
    }

    /// The watched variables as they were last read.
    pub(crate) fn watched(&self) -> &[f64] {
        self.calls.watch.as_ref().map_or(&[], |watch| &watch.values)
    }

    /// The texts of a watched variable that have occurred, by its index.
    pub(crate) fn watched_texts(&self, position: usize) -> &[String] {
        self.calls.watch.as_ref().map_or(&[], |watch| watch.selection.texts_of(position))
    }

    /// What was read at events since the last call of this function.
    pub(crate) fn take_events(&mut self) -> Vec<EventRow> {
        let events = self.calls.watch.as_mut().and_then(|watch| watch.events.as_mut());
        events.map(std::mem::take).unwrap_or_default()
    }
}

impl Calls {
    fn read_watched(&mut self) -> Result<()> {
        let Some(mut watch) = self.watch.take() else { return Ok(()) };
        let read = self.read(&mut watch.selection, &mut watch.values);
        self.watch = Some(watch);
        read
    }

    /// Reads the watched variables before or after an event at a time (s), if they are watched there.
    pub fn watch_event(&mut self, time: f64, is_after: bool) -> Result<()> {
        if self.watch.as_ref().is_some_and(|watch| watch.events.is_some()) {
            self.read_watched()?;
        }
        if let Some(Watch { values, events: Some(events), .. }) = &mut self.watch {
            events.push(EventRow { time, is_after, values: values.clone() });
        }
        Ok(())
    }
}
