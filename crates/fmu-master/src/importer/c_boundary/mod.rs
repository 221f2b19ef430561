//! The C boundary: the functions of an FMU's library and the calls to them, with all `unsafe` code of the crate.
//!
//! A library is foreign code and cannot be verified. This module fulfills the importer's obligations in FMI: signatures
//! as declared by each version, valid pointers with their lengths, callbacks that outlive the instance (FMUs keep
//! pointers to them), no call after a fatal error, and no instance in two threads. A status is a plain number, because
//! a careless FMU may return any.
#![allow(unsafe_code)]

mod functions;
mod last_call;
mod live;
mod logger;
pub mod process;

use std::cell::Cell;
use std::ffi::{CStr, CString, c_int};
use std::ptr;
use std::sync::Arc;

use fmu_abi::fmi2::c_types::{
    CO_SIMULATION, Component, EventInfo, FALSE, FmuState, MODEL_EXCHANGE, TRUE, ValueReference,
    status_kind::{LAST_SUCCESSFUL_TIME, TERMINATED},
};
use fmu_abi::fmi3::c_types as fmi3;

pub use self::functions::{Functions, NumberType};
use self::functions::{Instantiate, OfVersion};
pub use self::live::when_an_fmu_exits;
use self::live::{Call, Live};
use self::logger::{CallbackFunctions, log_message, text_at};
use super::messages::{Called, Function, Message, Status};
use super::numbers::Numbers;

/// The most dependencies of a variable that are read, of some 24 bytes each.
const MOST_DEPENDENCIES: usize = 10_000_000;
/// The status of a function that the FMU's interface does not have; no caller gets there.
const MISUSED: c_int = 3;

/// Numbers that a solver reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    States,
    Nominals,
    Derivatives,
    Indicators,
}

/// An instance. It and its saved states stay in one thread.
pub struct Handle {
    component: Component,
    functions: Arc<Functions>,
    live: Live,
    /// The time reached (s); none before the experiment is set up.
    pub(super) time: Cell<Option<f64>>,
    /// When the experiment starts and stops (s), which FMI 3.0 takes with the initialization.
    experiment: Cell<(f64, Option<f64>)>,
    /// The relative tolerance that the FMU gets, if any.
    pub(super) tolerance: Cell<Option<f64>>,
    /// What the last step said, in FMI 3.0.
    last_step: Cell<LastStep>,
    /// Whether `Terminate` is due before the instance is freed.
    steps: Cell<bool>,
    /// Whether a step may return early.
    pub(super) may_return_early: bool,
    /// The saved states that live: none is a promise that nothing goes back before the present point.
    saved_states: Cell<usize>,
    /// Whether a fatal error occurred, after which the standard forbids any call.
    is_dead: Cell<bool>,
    callbacks: Arc<CallbackFunctions>,
    // The FMU may keep pointers to these.
    _texts: [CString; 3],
}

/// What an element of a variable depends on; elements count from 1, and 0 is all of them (FMI 3.0.2, section 2.2.10).
#[derive(Clone, Copy, Debug)]
pub struct Dependency {
    pub element: usize,
    pub on: ValueReference,
    pub element_of_it: usize,
}

/// The FMU's answer after updating its discrete states.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discrete {
    /// Whether the discrete states need another update.
    pub needs_update: bool,
    /// Whether the FMU requests termination.
    pub terminates: bool,
    /// The time of its next time event (s).
    pub next_event: Option<f64>,
}

/// The results of an FMI 3.0 step in addition to its status.
#[derive(Clone, Copy, Default)]
struct LastStep {
    /// The time that the step has reached (s).
    time: f64,
    /// Whether an event is to be handled.
    has_event: bool,
    /// Whether the FMU requests termination.
    terminates: bool,
    /// Whether the function has returned before the end of the step.
    is_early: bool,
}

impl Handle {
    /// Makes an instance of a name; that of FMI 3.0 for co-simulation may use Event Mode, and return early.
    ///
    /// # Errors
    /// If the FMU refuses: the function that does, and its messages.
    pub fn new(
        functions: &Arc<Functions>,
        instance: &str,
        [uses_event_mode, may_return_early]: [bool; 2],
        texts: [CString; 3],
    ) -> Result<Self, (Function, Vec<Message>)> {
        let live = Live::new(instance.to_owned());
        let (callbacks, environment) = (functions.callbacks(), live.environment());
        callbacks.set_environment(environment);
        let [name, guid, resources] = texts.each_ref().map(|text| text.as_ptr());
        let function = functions.function(functions.instantiate.name());
        // SAFETY: the texts live as long as the instance, the callbacks as long as the library. The instance is not
        // visible and sends messages; in FMI 3.0 it calls in no step.
        let component = live.call(Call::Of(function, None), || unsafe {
            match functions.instantiate {
                Instantiate::Two(instantiate) => {
                    let kind = if functions.exchange.is_some() { MODEL_EXCHANGE } else { CO_SIMULATION };
                    instantiate(name, kind, guid, resources, &raw const *callbacks, FALSE, TRUE)
                }
                Instantiate::ModelExchange3(instantiate) => instantiate(
                    name,
                    guid,
                    resources,
                    fmi3::FALSE,
                    fmi3::TRUE,
                    environment,
                    Some(log_message),
                ),
                Instantiate::CoSimulation3(instantiate) => instantiate(
                    name,
                    guid,
                    resources,
                    fmi3::FALSE,
                    fmi3::TRUE,
                    uses_event_mode.into(),
                    may_return_early.into(),
                    ptr::null(),
                    0,
                    environment,
                    Some(log_message),
                    None,
                ),
            }
        });
        if component.is_null() {
            functions.take_back(callbacks);
            return Err((function, live.take()));
        }
        Ok(Self {
            component,
            functions: Arc::clone(functions),
            live,
            time: Cell::default(),
            experiment: Cell::default(),
            tolerance: Cell::default(),
            last_step: Cell::default(),
            steps: Cell::new(false),
            may_return_early,
            saved_states: Cell::new(0),
            is_dead: Cell::new(false),
            callbacks,
            _texts: texts,
        })
    }

    /// The messages since the last call of this function.
    pub fn take_messages(&self) -> Vec<Message> {
        self.live.take()
    }

    /// Calls a function, unless the instance is dead.
    fn call(&self, name: &'static str, function: impl FnOnce(Component) -> c_int) -> Called {
        self.call_of_type([name, ""], function)
    }

    /// Calls a function with a type in its name, unless the instance is dead.
    fn call_of_type(&self, name: [&'static str; 2], function: impl FnOnce(Component) -> c_int) -> Called {
        let named = self.functions.function(name);
        if self.is_dead.get() {
            return Called { function: named, status: Status::FATAL };
        }
        let call = Call::Of(named, self.time.get());
        let status = Status(self.live.call(call, || function(self.component)));
        if status == Status::FATAL {
            self.is_dead.set(true);
        }
        if !status.succeeded() && status != Status::DISCARD {
            self.steps.set(false);
        }
        Called { function: named, status }
    }

    /// Sets when the experiment starts and stops (s).
    pub fn setup_experiment(&self, start_time: f64, stop_time: Option<f64>) -> Called {
        self.experiment.set((start_time, stop_time));
        let (is_defined, stop_time) = stop_time.map_or((FALSE, 0.0), |time| (TRUE, time));
        let (has_tolerance, tolerance) =
            self.tolerance.get().map_or((FALSE, 0.0), |tolerance| (TRUE, tolerance));
        // SAFETY: the component is alive.
        self.call("SetupExperiment", |component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two(common, _) => (common.setup_experiment)(
                    component,
                    has_tolerance,
                    tolerance,
                    start_time,
                    is_defined,
                    stop_time,
                ),
                OfVersion::Three(..) => Status::OK.0,
            }
        })
    }

    pub fn enter_initialization_mode(&self) -> Called {
        let (start_time, stop_time) = self.experiment.get();
        // SAFETY: the component is alive.
        self.call("EnterInitializationMode", |component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two(common, _) => (common.enter_initialization_mode)(component),
                OfVersion::Three(common, _) => (common.enter_initialization_mode)(
                    component,
                    self.tolerance.get().is_some().into(),
                    self.tolerance.get().unwrap_or(0.0),
                    start_time,
                    stop_time.is_some().into(),
                    stop_time.unwrap_or(0.0),
                ),
            }
        })
    }

    pub fn exit_initialization_mode(&self) -> Called {
        // SAFETY: the component is alive.
        let called = self.call("ExitInitializationMode", |component| unsafe {
            (self.functions.common.exit_initialization_mode)(component)
        });
        self.steps.set(called.status.succeeded());
        called
    }

    /// Whether no state before the present point is restored (FMI 2.0.5, section 4.2.2: noSetFMUStatePriorToCurrentPoint).
    fn goes_on(&self) -> bool {
        self.saved_states.get() == 0
    }

    /// Steps.
    pub fn do_step(&self, time: f64, size: f64) -> Called {
        let (mut flags, mut reached) = ([0_u8; 3], f64::NAN);
        let [event, terminates, early] = &mut flags;
        // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
        let called = self.call("DoStep", |component| unsafe {
            match (&self.functions.step2, &self.functions.step3) {
                (Some(of), _) => (of.do_step)(component, time, size, self.goes_on().into()),
                (_, Some(of)) => (of.do_step)(
                    component,
                    time,
                    size,
                    self.goes_on().into(),
                    event,
                    terminates,
                    early,
                    &raw mut reached,
                ),
                _ => MISUSED,
            }
        });
        let [has_event, terminates, is_early] = flags.map(|flag| flag != 0);
        self.last_step.set(LastStep { time: reached, has_event, terminates, is_early });
        self.steps.set(called.status.succeeded());
        called
    }

    /// The time at which the last step of an FMU of FMI 3.0 returned early (s), if it did.
    pub fn returned_early(&self) -> Option<f64> {
        let LastStep { time, is_early, .. } = self.last_step.get();
        is_early.then_some(time)
    }

    /// After a step that succeeded, or in FMI 2.0 was discarded: whether the FMU asks for the end.
    pub fn terminates(&self) -> bool {
        let Some(status) = &self.functions.boolean_status2 else {
            return self.last_step.get().terminates;
        };
        let mut terminates = FALSE;
        // SAFETY: the component is alive, the place to write to is ours.
        let called = self.call("GetBooleanStatus", |component| unsafe {
            (status.get)(component, TERMINATED, &raw mut terminates)
        });
        called.status.succeeded() && terminates != FALSE
    }

    /// The time reached by a discarded step or a request for termination, if the FMU provides it.
    pub fn last_successful_time(&self) -> Option<f64> {
        let mut time = self.last_step.get().time;
        if !self.functions.is_fmi3() {
            let get = self.functions.real_status2.as_ref()?.get;
            // SAFETY: the component is alive, the place to write to is ours.
            let called = self.call("GetRealStatus", |component| unsafe {
                get(component, LAST_SUCCESSFUL_TIME, &raw mut time)
            });
            if !called.status.succeeded() {
                return None;
            }
        }
        Some(time).filter(|time| time.is_finite())
    }

    /// Whether the FMU has an event to handle after a step.
    pub fn has_event(&self) -> bool {
        self.last_step.get().has_event
    }

    pub fn enter_event_mode(&self) -> Called {
        // SAFETY: the component is alive.
        self.call("EnterEventMode", |component| unsafe {
            match (&self.functions.exchange, &self.functions.events3) {
                (Some(exchange), _) => (exchange.enter_event_mode)(component),
                (_, Some(events)) => (events.enter_event_mode)(component),
                _ => MISUSED,
            }
        })
    }

    /// Leaves Event Mode, for Continuous-Time Mode or Step Mode.
    pub fn leave_event_mode(&self) -> Called {
        let is_exchange = self.functions.exchange.is_some();
        let name = if is_exchange { "EnterContinuousTimeMode" } else { "EnterStepMode" };
        // SAFETY: the component is alive.
        self.call(name, |component| unsafe {
            match (&self.functions.exchange, &self.functions.events3) {
                (Some(exchange), _) => (exchange.enter_continuous_time_mode)(component),
                (_, Some(events)) => (events.enter_step_mode)(component),
                _ => MISUSED,
            }
        })
    }

    pub fn update_discrete_states(&self) -> (Called, Discrete) {
        let (mut info, mut flags, mut next) = (EventInfo::default(), [0_u8; 5], 0.0);
        let [again, ends, nominals, values, defined] = &mut flags;
        let name = if self.functions.is_fmi3() { "UpdateDiscreteStates" } else { "NewDiscreteStates" };
        // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
        let called = self.call(name, |component| unsafe {
            match (&self.functions.exchange2, &self.functions.events3) {
                (Some(of), _) => (of.new_discrete_states)(component, &raw mut info),
                (_, Some(of)) => (of.update_discrete_states)(
                    component,
                    again,
                    ends,
                    nominals,
                    values,
                    defined,
                    &raw mut next,
                ),
                _ => MISUSED,
            }
        });
        // One of both is untouched.
        let info_next = (info.next_event_time_defined != FALSE).then_some(info.next_event_time);
        let discrete = Discrete {
            needs_update: flags[0] != 0 || info.new_discrete_states_needed != FALSE,
            terminates: flags[1] != 0 || info.terminate_simulation != FALSE,
            next_event: info_next.or((flags[4] != 0).then_some(next)),
        };
        (called, discrete)
    }

    /// Lets a clock tick (FMI 3.0).
    pub fn tick(&self, clock: ValueReference) -> Called {
        let ticks: fmi3::Clock = fmi3::TRUE;
        // SAFETY: the component is alive, both arrays have one element.
        self.call("SetClock", |component| unsafe {
            match &self.functions.events3 {
                Some(events) => (events.set_clock)(component, &raw const clock, 1, &raw const ticks),
                None => MISUSED,
            }
        })
    }

    /// A clock's interval in s and its qualifier (FMI 3.0).
    pub fn interval(&self, clock: ValueReference) -> (Called, f64, c_int) {
        let (mut interval, mut qualifier) = (0.0, 0);
        // SAFETY: the component is alive, the arrays have one element.
        let called = self.call("GetIntervalDecimal", |component| unsafe {
            match &self.functions.events3 {
                Some(events) => (events.get_interval)(
                    component,
                    &raw const clock,
                    1,
                    &raw mut interval,
                    &raw mut qualifier,
                ),
                None => MISUSED,
            }
        });
        (called, interval, qualifier)
    }

    /// When a clock first ticks, in s after the start (FMI 3.0).
    pub fn shift(&self, clock: ValueReference) -> (Called, f64) {
        let mut shift = 0.0;
        // SAFETY: the component is alive, both arrays have one element.
        let called = self.call("GetShiftDecimal", |component| unsafe {
            match &self.functions.events3 {
                Some(events) => (events.get_shift)(component, &raw const clock, 1, &raw mut shift),
                None => MISUSED,
            }
        });
        (called, shift)
    }

    /// Goes to a time (s) between events.
    pub fn set_time(&self, time: f64) -> Called {
        self.time.set(Some(time));
        // SAFETY: the component is alive.
        self.call("SetTime", |component| unsafe {
            match &self.functions.exchange {
                Some(exchange) => (exchange.set_time)(component, time),
                None => MISUSED,
            }
        })
    }

    /// Sets all continuous states.
    pub fn set_states(&self, states: &[f64]) -> Called {
        // SAFETY: the component is alive, and the pointer is to as many numbers.
        self.call("SetContinuousStates", |component| unsafe {
            match &self.functions.exchange {
                Some(exchange) => (exchange.set_states)(component, states.as_ptr(), states.len()),
                None => MISUSED,
            }
        })
    }

    /// Gets all numbers of a kind.
    pub fn get_vector(&self, vector: Vector, values: &mut [f64]) -> Called {
        let exchange = self.functions.exchange.as_ref();
        let (name, get) = match vector {
            Vector::States => ("GetContinuousStates", exchange.map(|of| of.states)),
            Vector::Nominals => ("GetNominalsOfContinuousStates", exchange.map(|of| of.nominals)),
            Vector::Indicators => ("GetEventIndicators", exchange.map(|of| of.indicators)),
            Vector::Derivatives => {
                let name =
                    if self.functions.is_fmi3() { "GetContinuousStateDerivatives" } else { "GetDerivatives" };
                (name, exchange.map(|of| of.derivatives))
            }
        };
        // SAFETY: the component is alive, and the pointer is to as many numbers.
        self.call(name, |component| unsafe {
            get.map_or(MISUSED, |get| get(component, values.as_mut_ptr(), values.len()))
        })
    }

    /// Completes a step of the integrator. Returns whether an event follows, and whether the FMU requests termination.
    pub fn completed_integrator_step(&self) -> (Called, [bool; 2]) {
        let (mut words, mut bytes) = ([FALSE; 2], [0_u8; 2]);
        let ([event, ends], [event3, ends3]) = (&mut words, &mut bytes);
        // SAFETY: the component is alive, the places to write to are ours; a C `bool` is a byte.
        let called = self.call("CompletedIntegratorStep", |component| unsafe {
            match (&self.functions.exchange2, &self.functions.exchange3) {
                (Some(of), _) => {
                    (of.completed_integrator_step)(component, self.goes_on().into(), event, ends)
                }
                (_, Some(of)) => {
                    (of.completed_integrator_step)(component, self.goes_on().into(), event3, ends3)
                }
                _ => MISUSED,
            }
        });
        // One of both is untouched.
        (called, [0, 1].map(|flag| words[flag] != FALSE || bytes[flag] != 0))
    }

    /// The derivatives of unknowns along a direction of the knowns, whose arrays count as a whole.
    pub fn directional_derivative(
        &self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        derivatives: &mut [f64],
    ) -> Called {
        let (of, by) = (unknowns.as_ptr(), knowns.as_ptr());
        let (of_count, by_count, seeds, count) =
            (unknowns.len(), knowns.len(), seed.len(), derivatives.len());
        assert!(of_count <= count && by_count <= seeds, "each reference has its number");
        let (seed, derivatives) = (seed.as_ptr(), derivatives.as_mut_ptr());
        // SAFETY: the component is alive. Each scalar reference has one number; in FMI 3.0 an array reference has all its
        // elements, and the FMU checks the total count.
        let call = |component| unsafe {
            match (&self.functions.directional2, &self.functions.directional3) {
                (Some(of_two), _) => (of_two.get)(component, of, of_count, by, by_count, seed, derivatives),
                (_, Some(of_three)) => {
                    (of_three.get)(component, of, of_count, by, by_count, seed, seeds, derivatives, count)
                }
                _ => MISUSED,
            }
        };
        self.call("GetDirectionalDerivative", call)
    }

    /// What a variable of FMI 3.0 depends on.
    pub fn dependencies(&self, of: ValueReference) -> (Called, Vec<Dependency>) {
        let mut count = 0;
        // SAFETY: the component is alive, the place to write to is ours.
        let called = self.call("GetNumberOfVariableDependencies", |component| unsafe {
            self.functions
                .dependencies3
                .as_ref()
                .map_or(MISUSED, |it| (it.count)(component, of, &raw mut count))
        });
        // More than all pairs of elements of the largest arrays are none.
        if !called.status.succeeded() || count > MOST_DEPENDENCIES {
            return (called, vec![]);
        }
        let (mut elements, mut independents) = (vec![0; count], vec![0; count]);
        let (mut elements_of_independents, mut kinds) = (vec![0; count], vec![0; count]);
        // SAFETY: the component is alive, and each place to write to is ours and has as many elements as is said.
        let called = self.call("GetVariableDependencies", |component| unsafe {
            self.functions.dependencies3.as_ref().map_or(MISUSED, |it| {
                let (elements, independents) = (elements.as_mut_ptr(), independents.as_mut_ptr());
                let (others, kinds) = (elements_of_independents.as_mut_ptr(), kinds.as_mut_ptr());
                (it.get)(component, of, elements, independents, others, kinds, count)
            })
        });
        let pairs = elements.into_iter().zip(independents.into_iter().zip(elements_of_independents));
        let dependency = |(element, (on, element_of_it))| Dependency { element, on, element_of_it };
        (called, pairs.map(dependency).collect())
    }

    /// Gets numbers of a type.
    pub fn get(
        &self,
        number_type: NumberType,
        references: &[ValueReference],
        values: &mut Numbers,
    ) -> Called {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address_to_write());
        // SAFETY: the component is alive, and the values have the type's memory. Each scalar reference has one value; in
        // FMI 3.0 an array reference has all its elements, and the FMU checks the total count.
        self.call_of_type(["Get", self.functions.name(number_type)], |component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two(_, numbers) => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address)
                }
                OfVersion::Three(_, numbers) => {
                    numbers[number_type.0].0(component, references.as_ptr(), count, address, size)
                }
            }
        })
    }

    /// Sets numbers of a type.
    pub fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Called {
        self.refuse_other_memory(number_type, references, values);
        let (count, size, address) = (references.len(), values.len(), values.address());
        // SAFETY: as in `get`.
        self.call_of_type(["Set", self.functions.name(number_type)], |component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two(_, numbers) => {
                    numbers[number_type.0].1(component, references.as_ptr(), count, address)
                }
                OfVersion::Three(_, numbers) => {
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
    pub fn set_string(&self, reference: ValueReference, value: &CStr) -> Called {
        let text = value.as_ptr();
        let texts = &raw const text;
        // SAFETY: the component is alive, both arrays have one element.
        self.call("SetString", |component| unsafe {
            match &self.functions.of_version {
                OfVersion::Two(common, _) => (common.set_string)(component, &raw const reference, 1, texts),
                OfVersion::Three(common, _) => {
                    (common.set_string)(component, &raw const reference, 1, texts, 1)
                }
            }
        })
    }

    /// The texts of a variable, which is an array if there are several.
    pub fn get_strings(&self, reference: ValueReference, count: usize) -> (Called, Vec<String>) {
        let mut texts = vec![ptr::null(); count];
        // SAFETY: the component is alive, and the pointers are as many as the variable's values, which the FMU checks.
        let called = self.call("GetString", |component| unsafe {
            match (&self.functions.strings2, &self.functions.strings3) {
                (Some(of), _) => (of.get)(component, &raw const reference, 1, texts.as_mut_ptr()),
                (_, Some(of)) => (of.get)(component, &raw const reference, 1, texts.as_mut_ptr(), count),
                _ => MISUSED,
            }
        });
        if !called.status.succeeded() {
            return (called, vec![]);
        }
        // SAFETY: each is null or a text of the FMU, which stays until its next call.
        let copy = |text: &_| unsafe { text_at(*text) }.unwrap_or_default();
        (called, texts.iter().map(copy).collect())
    }

    /// Saves the state, with whether `Terminate` is due in it; none where the FMU has no such function.
    pub fn get_state(&self) -> Option<(Called, FmuState, bool)> {
        let get = self.functions.states.as_ref()?.get;
        let mut state = ptr::null_mut();
        // SAFETY: the component is alive; a null state asks for a new one.
        let called = self.call_of_type(["Get", self.functions.state()], |component| unsafe {
            get(component, &raw mut state)
        });
        if called.status.succeeded() {
            self.saved_states.update(|count| count + 1);
        }
        Some((called, state, self.steps.get()))
    }

    /// Restores a state, in which `Terminate` is due or not; none where the FMU has no such function.
    pub fn set_state(&self, state: FmuState, steps: bool) -> Option<Called> {
        let set = self.functions.states.as_ref()?.set;
        // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
        let called =
            self.call_of_type(["Set", self.functions.state()], |component| unsafe { set(component, state) });
        // Restoring a state makes possible again what an earlier step made impossible.
        self.steps.set(called.status.succeeded() && steps);
        Some(called)
    }

    pub fn free_state(&self, mut state: FmuState) {
        self.saved_states.update(|count| count.saturating_sub(1));
        if let Some(states) = &self.functions.states {
            // SAFETY: the component is alive, and the state is one that it gave and that is not freed.
            self.call_of_type(["Free", self.functions.state()], |component| unsafe {
                (states.free)(component, &raw mut state)
            });
        }
    }
}

impl Handle {
    /// Ends the run, unless none has begun. That it fails is a warning, as all results are there.
    pub fn terminate(&self) {
        if self.steps.replace(false) {
            // SAFETY: the component is alive.
            let called =
                self.call("Terminate", |component| unsafe { (self.functions.common.terminate)(component) });
            if !called.status.succeeded() {
                self.live.add(Message {
                    status: Status::WARNING,
                    text: called.to_string(),
                    time: self.time.get(),
                });
            }
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // Nobody takes what it says from here on.
        self.live.take();
        self.terminate();
        if !self.is_dead.get() {
            let call = Call::Of(self.functions.function(["FreeInstance", ""]), self.time.get());
            // SAFETY: the component is alive, and this is the last call.
            self.live.call(call, || unsafe { (self.functions.common.free_instance)(self.component) });
        }
        self.live.print();
        self.functions.take_back(Arc::clone(&self.callbacks));
    }
}
