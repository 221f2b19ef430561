//! What an instance can be asked for, the same in both versions of FMI: a type for each interface. An instance has only
//! the interfaces for which it was made, so that no call is to a function that its library need not have.

use std::ffi::{CStr, c_int};
use std::rc::Rc;
use std::sync::Arc;

use fmu_abi::ValueReference;

use super::super::messages::{Called, Missing};
use super::super::numbers::{NumberType, Numbers};
use super::component::{Component, Instantiation, NotMade};
use super::library::Numbered;

/// An instance, with what it is asked for.
pub enum Handle {
    /// Steps, and handles its events itself.
    CoSimulation(Rc<dyn CoSimulation>),
    /// Steps, and handles its events in Event Mode, which only FMI 3.0 has.
    EventCoSimulation(Rc<dyn EventCoSimulation>),
    /// Is integrated.
    ModelExchange(Rc<dyn ModelExchange>),
}

impl Handle {
    /// What every instance is asked for.
    pub fn common(&self) -> Rc<dyn Common> {
        match self {
            Self::CoSimulation(handle) => Rc::clone(handle) as _,
            Self::EventCoSimulation(handle) => Rc::clone(handle) as _,
            Self::ModelExchange(handle) => Rc::clone(handle) as _,
        }
    }
}

/// The functions of a library, of one version and interface.
pub trait Functions: Send + Sync {
    /// Makes an instance.
    ///
    /// # Errors
    /// If the FMU refuses.
    ///
    /// # Safety
    /// The functions were looked up in the library of the instantiation.
    unsafe fn instantiate(self: Arc<Self>, instantiation: Instantiation) -> Result<Handle, NotMade>;

    /// The types of numbers that the version has functions for.
    fn numbers(&self) -> &'static [Numbered];

    /// Refuses a library that cannot tell its texts.
    fn refuse_no_texts(&self) -> Result<(), Missing>;

    /// Refuses a library without Event Mode in co-simulation.
    fn refuse_no_event_mode(&self) -> Result<(), Missing>;
}

/// The experiment that an FMU is told.
#[derive(Clone, Copy, Debug, Default)]
pub struct Experiment {
    /// The relative tolerance, if any.
    pub tolerance: Option<f64>,
    /// When the experiment starts (s).
    pub start_time: f64,
    /// When the experiment stops (s), if that is known.
    pub stop_time: Option<f64>,
}

/// What an element of a variable depends on; elements count from 1, and 0 is all of them (FMI 3.0.2, section 2.2.10).
#[derive(Clone, Copy, Debug)]
pub struct Dependency {
    pub element: usize,
    pub on: ValueReference,
    pub element_of_it: usize,
}

/// What every instance is asked for.
pub trait Common {
    /// The instance in its library.
    fn component(&self) -> &Component;

    /// Tells the experiment; FMI 3.0 has no function for that, as it tells it on entering Initialization Mode.
    fn set_up_experiment(&self, experiment: &Experiment) -> Option<Called>;

    fn enter_initialization_mode(&self, experiment: &Experiment) -> Called;

    /// Gets numbers of a type. An array's reference has all its elements.
    fn get(&self, number_type: NumberType, references: &[ValueReference], values: &mut Numbers) -> Called;

    /// Sets numbers of a type. An array's reference has all its elements.
    fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Called;

    /// The texts of a variable, which is an array if there are several.
    fn get_strings(&self, reference: ValueReference, count: usize) -> Result<(Called, Vec<String>), Missing>;

    /// Sets one text.
    fn set_string(&self, reference: ValueReference, value: &CStr) -> Called;

    /// The derivatives of unknowns along a direction of the knowns, whose arrays count as a whole.
    fn directional_derivative(
        &self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        derivatives: &mut [f64],
    ) -> Result<Called, Missing>;

    /// What the elements of a variable depend on.
    fn dependencies(&self, of: ValueReference) -> Result<(Called, Vec<Dependency>), Missing>;
}

/// How a step went.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub called: Called,
    /// Whether the FMU asks for the end.
    pub terminates: bool,
    /// Whether an event is to be handled.
    pub has_event: bool,
    /// The time at which the step returned early (s), if it did.
    pub early_return: Option<f64>,
    /// The time that the step has reached (s), if the FMU tells it with the step.
    pub last_successful_time: Option<f64>,
}

/// What an instance for co-simulation is asked for.
pub trait CoSimulation: Common {
    /// Steps from a time (s) by a size (s).
    fn do_step(&self, time: f64, size: f64) -> Step;

    /// The time that the last step, which was discarded or asked for the end, has reached (s), if the FMU tells it.
    fn last_successful_time(&self, step: &Step) -> Option<f64>;
}

/// What the FMU says after an update of its discrete states.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discrete {
    /// Whether the discrete states need another update.
    pub needs_update: bool,
    /// Whether the FMU asks for the end.
    pub terminates: bool,
    /// The time of the next time event (s).
    pub next_event: Option<f64>,
}

/// What an instance with Event Mode is asked for.
pub trait EventHandling: Common {
    fn enter_event_mode(&self) -> Called;

    /// Leaves Event Mode, for Continuous-Time Mode or Step Mode.
    fn leave_event_mode(&self) -> Called;

    fn update_discrete_states(&self) -> (Called, Discrete);

    /// The instance's clocks, which only FMI 3.0 has.
    fn clocks(self: Rc<Self>) -> Option<Rc<dyn Clocks>>;
}

/// What an instance with clocks is asked for.
pub trait Clocks {
    /// Lets a clock tick.
    fn tick(&self, clock: ValueReference) -> Called;

    /// A clock's interval (s) and its qualifier.
    fn interval(&self, clock: ValueReference) -> (Called, f64, c_int);

    /// When a clock first ticks, after the start (s).
    fn shift(&self, clock: ValueReference) -> (Called, f64);
}

/// What an instance for co-simulation with Event Mode is asked for.
pub trait EventCoSimulation: CoSimulation + EventHandling {}

/// Numbers that a solver reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    States,
    Nominals,
    Derivatives,
    Indicators,
}

/// What the FMU says after a step of the integrator.
#[derive(Clone, Copy, Debug)]
pub struct Completed {
    /// Whether an event follows.
    pub has_event: bool,
    /// Whether the FMU asks for the end.
    pub terminates: bool,
}

/// What an instance for Model Exchange is asked for.
pub trait ModelExchange: EventHandling {
    /// Goes to a time (s) between events.
    fn set_time(&self, time: f64) -> Called;

    /// Sets all continuous states.
    fn set_states(&self, states: &[f64]) -> Called;

    /// Gets all numbers of a kind.
    fn get_vector(&self, vector: Vector, values: &mut [f64]) -> Called;

    fn completed_integrator_step(&self) -> (Called, Completed);
}
