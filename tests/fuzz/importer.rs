//! An importer that makes given calls, and checks each result.

use std::ffi::{CString, c_char};
use std::marker::PhantomData;
use std::ptr;

use fmu_export::fmi2::c_types::{
    Boolean, CO_SIMULATION, CallbackFunctions, Component, EventInfo, FALSE, FmuState, MODEL_EXCHANGE, Status,
    status_kind,
};
use fmu_export::{Model, ModelExchange, Variables as _, fmi2::c_api};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use super::calls::{Call, Number, PLACES, Time, Type, Vector};
use super::standard::{State, allows};

/// The status of a call, and the bits of the returned values.
pub type Answer = (Status, Vec<u64>);

/// The interface of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    CoSimulation,
    ModelExchange,
}

/// The functions of an FMU that depend on its interfaces.
#[derive(Clone, Copy)]
pub struct Functions {
    exit_initialization_mode: unsafe fn(Component) -> Status,
    exchange: Option<Exchange>,
}

/// Those of Model Exchange.
#[derive(Clone, Copy)]
struct Exchange {
    enter_event_mode: unsafe fn(Component) -> Status,
    new_discrete_states: unsafe fn(Component, *mut EventInfo) -> Status,
    enter_continuous_time_mode: unsafe fn(Component) -> Status,
    completed_integrator_step: unsafe fn(Component, Boolean, *mut Boolean, *mut Boolean) -> Status,
    set_time: unsafe fn(Component, f64) -> Status,
    set_continuous_states: unsafe fn(Component, *const f64, usize) -> Status,
    get_derivatives: Getter,
    get_event_indicators: Getter,
    get_continuous_states: Getter,
    get_nominals: Getter,
}

type Getter = unsafe fn(Component, *mut f64, usize) -> Status;

impl Functions {
    /// Those of co-simulation alone.
    pub fn co_simulation<M: Model>() -> Self {
        Self { exit_initialization_mode: c_api::exit_initialization_mode::<M>, exchange: None }
    }

    /// Those of both interfaces.
    pub fn both<M: ModelExchange>() -> Self {
        Self {
            exit_initialization_mode: c_api::exit_initialization_mode_with_events::<M>,
            exchange: Some(Exchange {
                enter_event_mode: c_api::enter_event_mode::<M>,
                new_discrete_states: c_api::new_discrete_states::<M>,
                enter_continuous_time_mode: c_api::enter_continuous_time_mode::<M>,
                completed_integrator_step: c_api::completed_integrator_step::<M>,
                set_time: c_api::set_time::<M>,
                set_continuous_states: c_api::set_continuous_states::<M>,
                get_derivatives: c_api::get_derivatives::<M>,
                get_event_indicators: c_api::get_event_indicators::<M>,
                get_continuous_states: c_api::get_continuous_states::<M>,
                get_nominals: c_api::get_nominals_of_continuous_states::<M>,
            }),
        }
    }
}

/// The bytes of an instance's state, and the importer's data about it.
#[derive(Clone, PartialEq)]
pub struct Snapshot {
    pub bytes: Vec<u8>,
    at: Whereabouts,
}

/// The progress of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Whereabouts {
    state: State,
    /// Whether the experiment was set up.
    set_up: bool,
    /// The time, in Model Exchange.
    time: f64,
    /// The time event that was announced last.
    next_event: f64,
}

impl Whereabouts {
    const FRESH: Self = Self { state: State::Instantiated, set_up: false, time: 0.0, next_event: 0.0 };
}

/// An instance with its saved states.
pub struct Importer<M: Model> {
    pub component: Component,
    interface: Interface,
    functions: Functions,
    at: Whereabouts,
    /// Slots for states, each with the progress of the instance at that time.
    places: [(FmuState, Whereabouts); PLACES],
    /// The number of calls.
    pub calls: u64,
    model: PhantomData<M>,
}

impl<M: Model> Drop for Importer<M> {
    fn drop(&mut self) {
        // SAFETY: the component belongs to this importer, and this is its last use. It frees the states as well.
        unsafe { c_api::free_instance::<M>(self.component) }
    }
}

// SAFETY of every call below: the component belongs to this importer and is used by this thread only; arrays have
// the passed lengths; results outlive the call.
impl<M: Model> Importer<M> {
    pub fn new(interface: Interface, functions: Functions) -> Self {
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: ptr::null_mut(),
        };
        let guid = CString::new(M::Variables::DESCRIPTION.guid).unwrap();
        // SAFETY: see above.
        let component = unsafe {
            c_api::instantiate::<M>(
                c"fuzz".as_ptr(),
                match interface {
                    Interface::CoSimulation => CO_SIMULATION,
                    Interface::ModelExchange => MODEL_EXCHANGE,
                },
                guid.as_ptr(),
                ptr::null(),
                &raw const callbacks,
                FALSE,
                FALSE,
            )
        };
        assert!(!component.is_null());
        Self {
            component,
            interface,
            functions,
            at: Whereabouts::FRESH,
            places: [(ptr::null_mut(), Whereabouts::FRESH); PLACES],
            calls: 0,
            model: PhantomData,
        }
    }

    /// The instance's present state.
    pub fn snapshot(&self) -> Snapshot {
        let mut state = ptr::null_mut();
        // SAFETY: see above.
        assert_eq!(unsafe { c_api::get_fmu_state::<M>(self.component, &raw mut state) }, Status::Ok);
        let bytes = self.serialize(state);
        // SAFETY: see above.
        assert_eq!(unsafe { c_api::free_fmu_state::<M>(self.component, &raw mut state) }, Status::Ok);
        Snapshot { bytes, at: self.at }
    }

    fn serialize(&self, state: FmuState) -> Vec<u8> {
        let mut size = 0;
        // SAFETY: see above.
        let status = unsafe { c_api::serialized_fmu_state_size::<M>(self.component, state, &raw mut size) };
        assert_eq!(status, Status::Ok);
        let mut bytes = vec![0_u8; size];
        let target = bytes.as_mut_ptr().cast::<c_char>();
        // SAFETY: see above.
        let status = unsafe { c_api::serialize_fmu_state::<M>(self.component, state, target, size) };
        assert_eq!(status, Status::Ok);
        bytes
    }

    /// Deserializes a state, and returns its bytes, unless it is refused.
    pub fn deserialize(&self, bytes: &[u8]) -> Result<Vec<u8>, Status> {
        let mut state = self.state_from(bytes)?;
        let again = self.serialize(state);
        // SAFETY: see above.
        assert_eq!(unsafe { c_api::free_fmu_state::<M>(self.component, &raw mut state) }, Status::Ok);
        Ok(again)
    }

    fn state_from(&self, bytes: &[u8]) -> Result<FmuState, Status> {
        let mut state = ptr::null_mut();
        let (source, size) = (bytes.as_ptr().cast::<c_char>(), bytes.len());
        // SAFETY: see above.
        let status =
            unsafe { c_api::deserialize_fmu_state::<M>(self.component, source, size, &raw mut state) };
        if status == Status::Ok {
            Ok(state)
        } else {
            assert!(state.is_null());
            Err(status)
        }
    }

    /// Continues from a snapshot, with the same slots.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), TestCaseError> {
        let mut state = self.state_from(&snapshot.bytes).map_err(|status| {
            TestCaseError::fail(format!("the bytes of a saved state are refused: {status:?}"))
        })?;
        // SAFETY: see above.
        unsafe {
            prop_assert_eq!(c_api::set_fmu_state::<M>(self.component, state), Status::Ok);
            prop_assert_eq!(c_api::free_fmu_state::<M>(self.component, &raw mut state), Status::Ok);
        }
        self.at = snapshot.at;
        Ok(())
    }

    /// Makes calls; returns their results.
    ///
    /// # Errors
    /// When a result is wrong.
    pub fn run<'c>(
        &mut self,
        calls: impl IntoIterator<Item = &'c Call>,
    ) -> Result<Vec<Answer>, TestCaseError> {
        calls.into_iter().map(|call| self.make(call)).collect()
    }

    /// Makes a call, and compares its result with the standard.
    fn make(&mut self, call: &Call) -> Result<Answer, TestCaseError> {
        let before = self.snapshot();
        let (function, status, values) = self.pass_on(call);
        self.calls += 1;
        let told = format!("{function} in {:?} answers {status:?}", before.at);

        prop_assert!(status <= Status::Error, "{}", told);
        let allowed = allows(self.interface, function, before.at.state);
        // Importers that set their inputs by type between events may have none of a type, or none that changes.
        let sets_nothing = before.at.state == State::ContinuousTimeMode
            && matches!(call, Call::Set(..))
            && self.snapshot() == before;
        if !allowed && !sets_nothing {
            prop_assert_eq!(status, Status::Error, "{} and is not allowed", told);
        }
        let must_work =
            matches!(call, Call::Terminate | Call::Reset | Call::GetState(_) | Call::EnterEventMode)
                || matches!(call, Call::EnterInitializationMode if self.at.set_up);
        if allowed && must_work {
            prop_assert_eq!(status, Status::Ok, "{}", told);
        }
        if matches!(call, Call::Integrate(_) | Call::HaveEvent) {
            return Ok((status, values));
        }
        match status {
            Status::Ok | Status::Warning => self.follow(call, before.at),
            Status::Discard => {
                if matches!(call, Call::DoStep { .. }) {
                    self.at.state = State::StepFailed;
                }
            }
            _ => self.check_error(call, allowed, &before, &told)?,
        }
        Ok((status, values))
    }

    /// A failed computation may leave values behind, and a failed step ends the run; other errors change nothing.
    fn check_error(
        &mut self,
        call: &Call,
        allowed: bool,
        before: &Snapshot,
        told: &str,
    ) -> Result<(), TestCaseError> {
        let computes = matches!(
            call,
            Call::DoStep { .. }
                | Call::Get(..)
                | Call::ExitInitializationMode
                | Call::GetVector(..)
                | Call::NewDiscreteStates
                | Call::EnterContinuousTimeMode
        );
        let after = self.snapshot();
        if !(allowed && computes) {
            prop_assert!(after == *before, "{} and changes the instance", told);
        } else if matches!(call, Call::DoStep { .. }) && after != *before
            || matches!(call, Call::NewDiscreteStates) && self.has_failed(&after)?
        {
            self.at.state = State::Error;
        }
        Ok(())
    }

    /// The effect of a successful call.
    fn follow(&mut self, call: &Call, was: Whereabouts) {
        match *call {
            Call::SetupExperiment { start_time, .. } => {
                self.at.set_up = true;
                self.at.time = start_time;
            }
            Call::EnterInitializationMode => self.at.state = State::InitializationMode,
            Call::ExitInitializationMode => {
                self.at.state = match self.interface {
                    Interface::CoSimulation => State::StepComplete,
                    Interface::ModelExchange => State::EventMode,
                };
            }
            Call::EnterEventMode => self.at.state = State::EventMode,
            Call::EnterContinuousTimeMode => self.at.state = State::ContinuousTimeMode,
            Call::Terminate => self.at.state = State::Terminated,
            Call::Reset => self.at = Whereabouts::FRESH,
            Call::GetState(place) => self.places[place].1 = was,
            Call::SetState(place) => self.at = self.places[place].1,
            Call::CopyState { from, to } => self.places[to].1 = self.places[from].1,
            _ => {}
        }
    }

    /// Makes a call: the function's name, its status, and the bits of the returned values.
    fn pass_on(&mut self, call: &Call) -> (&'static str, Status, Vec<u64>) {
        let component = self.component;
        // SAFETY: see above.
        unsafe {
            let (function, status) = match call {
                Call::SetDebugLogging(on) => (
                    "fmi2SetDebugLogging",
                    c_api::set_debug_logging::<M>(component, i32::from(*on), 0, ptr::null()),
                ),
                &Call::SetupExperiment { tolerance, start_time, stop_time } => (
                    "fmi2SetupExperiment",
                    c_api::setup_experiment::<M>(
                        component,
                        i32::from(tolerance.is_some()),
                        tolerance.unwrap_or_default(),
                        start_time,
                        i32::from(stop_time.is_some()),
                        stop_time.unwrap_or_default(),
                    ),
                ),
                Call::EnterInitializationMode => {
                    ("fmi2EnterInitializationMode", c_api::enter_initialization_mode::<M>(component))
                }
                Call::ExitInitializationMode => {
                    ("fmi2ExitInitializationMode", (self.functions.exit_initialization_mode)(component))
                }
                Call::Terminate => ("fmi2Terminate", c_api::terminate::<M>(component)),
                Call::Reset => ("fmi2Reset", c_api::reset::<M>(component)),
                Call::Get(data_type, references) => return self.get(*data_type, references),
                Call::Set(data_type, values) => self.set(*data_type, values),
                Call::SetInputDerivatives(derivatives) => {
                    let references: Vec<_> = derivatives.iter().map(|derivative| derivative.0).collect();
                    let orders: Vec<_> = derivatives.iter().map(|derivative| derivative.1).collect();
                    let values: Vec<_> = derivatives.iter().map(|derivative| derivative.2).collect();
                    let count = derivatives.len();
                    let status = c_api::set_real_input_derivatives::<M>(
                        component,
                        references.as_ptr(),
                        count,
                        orders.as_ptr(),
                        values.as_ptr(),
                    );
                    ("fmi2SetRealInputDerivatives", status)
                }
                Call::GetOutputDerivatives(derivatives) => {
                    let references: Vec<_> = derivatives.iter().map(|derivative| derivative.0).collect();
                    let orders: Vec<_> = derivatives.iter().map(|derivative| derivative.1).collect();
                    let mut values = vec![f64::NAN; derivatives.len()];
                    let status = c_api::get_real_output_derivatives::<M>(
                        component,
                        references.as_ptr(),
                        derivatives.len(),
                        orders.as_ptr(),
                        values.as_mut_ptr(),
                    );
                    return ("fmi2GetRealOutputDerivatives", status, given(status, &values));
                }
                Call::GetDirectionalDerivative { unknowns, knowns } => {
                    let seed = vec![1.0; knowns.len()];
                    let mut values = vec![f64::NAN; unknowns.len()];
                    let status = c_api::get_directional_derivative::<M>(
                        component,
                        unknowns.as_ptr(),
                        unknowns.len(),
                        knowns.as_ptr(),
                        knowns.len(),
                        seed.as_ptr(),
                        values.as_mut_ptr(),
                    );
                    return ("fmi2GetDirectionalDerivative", status, given(status, &values));
                }
                &Call::DoStep { late, size } => {
                    let mut time = 0.0;
                    let kind = status_kind::LAST_SUCCESSFUL_TIME;
                    c_api::get_real_status::<M>(component, kind, &raw mut time);
                    ("fmi2DoStep", c_api::do_step::<M>(component, time + late * size, size, FALSE))
                }
                Call::CancelStep => ("fmi2CancelStep", c_api::cancel_step::<M>(component)),
                Call::GetStatus { function, kind } => return self.get_status(function, *kind),
                &Call::GetState(place) => {
                    let state = &raw mut self.places[place].0;
                    ("fmi2GetFMUstate", c_api::get_fmu_state::<M>(component, state))
                }
                &Call::SetState(place) => {
                    ("fmi2SetFMUstate", c_api::set_fmu_state::<M>(component, self.places[place].0))
                }
                &Call::FreeState(place) => {
                    let state = &raw mut self.places[place].0;
                    ("fmi2FreeFMUstate", c_api::free_fmu_state::<M>(component, state))
                }
                &Call::CopyState { from, to } => self.copy_state(from, to),
                _ => return self.pass_on_to_exchange(call),
            };
            (function, status, vec![])
        }
    }

    const STATES: usize = M::Variables::STATE_NAMES.len();

    /// Makes a call of Model Exchange.
    fn pass_on_to_exchange(&mut self, call: &Call) -> (&'static str, Status, Vec<u64>) {
        let component = self.component;
        let exchange = self.functions.exchange.expect("calls of Model Exchange are for models that have it");
        // SAFETY: see above.
        unsafe {
            let (function, status) = match call {
                Call::EnterEventMode => ("fmi2EnterEventMode", (exchange.enter_event_mode)(component)),
                Call::NewDiscreteStates => {
                    let (status, values) = self.new_discrete_states(exchange);
                    return ("fmi2NewDiscreteStates", status, values);
                }
                Call::EnterContinuousTimeMode => {
                    ("fmi2EnterContinuousTimeMode", (exchange.enter_continuous_time_mode)(component))
                }
                Call::CompletedIntegratorStep => {
                    let (mut event, mut end) = (7, 7);
                    let status =
                        (exchange.completed_integrator_step)(component, FALSE, &raw mut event, &raw mut end);
                    assert!(status != Status::Ok || (event, end) == (0, 0));
                    ("fmi2CompletedIntegratorStep", status)
                }
                &Call::SetTime(time) => {
                    let time = match time {
                        Time::Later(by) => self.at.time + by,
                        Time::NextEvent(early) => self.at.next_event * (1.0 - early),
                        Time::Any(time) => time,
                    };
                    let status = (exchange.set_time)(component, time);
                    if status == Status::Ok {
                        self.at.time = time;
                    }
                    ("fmi2SetTime", status)
                }
                Call::SetContinuousStates(states, more) => {
                    let count = Self::STATES.saturating_add_signed(*more);
                    let mut values = states.clone();
                    values.resize(count, 0.5);
                    let status = (exchange.set_continuous_states)(component, values.as_ptr(), count);
                    assert!(count == Self::STATES || status == Status::Error);
                    ("fmi2SetContinuousStates", status)
                }
                &Call::GetVector(vector, more) => {
                    let (function, status, values) = self.vector(exchange, vector, more);
                    return (function, status, given(status, &values));
                }
                &Call::Integrate(size) => return self.integrate(exchange, size),
                Call::HaveEvent => return self.have_event(exchange),
                other => unreachable!("{other:?} is a call of every FMU"),
            };
            (function, status, vec![])
        }
    }

    fn new_discrete_states(&mut self, exchange: Exchange) -> (Status, Vec<u64>) {
        let mut info = EventInfo {
            new_discrete_states_needed: 7,
            terminate_simulation: 7,
            nominals_of_continuous_states_changed: 7,
            values_of_continuous_states_changed: 7,
            next_event_time_defined: 7,
            next_event_time: f64::NAN,
        };
        // SAFETY: see above.
        let status = unsafe { (exchange.new_discrete_states)(self.component, &raw mut info) };
        if status >= Status::Discard {
            return (status, vec![]);
        }
        let flags = [
            info.new_discrete_states_needed,
            info.terminate_simulation,
            info.nominals_of_continuous_states_changed,
            info.values_of_continuous_states_changed,
            info.next_event_time_defined,
        ];
        let next = info.next_event_time;
        assert!(flags.iter().all(|flag| [0, 1].contains(flag)), "{flags:?}");
        if info.next_event_time_defined == 1 {
            let is_due = info.new_discrete_states_needed == 1;
            assert!(next.is_finite() && (is_due || next > self.at.time), "{next} at {}", self.at.time);
            self.at.next_event = next;
        }
        let flags = flags.map(|flag| u64::from(flag.cast_unsigned()));
        (status, [&flags[..], &[next.to_bits()]].concat())
    }

    fn vector(&self, exchange: Exchange, vector: Vector, more: isize) -> (&'static str, Status, Vec<f64>) {
        let (function, get, right) = match vector {
            Vector::ContinuousStates => {
                ("fmi2GetContinuousStates", exchange.get_continuous_states, Self::STATES)
            }
            Vector::Derivatives => ("fmi2GetDerivatives", exchange.get_derivatives, Self::STATES),
            Vector::EventIndicators => {
                let indicators = M::Variables::EVENT_INDICATORS.len();
                ("fmi2GetEventIndicators", exchange.get_event_indicators, indicators)
            }
            Vector::Nominals => ("fmi2GetNominalsOfContinuousStates", exchange.get_nominals, Self::STATES),
        };
        let count = right.saturating_add_signed(more);
        let mut values = vec![f64::NAN; count];
        // SAFETY: see above.
        let status = unsafe { get(self.component, values.as_mut_ptr(), count) };
        assert!(count == right || status == Status::Error);
        (function, status, values)
    }

    /// A step of explicit Euler between events. The answer is that of the indicators at its end.
    fn integrate(&mut self, exchange: Exchange, size: f64) -> (&'static str, Status, Vec<u64>) {
        let (function, status, mut states) = self.vector(exchange, Vector::ContinuousStates, 0);
        let (_, with_derivatives, derivatives) = self.vector(exchange, Vector::Derivatives, 0);
        if self.at.state != State::ContinuousTimeMode || status.max(with_derivatives) >= Status::Discard {
            return (function, status, given(status, &states));
        }
        given(with_derivatives, &derivatives);
        for (state, derivative) in states.iter_mut().zip(&derivatives) {
            *state += size * derivative;
        }
        // SAFETY: see above.
        unsafe {
            if (exchange.set_time)(self.component, self.at.time + size) == Status::Ok {
                self.at.time += size;
            }
            let is_finite = states.iter().all(|state| state.is_finite());
            let status = (exchange.set_continuous_states)(self.component, states.as_ptr(), states.len());
            assert_eq!(status == Status::Ok, is_finite);
        }
        let (function, status, indicators) = self.vector(exchange, Vector::EventIndicators, 0);
        (function, status, given(status, &indicators))
    }

    /// Enters Event Mode, and leaves it after as many iterations as the event takes. The answer is the last one's.
    fn have_event(&mut self, exchange: Exchange) -> (&'static str, Status, Vec<u64>) {
        let function = "fmi2EnterEventMode";
        // SAFETY: see above.
        unsafe {
            let entered = (exchange.enter_event_mode)(self.component);
            if entered != Status::Ok {
                return (function, entered, vec![]);
            }
            self.at.state = State::EventMode;
            // The model gives up after 1000 iterations.
            for _ in 0..=1001 {
                let (status, values) = self.new_discrete_states(exchange);
                if status >= Status::Discard {
                    let now = self.snapshot();
                    if self.has_failed(&now).expect("a saved state can be set") {
                        self.at.state = State::Error;
                    }
                    return (function, entered, values);
                }
                if values[0] == 0 {
                    if (exchange.enter_continuous_time_mode)(self.component) < Status::Discard {
                        self.at.state = State::ContinuousTimeMode;
                        // At the restart no indicator is 0 (section 3.2.2).
                        let (_, status, indicators) = self.vector(exchange, Vector::EventIndicators, 0);
                        assert!(status >= Status::Discard || !indicators.contains(&0.0), "{indicators:?}");
                    }
                    return (function, entered, values);
                }
            }
        }
        panic!("an event does not end");
    }

    /// Whether the instance is in the state `error`, where it cannot be terminated.
    fn has_failed(&mut self, now: &Snapshot) -> Result<bool, TestCaseError> {
        // SAFETY: see above.
        let status = unsafe { c_api::terminate::<M>(self.component) };
        self.restore(now)?;
        Ok(status == Status::Error)
    }

    fn copy_state(&mut self, from: usize, to: usize) -> (&'static str, Status) {
        let function = "fmi2SerializedFMUstateSize";
        let mut size = 0;
        // SAFETY: see above.
        unsafe {
            let from = self.places[from].0;
            let status = c_api::serialized_fmu_state_size::<M>(self.component, from, &raw mut size);
            if status != Status::Ok {
                return (function, status);
            }
            let bytes = self.serialize(from);
            let (source, to) = (bytes.as_ptr().cast::<c_char>(), &raw mut self.places[to].0);
            ("fmi2DeSerializeFMUstate", c_api::deserialize_fmu_state::<M>(self.component, source, size, to))
        }
    }

    fn get(&self, data_type: Type, references: &[u32]) -> (&'static str, Status, Vec<u64>) {
        let (vr, count) = (references.as_ptr(), references.len());
        // SAFETY: see above.
        unsafe {
            match data_type {
                Type::Real => {
                    let mut values = vec![f64::NAN; count];
                    let status = c_api::get_real::<M>(self.component, vr, count, values.as_mut_ptr());
                    ("fmi2GetReal", status, given(status, &values))
                }
                Type::Integer | Type::Boolean => {
                    let mut values = vec![-1; count];
                    let (function, status) = if data_type == Type::Integer {
                        let status = c_api::get_integer::<M>(self.component, vr, count, values.as_mut_ptr());
                        ("fmi2GetInteger", status)
                    } else {
                        let status = c_api::get_boolean::<M>(self.component, vr, count, values.as_mut_ptr());
                        ("fmi2GetBoolean", status)
                    };
                    (function, status, values.iter().map(|&value| u64::from(value.cast_unsigned())).collect())
                }
                Type::String => {
                    let mut values = vec![ptr::null(); count];
                    let status = c_api::get_string::<M>(self.component, vr, count, values.as_mut_ptr());
                    ("fmi2GetString", status, vec![])
                }
            }
        }
    }

    fn set(&self, data_type: Type, values: &[(u32, Number)]) -> (&'static str, Status) {
        let references: Vec<_> = values.iter().map(|value| value.0).collect();
        let reals: Vec<_> =
            values.iter().map(|&(reference, number)| real_value::<M>(reference, number)).collect();
        let (vr, count) = (references.as_ptr(), references.len());
        #[allow(clippy::cast_possible_truncation)] // Any value will do.
        let integers: Vec<_> = reals.iter().map(|&value| value as i32).collect();
        // SAFETY: see above.
        unsafe {
            match data_type {
                Type::Real => {
                    ("fmi2SetReal", c_api::set_real::<M>(self.component, vr, count, reals.as_ptr()))
                }
                Type::Integer => {
                    ("fmi2SetInteger", c_api::set_integer::<M>(self.component, vr, count, integers.as_ptr()))
                }
                Type::Boolean => {
                    ("fmi2SetBoolean", c_api::set_boolean::<M>(self.component, vr, count, integers.as_ptr()))
                }
                Type::String => {
                    let texts = vec![c"text".as_ptr(); count];
                    ("fmi2SetString", c_api::set_string::<M>(self.component, vr, count, texts.as_ptr()))
                }
            }
        }
    }

    fn get_status(&self, function: &'static str, kind: i32) -> (&'static str, Status, Vec<u64>) {
        let (mut time, mut number, mut status, mut text) = (0.0, 0, 0, ptr::null());
        // SAFETY: see above.
        let answer = unsafe {
            match function {
                "fmi2GetStatus" => c_api::get_status::<M>(self.component, kind, &raw mut status),
                "fmi2GetRealStatus" => c_api::get_real_status::<M>(self.component, kind, &raw mut time),
                "fmi2GetIntegerStatus" => {
                    c_api::get_integer_status::<M>(self.component, kind, &raw mut number)
                }
                "fmi2GetBooleanStatus" => {
                    c_api::get_boolean_status::<M>(self.component, kind, &raw mut number)
                }
                _ => c_api::get_string_status::<M>(self.component, kind, &raw mut text),
            }
        };
        (function, answer, vec![time.to_bits(), u64::from(number.cast_unsigned())])
    }
}

/// The number for a variable.
fn real_value<M: Model>(reference: u32, number: Number) -> f64 {
    match (number, M::Variables::description(reference)) {
        // The test model fails on request, which has tests of its own; this value is refused.
        (_, Some(variable)) if variable.name.starts_with("fault.") => f64::INFINITY,
        (Number::Special(value), _) => value,
        (Number::Share(share), Some(variable)) => {
            let (min, max) = (variable.min.max(-1e6), variable.max.min(1e6));
            min + share * (max - min)
        }
        (Number::Share(share), None) => share,
    }
}

/// The bits of returned values.
fn given(status: Status, values: &[f64]) -> Vec<u64> {
    if status < Status::Discard {
        assert!(values.iter().all(|value| value.is_finite()), "{status:?} with {values:?}");
    }
    values.iter().map(|value| value.to_bits()).collect()
}
