//! Instances: initialization, steps, values and saved states.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::MAIN_SEPARATOR;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_abi::ValueReference;
use fmu_package::{FmuVariable, ParameterSet, Value};
use fmu_solve::time::coincidence;
use fmu_terms::Version;

use super::c_boundary::{Common, Experiment, Handle, NotMade, Saved, UseOfEvents};
use super::calls::Calls;
use super::event_mode::EventMode;
use super::exchange::Exchange;
use super::fmu::{Fmu, reference};
use super::folder;
use super::messages::{self, CallFailed, Message};
use super::selection::Selection;
use super::solver::Solver;
use super::stepping::Stepping;

impl Fmu {
    /// Creates an instance, with logging on. An FMU with the flag [`ONLY_ONCE`](super::ONLY_ONCE) allows one per process.
    ///
    /// # Errors
    /// When the FMU refuses, as a [`CallFailed`] with its messages, or `name` contains a NUL byte.
    pub fn instantiate(self: &Arc<Self>, name: &str) -> Result<Instance> {
        self.instance(name, false)
    }

    /// Creates an instance for co-simulation of FMI 3.0 with Event Mode, whose steps return early for events. Its results
    /// may differ from those of [`Fmu::instantiate`], with which the FMU handles events itself, unless it has clocks.
    ///
    /// # Errors
    /// When [`Fmu::refuse_no_event_mode`] or [`Fmu::instantiate`] fails.
    pub fn instantiate_with_early_return(self: &Arc<Self>, name: &str) -> Result<Instance> {
        self.refuse_no_event_mode()?;
        self.instance(name, true)
    }

    fn instance(self: &Arc<Self>, name: &str, may_return_early: bool) -> Result<Instance> {
        let resources = self.loaded.folder().join("resources");
        let resources = match self.description().version() {
            Version::Two => folder::uri(&resources),
            Version::Three => format!("{}{MAIN_SEPARATOR}", resources.display()),
        };
        let texts = [name, self.description().guid(), &resources].map(CString::new);
        let [Ok(name_text), Ok(guid), Ok(resources)] = texts else {
            bail!("the name {name:?} contains a NUL byte")
        };
        let in_event_mode = self.needs_event_mode || may_return_early;
        let events = UseOfEvents { in_event_mode, by_early_return: may_return_early };
        let handle = self.loaded.instantiate([name_text, guid, resources], events);
        let handle = handle.map_err(|NotMade { function, messages }| CallFailed {
            instance: name.to_owned(),
            function,
            variables: vec![],
            time: None,
            status: None,
            last_successful_time: None,
            messages: messages::telling(messages, self.description()),
        })?;
        let calls = Calls::new(Arc::clone(self), name, handle.common());
        let advance = match handle {
            Handle::CoSimulation(handle) => {
                Advance::CoSimulation(Stepping::new(handle, may_return_early), None)
            }
            Handle::EventCoSimulation(handle) => Advance::CoSimulation(
                Stepping::new(Rc::clone(&handle) as _, may_return_early),
                Some(EventMode::new(&calls, handle)?),
            ),
            Handle::ModelExchange(handle) => Advance::ModelExchange(
                Exchange::new(Rc::clone(&handle)),
                EventMode::new(&calls, handle)?,
                None,
            ),
        };
        Ok(Instance { calls, advance, arrays: Some(BTreeMap::new()) })
    }
}

/// How an instance goes on in time.
enum Advance {
    /// The FMU steps, and handles its events in Event Mode if it uses that.
    CoSimulation(Stepping, Option<EventMode>),
    /// This crate integrates the FMU's equations, once it is initialized.
    ModelExchange(Exchange, EventMode, Option<Box<Solver>>),
}

/// An instance of an [`Fmu`], bound to the thread that created it. Dropping it terminates and frees it.
///
/// The order of calls is that of FMI: [`set_up`](Self::set_up), [`enter_initialization`](Self::enter_initialization),
/// [`exit_initialization`](Self::exit_initialization), and then [`step`](Self::step) for each communication step.
/// Values may be set at any point that the variable allows.
///
/// Each call fails with a [`CallFailed`] when the FMU does not return `fmi2OK` or `fmi2Warning`. After a fatal error
/// the FMU is not called again.
pub struct Instance {
    pub(super) calls: Calls,
    advance: Advance,
    /// The arrays that were set before Initialization Mode, when they cannot be read; none after.
    arrays: Option<BTreeMap<ValueReference, Vec<f64>>>,
}

/// A saved state, which the instance can restore any number of times.
pub struct SavedState {
    saved: Saved,
    handle: Rc<dyn Common>,
    time: Option<f64>,
    events: Option<EventMode>,
    solver: Option<Box<Solver>>,
    arrays: Option<BTreeMap<ValueReference, Vec<f64>>>,
}

impl Drop for SavedState {
    fn drop(&mut self) {
        self.handle.component().free_state(self.saved);
    }
}

impl Advance {
    /// The events, if the instance uses Event Mode, and the solver, if there is one.
    fn parts(&mut self) -> (Option<&mut EventMode>, Option<&mut Box<Solver>>) {
        match self {
            Self::CoSimulation(_, events) => (events.as_mut(), None),
            Self::ModelExchange(_, events, solver) => (Some(events), solver.as_mut()),
        }
    }

    /// The events, if the instance uses Event Mode.
    fn events_mut(&mut self) -> Option<&mut EventMode> {
        self.parts().0
    }
}

impl Instance {
    /// The instance's name, with which error messages begin.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.calls.name
    }

    /// The FMU that created the instance.
    #[must_use]
    pub fn fmu(&self) -> &Arc<Fmu> {
        &self.calls.fmu
    }

    /// The FMU's warnings since the last call of this function, the oldest first.
    pub fn take_warnings(&mut self) -> Vec<Message> {
        self.calls.take_warnings()
    }

    /// Ends the run, as dropping the instance does. That the FMU fails to do so is one of its
    /// [warnings](Self::take_warnings).
    pub fn terminate(&mut self) {
        self.calls.component().terminate();
    }

    /// Sets the relative tolerance of the FMU's integrator, before [`Instance::set_up`]. In Model Exchange it is that
    /// of this crate's integrator; the default there is [`DEFAULT_TOLERANCE`](fmu_solve::DEFAULT_TOLERANCE).
    pub fn set_tolerance(&mut self, tolerance: Option<f64>) {
        self.calls.experiment.tolerance = tolerance;
    }

    /// Sets the experiment's times (s); values may be set before. FMUs of FMI 3.0 get them on
    /// [entering initialization](Self::enter_initialization).
    ///
    /// # Errors
    /// When the call fails.
    pub fn set_up(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<()> {
        let experiment = Experiment { start_time, stop_time, ..self.calls.experiment };
        self.calls.experiment = experiment;
        if let Some(called) = self.calls.handle.set_up_experiment(&experiment) {
            self.calls.check(&[], called)?;
        }
        self.calls.set_time(Some(start_time));
        Ok(())
    }

    /// Begins the initialization, in which outputs can be read and inputs set.
    ///
    /// # Errors
    /// When the call fails.
    pub fn enter_initialization(&mut self) -> Result<()> {
        let called = self.calls.handle.enter_initialization_mode(&self.calls.experiment);
        self.calls.check(&[], called)?;
        self.arrays = None;
        Ok(())
    }

    /// Ends the initialization; steps follow.
    ///
    /// # Errors
    /// When the call fails.
    pub fn exit_initialization(&mut self) -> Result<()> {
        self.leave_initialization()?;
        let time = self.calls.time().unwrap_or(0.0);
        self.finish_event(time, time)
    }

    /// Ends the initialization. An FMU with Event Mode is in Event Mode then.
    pub(crate) fn leave_initialization(&mut self) -> Result<()> {
        let Self { calls, advance, .. } = self;
        let time = calls.time().unwrap_or(0.0);
        if let Some(events) = advance.events_mut() {
            events.initialize(calls, time)?;
        }
        let called = calls.component().exit_initialization_mode();
        calls.check(&[], called)?;
        if let Some(events) = advance.events_mut() {
            events.begin();
        }
        if let Advance::ModelExchange(exchange, _, solver) = advance {
            *solver = Some(Box::new(Solver::new(calls, exchange, time)?));
        }
        Ok(())
    }

    /// Initializes an experiment with the values set so far: [`set_up`](Self::set_up),
    /// [`enter_initialization`](Self::enter_initialization) and [`exit_initialization`](Self::exit_initialization).
    ///
    /// # Errors
    /// When a call fails.
    pub fn initialize(&mut self, start_time: f64, stop_time: Option<f64>) -> Result<()> {
        self.set_up(start_time, stop_time)?;
        self.enter_initialization()?;
        self.exit_initialization()
    }

    /// Steps from a time (s) by a size (s). In Model Exchange the states are integrated over the step, with the inputs
    /// held and events handled at their times.
    ///
    /// # Errors
    /// [`Ended`](super::Ended) when the FMU requests the end of the simulation; its values are then those at the end.
    /// Otherwise when a call fails; after a discarded step, [`CallFailed::last_successful_time`] is the time reached.
    pub fn step(&mut self, time: f64, size: f64) -> Result<()> {
        self.advance(time, size)?;
        let end = time + size;
        let until = end + coincidence(size, end);
        if !self.is_due(until) {
            return Ok(());
        }
        self.calls.watch_event(end, false)?;
        self.begin_event(end, until)?;
        self.finish_event(end, until)?;
        self.calls.watch_event(end, true)
    }

    /// Steps as [`Instance::step`] does, but leaves events at the end of the step to the communication point there.
    pub(crate) fn advance(&mut self, time: f64, size: f64) -> Result<()> {
        let Self { calls, advance, .. } = self;
        match advance {
            Advance::ModelExchange(_, events, Some(solver)) => solver.step(calls, events, time, size),
            Advance::ModelExchange(..) => bail!("{}: the instance is not initialized", calls.name),
            Advance::CoSimulation(stepping, Some(events)) => events.co_simulate(calls, stepping, time, size),
            Advance::CoSimulation(stepping, None) => {
                let end = time + size;
                let mut early = stepping.step(calls, time, size)?.early_return;
                while let Some(reached) = early {
                    early = stepping.step(calls, reached, end - reached)?.early_return;
                }
                Ok(())
            }
        }
    }

    /// The events, in Model Exchange and in co-simulation with Event Mode.
    pub(super) fn events(&self) -> Option<&EventMode> {
        match &self.advance {
            Advance::CoSimulation(_, events) => events.as_ref(),
            Advance::ModelExchange(_, events, _) => Some(events),
        }
    }

    /// The FMU's equations, in Model Exchange.
    pub(super) fn exchange(&self) -> Option<&Exchange> {
        match &self.advance {
            Advance::CoSimulation(..) => None,
            Advance::ModelExchange(exchange, ..) => Some(exchange),
        }
    }

    /// Whether the FMU has to act at a communication point in Event Mode: there are events until a time (s), or
    /// changed inputs.
    pub(crate) fn is_due(&self, until: f64) -> bool {
        self.events().is_some_and(|events| events.is_due(until))
    }

    /// Whether an input that follows a course jumps until a time (s).
    pub(crate) fn jumps_until(&self, until: f64) -> bool {
        self.calls.next_jump().is_some_and(|jump| jump <= until)
    }

    /// Whether the FMU has events until a time (s) other than changes of inputs.
    pub(crate) fn has_due_events(&self, until: f64) -> bool {
        self.events().is_some_and(|events| events.has_due(until))
    }

    /// Brings an FMU with Event Mode to a communication point (s), whose events are until a time (s), and enters it. Its
    /// inputs can be set then.
    pub(crate) fn begin_event(&mut self, point: f64, until: f64) -> Result<()> {
        let Self { calls, advance, .. } = self;
        let (events, solver) = advance.parts();
        let Some(events) = events.filter(|events| !events.is_entered()) else { return Ok(()) };
        let time = events.time_at(point, until);
        if let Some(solver) = solver {
            solver.go_to(calls, time)?;
        }
        events.enter(calls)?;
        calls.begin_stretch(time)
    }

    /// Handles the events at a communication point (s), until a time (s), and leaves Event Mode.
    pub(crate) fn finish_event(&mut self, point: f64, until: f64) -> Result<()> {
        let Self { calls, advance, .. } = self;
        let (events, solver) = advance.parts();
        let Some(events) = events else { return Ok(()) };
        let time = events.time_at(point, until);
        let late = until - time;
        match solver {
            Some(solver) => {
                let is_sharp = events.has_due(until);
                solver.handle(calls, events, (time, late), is_sharp, false)
            }
            None => events.handle(calls, (time, late), false),
        }
    }

    /// Enters Event Mode, if the instance has it, before a value is set.
    fn prepare_to_set(&mut self) -> Result<()> {
        match self.advance.events_mut() {
            Some(events) => events.enter(&mut self.calls),
            None => Ok(()),
        }
    }

    /// Rejects a selection of another FMU.
    pub(super) fn refuse_other(&self, selection: &Selection) -> Result<()> {
        if Arc::ptr_eq(&selection.loaded, &self.calls.fmu.loaded) {
            return Ok(());
        }
        bail!("{}: the variables were selected from another FMU", self.calls.name)
    }

    /// Reads variables, one value for each name of the selection. Allocates nothing.
    ///
    /// # Errors
    /// When the selection is of another FMU, or a call fails.
    ///
    /// # Panics
    /// When there are fewer values than names.
    pub fn read(&mut self, selection: &mut Selection, values: &mut [f64]) -> Result<()> {
        self.refuse_other(selection)?;
        self.calls.read(selection, values)
    }

    /// Sets variables, one value for each name of the selection. A Float32 is rounded; an Integer takes whole numbers of
    /// its range, an Enumeration those of its items, a Boolean 0 and 1. Elements of an array that are not selected stay.
    ///
    /// # Errors
    /// When the selection is of another FMU, a variable does not take its value, or a call fails.
    ///
    /// # Panics
    /// When there are fewer values than names.
    pub fn write(&mut self, selection: &mut Selection, values: &[f64]) -> Result<()> {
        self.refuse_other(selection)?;
        let fitted = selection.fitted(values)?;
        let written = self.write_fitted(selection, &fitted);
        selection.give_back(fitted);
        written
    }

    /// Sets variables to values that they take.
    pub(crate) fn write_fitted(&mut self, selection: &mut Selection, values: &[f64]) -> Result<()> {
        self.prepare_to_set()?;
        self.calls.warn_of_no_numbers(&selection.names, values);
        let Some(arrays) = &mut self.arrays else { return self.calls.write(selection, values) };
        for group in &mut selection.groups {
            // Elements not selected keep their values, which are those of the description or set before.
            group.begin_with(arrays, &self.calls.fmu);
            group.gather(values);
            arrays.extend(group.values_of_arrays());
            let called = self.calls.handle.set(group.number_type, &group.references, &group.values);
            self.calls.check(&selection.names, called)?;
        }
        Ok(())
    }

    /// The current value of a numeric variable, in the unit that the FMU declares. [`Instance::read`] resolves names
    /// only once.
    ///
    /// # Errors
    /// When there is no numeric variable of this name, or the call fails.
    pub fn get(&mut self, name: &str) -> Result<f64> {
        let mut value = [0.0];
        let mut selection = self.calls.fmu.select([name])?;
        self.read(&mut selection, &mut value)?;
        Ok(value[0])
    }

    /// Sets a variable to a value of its type, in its unit or one that converts to it. An Enumeration takes the name of
    /// an item or its number. A number is in the unit that the FMU declares.
    ///
    /// # Errors
    /// When there is no variable of this name, the value does not fit its type or unit, or the call fails.
    pub fn set(&mut self, name: &str, value: impl Into<Value>) -> Result<()> {
        let fmu = Arc::clone(&self.calls.fmu);
        let variable = fmu.variable(name)?;
        self.set_fitted(variable, &value.into().fit(variable, &[], fmu.description())?)
    }

    /// Sets the variables of a parameter set (SSP), converted to their units.
    ///
    /// # Errors
    /// When the set does not [fit](ParameterSet::fit) the FMU, in which case nothing is set, or a call fails.
    pub fn set_parameters(&mut self, set: &ParameterSet) -> Result<()> {
        let fmu = Arc::clone(&self.calls.fmu);
        let fitted =
            set.fit(fmu.description()).with_context(|| format!("the parameter set '{}'", set.name))?;
        fitted
            .parameters
            .iter()
            .try_for_each(|parameter| self.set_fitted(fmu.variable(&parameter.name)?, &parameter.value))
    }

    /// Sets a variable to a fitting value.
    fn set_fitted(&mut self, variable: &FmuVariable, value: &Value) -> Result<()> {
        let name = &variable.name;
        let number = match value {
            Value::Enumeration(item) => {
                let enumeration = self.calls.fmu.description().enumeration(&variable.declared_type);
                let items = enumeration.map_or(&[] as &[_], |known| known.items.as_slice());
                let number = items.iter().find(|(known, _)| known == item).map(|(_, number)| *number);
                f64::from(number.with_context(|| format!("{name} has no item {item}"))?)
            }
            Value::String(value) => {
                if variable.element.is_some() {
                    bail!("{name} is in an array of texts, which cannot be set");
                }
                let text =
                    CString::new(value.as_str()).with_context(|| format!("{name} contains a NUL byte"))?;
                self.prepare_to_set()?;
                let called = self.calls.handle.set_string(reference(variable)?, &text);
                return self.calls.check(std::slice::from_ref(name), called);
            }
            value => value.number().with_context(|| format!("{name} is not a number"))?,
        };
        let mut selection = self.calls.fmu.select([name.as_str()])?;
        self.write(&mut selection, &[number])
    }

    /// Saves the state of the FMU.
    ///
    /// # Errors
    /// When the FMU cannot save its state (capability `canGetAndSetFMUstate`), or the call fails.
    pub fn save(&mut self) -> Result<SavedState> {
        let Ok((called, saved)) = self.calls.component().get_state() else {
            bail!("{}: the FMU cannot save its state", self.calls.name);
        };
        self.calls.check(&[], called)?;
        let (events, solver) = self.advance.parts();
        Ok(SavedState {
            saved,
            handle: Rc::clone(&self.calls.handle),
            time: self.calls.time(),
            events: events.cloned(),
            solver: solver.cloned(),
            arrays: self.arrays.clone(),
        })
    }

    /// Restores a state that this instance saved.
    ///
    /// # Errors
    /// When the state belongs to another instance, the FMU cannot restore states, or the call fails.
    pub fn restore(&mut self, saved: &SavedState) -> Result<()> {
        if !Rc::ptr_eq(&self.calls.handle, &saved.handle) {
            bail!("{}: the state belongs to another instance", self.calls.name);
        }
        let Ok(called) = self.calls.component().set_state(saved.saved) else {
            bail!("{}: the FMU cannot restore its state", self.calls.name);
        };
        self.calls.check(&[], called)?;
        self.calls.set_time(saved.time);
        match &mut self.advance {
            Advance::CoSimulation(_, events) => events.clone_from(&saved.events),
            Advance::ModelExchange(_, events, solver) => {
                if let Some(saved) = &saved.events {
                    events.clone_from(saved);
                }
                solver.clone_from(&saved.solver);
            }
        }
        self.arrays.clone_from(&saved.arrays);
        if let Some(followed) = &mut self.calls.followed {
            followed.forget();
        }
        Ok(())
    }
}
