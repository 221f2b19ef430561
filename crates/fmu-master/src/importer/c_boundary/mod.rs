//! The C side: the functions of an FMU's library and the calls to it, with all of the crate's `unsafe`.
//!
//! A library is foreign code and cannot be verified. This module keeps the importer's side of FMI: signatures as
//! declared by each version, valid pointers with their lengths, callbacks that outlive the instance (FMUs keep pointers
//! to them), no call after a fatal error, and no instance in two threads. A status is a plain number, since a careless
//! FMU may return any.
#![allow(unsafe_code)]

mod functions;
mod logger;

use std::cell::Cell;
use std::ffi::{CStr, CString, c_int, c_void};
use std::ptr;
use std::sync::Arc;

use fmu_export::fmi2::c_types::{
    CO_SIMULATION, Component, EventInfo, FALSE, FmuState, MODEL_EXCHANGE, TRUE, ValueReference,
};

use self::functions::{
    CompletedIntegratorStep, DirectionalDerivative, EventMode, Exchange, Instantiate, OfVersion, Update,
};
pub use self::functions::{Functions, NumberType, Vector};
use self::logger::{CallbackFunctions, Receiver, log_message};
use super::messages::{Message, Status};
use super::numbers::Numbers;

/// A clock's value when it ticks.
static TICKS: bool = true;
/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`, beside it.
const TERMINATED: c_int = 3;

/// An instance. It and its saved states stay in one thread.
pub struct Handle {
    component: Component,
    functions: Arc<Functions>,
    receiver: Box<Receiver>,
    /// When the experiment starts and stops (s), which FMI 3.0 takes with the initialization.
    experiment: Cell<(f64, Option<f64>)>,
    /// The relative tolerance that the FMU is given, if it is.
    pub(super) tolerance: Cell<Option<f64>>,
    /// In FMI 3.0, what the last step said.
    last_step: Cell<LastStep>,
    /// Whether `Terminate` is due before the instance is freed.
    steps: Cell<bool>,
    /// Whether a fatal error occurred, after which the standard forbids any call.
    is_dead: Cell<bool>,
    // The FMU may keep pointers to these.
    _callbacks: Box<CallbackFunctions>,
    _texts: [CString; 3],
}

/// What an FMU says after updating its discrete states.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discrete {
    /// Whether they need another update.
    pub needs_update: bool,
    /// Whether the FMU requests termination.
    pub terminates: bool,
    /// The time of its next time event (s).
    pub next_event: Option<f64>,
}

/// The results of an FMI 3.0 step besides its status.
#[derive(Clone, Copy, Default)]
struct LastStep {
    /// The time that it has reached (s).
    time: f64,
    /// Whether an event is to be handled.
    has_event: bool,
    /// Whether the FMU requests termination.
    terminates: bool,
}

impl Handle {
    pub fn new(functions: &Arc<Functions>, texts: [CString; 3]) -> Result<Self, Vec<Message>> {
        let receiver = Box::new(Receiver::new());
        let callbacks = Box::new(CallbackFunctions::new(&receiver));
        let is_exchange = functions.exchange.is_some();
        let [name, guid, resources] = &texts;
        let component = match functions.of_version {
            // SAFETY: the texts and the callbacks, in boxes that do not move, live as long as the instance.
            OfVersion::Two { instantiate, .. } => unsafe {
                instantiate(
                    name.as_ptr(),
                    if is_exchange { MODEL_EXCHANGE } else { CO_SIMULATION },
                    guid.as_ptr(),
                    resources.as_ptr(),
                    &raw const *callbacks,
                    FALSE,
                    TRUE,
                )
            },
            // SAFETY: as above. Not visible, but with messages.
            OfVersion::Three { instantiate: Instantiate::ModelExchange(instantiate), .. } => unsafe {
                instantiate(
                    name.as_ptr(),
                    guid.as_ptr(),
                    resources.as_ptr(),
                    false,
                    true,
                    &raw const *receiver,
                    log_message,
                )
            },
            // SAFETY: as above. Neither visible, nor with early return or intermediate updates, but with messages.
            OfVersion::Three { instantiate: Instantiate::CoSimulation(instantiate), .. } => unsafe {
                instantiate(
                    name.as_ptr(),
                    guid.as_ptr(),
                    resources.as_ptr(),
                    false,
                    true,
                    functions.event_mode.is_some(),
                    false,
                    ptr::null(),
                    0,
                    &raw const *receiver,
                    log_message,
                    ptr::null(),
                )
            },
        };
        if component.is_null() {
            return Err(receiver.take());
        }
        Ok(Self {
            component,
            functions: Arc::clone(functions),
            receiver,
            experiment: Cell::default(),
            tolerance: Cell::default(),
            last_step: Cell::default(),
            steps: Cell::new(false),
            is_dead: Cell::new(false),
            _callbacks: callbacks,
            _texts: texts,
        })
    }

    /// The messages since the last call of this function.
    pub fn take_messages(&self) -> Vec<Message> {
        self.receiver.take()
    }

    /// Calls a function, unless the instance is dead.
    fn call(&self, function: impl FnOnce(Component) -> c_int) -> Status {
        if self.is_dead.get() {
            return Status::FATAL;
        }
        let status = Status(function(self.component));
        if status == Status::FATAL {
            self.is_dead.set(true);
        }
        status
    }

    /// Sets when the experiment starts and stops (s).
    pub fn setup_experiment(&self, start_time: f64, stop_time: Option<f64>) -> Status {
        self.experiment.set((start_time, stop_time));
        let OfVersion::Two { setup_experiment, .. } = self.functions.of_version else { return Status::OK };
        let (is_defined, stop_time) = stop_time.map_or((FALSE, 0.0), |time| (TRUE, time));
        // SAFETY: the component is alive.
        self.call(|component| unsafe {
            let (has_tolerance, tolerance) =
                self.tolerance.get().map_or((FALSE, 0.0), |tolerance| (TRUE, tolerance));
            setup_experiment(component, has_tolerance, tolerance, start_time, is_defined, stop_time)
        })
    }

    pub fn enter_initialization_mode(&self) -> Status {
        let (start_time, stop_time) = self.experiment.get();
        // SAFETY: the component is alive.
        self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { enter_initialization_mode, .. } => enter_initialization_mode(component),
                OfVersion::Three { enter_initialization_mode, .. } => enter_initialization_mode(
                    component,
                    self.tolerance.get().is_some(),
                    self.tolerance.get().unwrap_or(0.0),
                    start_time,
                    stop_time.is_some(),
                    stop_time.unwrap_or(0.0),
                ),
            }
        })
    }

    pub fn exit_initialization_mode(&self) -> Status {
        // SAFETY: the component is alive.
        let status = self.call(|component| unsafe { (self.functions.exit_initialization_mode)(component) });
        self.steps.set(status.succeeded());
        status
    }

    /// Steps. A state that was saved may be restored after it.
    pub fn do_step(&self, time: f64, size: f64) -> Status {
        let (mut flags, mut reached) = ([0_u8; 3], f64::NAN);
        let [event, terminates, early] = &mut flags;
        // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
        let status = self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { do_step: Some(do_step), .. } => do_step(component, time, size, FALSE),
                OfVersion::Three { do_step: Some(do_step), .. } => {
                    do_step(component, time, size, false, event, terminates, early, &raw mut reached)
                }
                _ => unreachable!("only instances for co-simulation step themselves"),
            }
        });
        self.last_step.set(LastStep { time: reached, has_event: flags[0] != 0, terminates: flags[1] != 0 });
        self.steps.set(status.succeeded());
        status
    }

    /// After a step that succeeded, or in FMI 2.0 was discarded: whether the FMU asks for the end.
    pub fn terminates(&self) -> bool {
        let OfVersion::Two { get_boolean_status: Some(get), .. } = self.functions.of_version else {
            return self.last_step.get().terminates;
        };
        let mut terminates = FALSE;
        // SAFETY: the component is alive, the place to write to is ours.
        let status = self.call(|component| unsafe { get(component, TERMINATED, &raw mut terminates) });
        status.succeeded() && terminates != FALSE
    }

    /// After a discarded step or a request for termination: the time reached, if the FMU provides it.
    pub fn last_successful_time(&self) -> Option<f64> {
        let mut time = self.last_step.get().time;
        if let OfVersion::Two { get_real_status, .. } = self.functions.of_version {
            let get = get_real_status?;
            // SAFETY: the component is alive, the place to write to is ours.
            let status =
                self.call(|component| unsafe { get(component, LAST_SUCCESSFUL_TIME, &raw mut time) });
            if !status.succeeded() {
                return None;
            }
        }
        Some(time).filter(|time| time.is_finite())
    }

    /// After a step: whether the FMU has an event to handle.
    pub fn has_event(&self) -> bool {
        self.last_step.get().has_event
    }

    fn event_mode(&self) -> &EventMode {
        self.functions.event_mode.as_ref().expect("the functions of Event Mode are loaded")
    }

    fn exchange(&self) -> &Exchange {
        self.functions.exchange.as_ref().expect("the functions of Model Exchange are loaded")
    }

    /// Calls a function after initialization.
    fn run(&self, function: impl FnOnce(Component) -> c_int) -> Status {
        let status = self.call(function);
        if !status.succeeded() && status != Status::DISCARD {
            self.steps.set(false);
        }
        status
    }

    pub fn enter_event_mode(&self) -> Status {
        // SAFETY: the component is alive.
        self.run(|component| unsafe { (self.event_mode().enter)(component) })
    }

    /// Leaves Event Mode, for Continuous-Time Mode or Step Mode.
    pub fn leave_event_mode(&self) -> Status {
        // SAFETY: the component is alive.
        self.run(|component| unsafe { (self.event_mode().leave)(component) })
    }

    pub fn update_discrete_states(&self) -> (Status, Discrete) {
        match self.event_mode().update {
            Update::Two(update) => {
                let mut info = EventInfo {
                    new_discrete_states_needed: FALSE,
                    terminate_simulation: FALSE,
                    nominals_of_continuous_states_changed: FALSE,
                    values_of_continuous_states_changed: FALSE,
                    next_event_time_defined: FALSE,
                    next_event_time: 0.0,
                };
                // SAFETY: the component is alive, the place to write to is ours.
                let status = self.run(|component| unsafe { update(component, &raw mut info) });
                let next = (info.next_event_time_defined != FALSE).then_some(info.next_event_time);
                let discrete = Discrete {
                    needs_update: info.new_discrete_states_needed != FALSE,
                    terminates: info.terminate_simulation != FALSE,
                    next_event: next,
                };
                (status, discrete)
            }
            Update::Three { update, .. } => {
                let (mut flags, mut next) = ([0_u8; 5], 0.0);
                let [again, terminates, nominals, values, is_defined] = &mut flags;
                // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
                let status = self.run(|component| unsafe {
                    update(component, again, terminates, nominals, values, is_defined, &raw mut next)
                });
                let discrete = Discrete {
                    needs_update: flags[0] != 0,
                    terminates: flags[1] != 0,
                    next_event: (flags[4] != 0).then_some(next),
                };
                (status, discrete)
            }
        }
    }

    /// Lets clocks tick (FMI 3.0).
    pub fn tick(&self, clock: ValueReference) -> Status {
        let Update::Three { set_clock, .. } = self.event_mode().update else { return Status::OK };
        // SAFETY: the component is alive, both arrays have one element.
        self.run(|component| unsafe { set_clock(component, &raw const clock, 1, &raw const TICKS) })
    }

    /// A clock's interval in s and its qualifier (FMI 3.0).
    pub fn interval(&self, clock: ValueReference) -> (Status, f64, c_int) {
        let (mut interval, mut qualifier) = (0.0, 0);
        let Update::Three { interval: get, .. } = self.event_mode().update else {
            return (Status::OK, interval, qualifier);
        };
        // SAFETY: the component is alive, the arrays have one element.
        let status = self.run(|component| unsafe {
            get(component, &raw const clock, 1, &raw mut interval, &raw mut qualifier)
        });
        (status, interval, qualifier)
    }

    /// When a clock first ticks, in s after the start (FMI 3.0).
    pub fn shift(&self, clock: ValueReference) -> (Status, f64) {
        let mut shift = 0.0;
        let Update::Three { shift: get, .. } = self.event_mode().update else { return (Status::OK, shift) };
        // SAFETY: the component is alive, both arrays have one element.
        let status = self.run(|component| unsafe { get(component, &raw const clock, 1, &raw mut shift) });
        (status, shift)
    }

    pub fn set_time(&self, time: f64) -> Status {
        // SAFETY: the component is alive.
        self.run(|component| unsafe { (self.exchange().set_time)(component, time) })
    }

    /// Sets all continuous states.
    pub fn set_states(&self, states: &[f64]) -> Status {
        // SAFETY: the component is alive, and the pointer is to as many numbers.
        self.run(|component| unsafe {
            (self.exchange().set_states)(component, states.as_ptr(), states.len())
        })
    }

    /// Gets all numbers of a kind.
    pub fn get_vector(&self, vector: Vector, values: &mut [f64]) -> Status {
        // SAFETY: the component is alive, and the pointer is to as many numbers.
        self.run(|component| unsafe {
            (self.exchange().get[vector as usize])(component, values.as_mut_ptr(), values.len())
        })
    }

    /// The number of event indicators, where a function tells it (FMI 3.0).
    pub fn number_of_indicators(&self) -> Option<(Status, usize)> {
        let get = self.exchange().number_of_indicators?;
        let mut number = 0;
        // SAFETY: the component is alive, the place to write to is ours.
        let status = self.run(|component| unsafe { get(component, &raw mut number) });
        Some((status, number))
    }

    /// Completes a step of the integrator, of which no state is restored. Returns whether an event follows, and
    /// whether the FMU requests termination.
    pub fn completed_integrator_step(&self) -> (Status, [bool; 2]) {
        match self.exchange().completed_integrator_step {
            CompletedIntegratorStep::Two(complete) => {
                let mut flags = [FALSE; 2];
                let [event, terminates] = &mut flags;
                // SAFETY: the component is alive, the places to write to are ours.
                let status = self.run(|component| unsafe { complete(component, TRUE, event, terminates) });
                (status, flags.map(|flag| flag != FALSE))
            }
            CompletedIntegratorStep::Three(complete) => {
                let mut flags = [0_u8; 2];
                let [event, terminates] = &mut flags;
                // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
                let status = self.run(|component| unsafe { complete(component, true, event, terminates) });
                (status, flags.map(|flag| flag != 0))
            }
        }
    }

    /// The derivatives of unknowns along a direction of the knowns, whose arrays count as a whole; none where the FMU
    /// has no such function.
    pub fn directional_derivative(
        &self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        derivatives: &mut [f64],
    ) -> Option<Status> {
        let function = self.exchange().directional_derivative.as_ref()?;
        let (of, by) = (unknowns.as_ptr(), knowns.as_ptr());
        // SAFETY: the component is alive; in FMI 2.0 each reference has its number, in FMI 3.0 an FMU tells by the
        // numbers of values whether they are all.
        Some(self.run(|component| unsafe {
            match function {
                DirectionalDerivative::Two(get) => {
                    assert!(unknowns.len() <= derivatives.len() && knowns.len() <= seed.len());
                    get(
                        component,
                        of,
                        unknowns.len(),
                        by,
                        knowns.len(),
                        seed.as_ptr(),
                        derivatives.as_mut_ptr(),
                    )
                }
                DirectionalDerivative::Three(get) => get(
                    component,
                    of,
                    unknowns.len(),
                    by,
                    knowns.len(),
                    seed.as_ptr(),
                    seed.len(),
                    derivatives.as_mut_ptr(),
                    derivatives.len(),
                ),
            }
        }))
    }

    /// Gets numbers of a type.
    pub fn get(
        &self,
        number_type: NumberType,
        references: &[ValueReference],
        values: &mut Numbers,
    ) -> Status {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address_to_write());
        // SAFETY: the component is alive, the values have the type's memory; each reference has its value, or in FMI
        // 3.0 the array's, by whose number an FMU tells whether they are all.
        self.call(|component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two { numbers, .. } => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address)
                }
                OfVersion::Three { numbers, .. } => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address, size)
                }
            }
        })
    }

    /// Sets numbers of a type.
    pub fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Status {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address());
        // SAFETY: as in `get`.
        self.call(|component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two { numbers, .. } => {
                    numbers[number_type.0].1(component, references.as_ptr(), count, address)
                }
                OfVersion::Three { numbers, .. } => {
                    numbers[number_type.0].1(component, references.as_ptr(), count, address, size)
                }
            }
        })
    }

    fn refuse_other_memory(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) {
        assert_eq!(values.memory(), self.functions.numbers()[number_type.0].1, "values of this type");
        assert!(references.len() <= values.len(), "each reference has its value");
    }

    /// Sets one text.
    pub fn set_string(&self, reference: ValueReference, value: &CStr) -> Status {
        let text = value.as_ptr();
        let texts: *const c_void = (&raw const text).cast();
        // SAFETY: the component is alive, both arrays have one element.
        self.call(|component| unsafe {
            match self.functions.of_version {
                OfVersion::Two { set_string, .. } => set_string(component, &raw const reference, 1, texts),
                OfVersion::Three { set_string, .. } => {
                    set_string(component, &raw const reference, 1, texts, 1)
                }
            }
        })
    }

    /// Saves the state; none where the FMU has no such function.
    pub fn get_state(&self) -> Option<(Status, FmuState)> {
        let get = self.functions.get_state?;
        let mut state = ptr::null_mut();
        // SAFETY: the component is alive; a null state asks for a new one.
        let status = self.call(|component| unsafe { get(component, &raw mut state) });
        Some((status, state))
    }

    /// Restores a state; none where the FMU has no such function.
    pub fn set_state(&self, state: FmuState) -> Option<Status> {
        let set = self.functions.set_state?;
        // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
        let status = self.call(|component| unsafe { set(component, state) });
        // What a step before made impossible is possible again.
        self.steps.set(status.succeeded());
        Some(status)
    }

    pub fn free_state(&self, mut state: FmuState) {
        if let Some(free) = self.functions.free_state {
            // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
            self.call(|component| unsafe { free(component, &raw mut state) });
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        if self.steps.get() {
            // SAFETY: the component is alive.
            self.call(|component| unsafe { (self.functions.terminate)(component) });
        }
        if !self.is_dead.get() {
            // SAFETY: the component is alive, and this is the last call.
            unsafe { (self.functions.free_instance)(self.component) };
        }
    }
}
