//! The functions of FMI 2.0, and the calls to them.

use std::ffi::{CStr, c_int};
use std::ptr;
use std::rc::Rc;
use std::sync::Arc;

use fmu_abi::ValueReference;
use fmu_abi::fmi2::c_types::status_kind::{LAST_SUCCESSFUL_TIME, TERMINATED};
use fmu_abi::fmi2::c_types::{Boolean, CO_SIMULATION, EventInfo, FALSE, MODEL_EXCHANGE, TRUE};
use fmu_terms::{DataType, Interface, Version};

use super::super::messages::{Called, Missing, Status};
use super::super::numbers::{Memory, NumberType, Numbers};
use super::component::{Component, Instantiation, NotMade, Shared};
use super::interfaces::{
    self, Clocks, CoSimulation, Common, Completed, Dependency, Discrete, EventHandling, Experiment, Handle,
    ModelExchange, Step, Vector,
};
use super::library::{Function, Get2, Numbered, Set2, Symbols, functions};
use super::logger::told;
use super::types;

functions! { fmi2:
    /// Functions that every FMU has.
    Everywhere {
        instantiate: fmi2Instantiate,
        set_up_experiment: fmi2SetupExperiment,
        enter_initialization_mode: fmi2EnterInitializationMode,
        set_string: fmi2SetString,
    }

    /// Functions of co-simulation.
    Stepping { do_step: fmi2DoStep }

    /// Functions of Model Exchange.
    Exchange {
        enter_event_mode: fmi2EnterEventMode,
        new_discrete_states: fmi2NewDiscreteStates,
        enter_continuous_time_mode: fmi2EnterContinuousTimeMode,
        set_time: fmi2SetTime,
        set_states: fmi2SetContinuousStates,
        states: fmi2GetContinuousStates,
        nominals: fmi2GetNominalsOfContinuousStates,
        derivatives: fmi2GetDerivatives,
        indicators: fmi2GetEventIndicators,
        completed_integrator_step: fmi2CompletedIntegratorStep,
    }
}

/// The types of numbers; a Boolean is an int.
static NUMBERS: [Numbered; 3] = [
    Numbered::new(DataType::Real, Memory::F64, "fmi2GetReal", "fmi2SetReal"),
    Numbered::new(DataType::Integer, Memory::I32, "fmi2GetInteger", "fmi2SetInteger"),
    Numbered::new(DataType::Boolean, Memory::I32, "fmi2GetBoolean", "fmi2SetBoolean"),
];

/// The functions of a library, with those of one interface.
struct Functions<Of> {
    shared: Shared,
    everywhere: Everywhere,
    numbers: Vec<(Function<Get2>, Function<Set2>)>,
    get_string: Result<Function<types::fmi2::fmi2GetString>, Missing>,
    directional_derivative: Result<Function<types::fmi2::fmi2GetDirectionalDerivative>, Missing>,
    /// The functions that tell how a step went.
    real_status: Result<Function<types::fmi2::fmi2GetRealStatus>, Missing>,
    boolean_status: Result<Function<types::fmi2::fmi2GetBooleanStatus>, Missing>,
    of_interface: Of,
}

/// Looks the functions up that an interface needs.
///
/// # Errors
/// If the library lacks one.
///
/// # Safety
/// The library is one of FMI 2.0.
pub unsafe fn load(
    symbols: &Symbols,
    interface: Interface,
) -> Result<Arc<dyn interfaces::Functions>, Missing> {
    // SAFETY: the caller's promise.
    unsafe {
        Ok(match interface {
            Interface::ModelExchange => Arc::new(Functions::load(symbols, Exchange::load(symbols)?)?),
            _ => Arc::new(Functions::load(symbols, Stepping::load(symbols)?)?),
        })
    }
}

impl<Of> Functions<Of> {
    /// # Safety
    /// The library is one of FMI 2.0.
    unsafe fn load(symbols: &Symbols, of_interface: Of) -> Result<Self, Missing> {
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                shared: Shared::load(symbols, Version::Two)?,
                everywhere: Everywhere::load(symbols)?,
                numbers: NUMBERS.iter().map(|number| number.load(symbols)).collect::<Result<_, _>>()?,
                get_string: symbols.get("fmi2GetString"),
                directional_derivative: symbols.get("fmi2GetDirectionalDerivative"),
                real_status: symbols.get("fmi2GetRealStatus"),
                boolean_status: symbols.get("fmi2GetBooleanStatus"),
                of_interface,
            })
        }
    }
}

/// An interface, by its functions.
trait OfInterface: Send + Sync + Sized + 'static {
    /// The interface's number.
    const TYPE: c_int;

    /// What an instance is asked for.
    fn handle(instance: Rc<Instance<Self>>) -> Handle;
}

impl OfInterface for Stepping {
    const TYPE: c_int = CO_SIMULATION;

    fn handle(instance: Rc<Instance<Self>>) -> Handle {
        Handle::CoSimulation(instance)
    }
}

impl OfInterface for Exchange {
    const TYPE: c_int = MODEL_EXCHANGE;

    fn handle(instance: Rc<Instance<Self>>) -> Handle {
        Handle::ModelExchange(instance)
    }
}

impl<Of: OfInterface> interfaces::Functions for Functions<Of> {
    unsafe fn instantiate(self: Arc<Self>, instantiation: Instantiation) -> Result<Handle, NotMade> {
        // SAFETY: the caller's promise. The texts live as long as the instance, the callbacks as long as the library. The
        // instance is not visible and sends messages.
        let component = unsafe {
            Component::new(
                instantiation,
                self.shared,
                self.everywhere.instantiate,
                |instantiate, [name, guid, resources], callbacks, _| {
                    instantiate(name, Of::TYPE, guid, resources, callbacks, FALSE, TRUE)
                },
            )?
        };
        Ok(Of::handle(Rc::new(Instance { component, functions: self })))
    }

    fn numbers(&self) -> &'static [Numbered] {
        &NUMBERS
    }

    fn refuse_no_texts(&self) -> Result<(), Missing> {
        self.get_string.map(|_| ())
    }

    fn refuse_no_event_mode(&self) -> Result<(), Missing> {
        Err(Missing("functions of Event Mode"))
    }
}

/// An instance of the library that the functions are of.
struct Instance<Of> {
    component: Component,
    functions: Arc<Functions<Of>>,
}

impl<Of: OfInterface> Common for Instance<Of> {
    fn component(&self) -> &Component {
        &self.component
    }

    fn set_up_experiment(&self, experiment: &Experiment) -> Option<Called> {
        let Experiment { tolerance, start_time, stop_time } = *experiment;
        // SAFETY: the instance is alive.
        let called = self.component.call(self.functions.everywhere.set_up_experiment, |call, it| unsafe {
            call(
                it,
                tolerance.is_some().into(),
                tolerance.unwrap_or(0.0),
                start_time,
                stop_time.is_some().into(),
                stop_time.unwrap_or(0.0),
            )
        });
        Some(called)
    }

    fn enter_initialization_mode(&self, _: &Experiment) -> Called {
        // SAFETY: the instance is alive.
        self.component
            .call(self.functions.everywhere.enter_initialization_mode, |call, it| unsafe { call(it) })
    }

    fn get(&self, number_type: NumberType, references: &[ValueReference], values: &mut Numbers) -> Called {
        let (get, _) = self.functions.numbers[number_type.place];
        values.refuse_other(NUMBERS[number_type.place].memory, references.len());
        let (count, address) = (references.len(), values.address_to_write());
        // SAFETY: the instance is alive, and the values, one for each reference, have the type's memory.
        self.component.call(get, |get, it| unsafe { get(it, references.as_ptr(), count, address) })
    }

    fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Called {
        let (_, set) = self.functions.numbers[number_type.place];
        values.refuse_other(NUMBERS[number_type.place].memory, references.len());
        let (count, address) = (references.len(), values.address());
        // SAFETY: as in `get`.
        self.component.call(set, |set, it| unsafe { set(it, references.as_ptr(), count, address) })
    }

    fn get_strings(&self, reference: ValueReference, count: usize) -> Result<(Called, Vec<String>), Missing> {
        let get = self.functions.get_string?;
        let mut texts = vec![ptr::null(); count.max(1)];
        // SAFETY: the instance is alive, and there is room for the variable's one text.
        let called = self
            .component
            .call(get, |get, it| unsafe { get(it, &raw const reference, 1, texts.as_mut_ptr()) });
        // SAFETY: the FMU has just told these texts, as the call succeeded.
        Ok((called, unsafe { told(called, &texts) }))
    }

    fn set_string(&self, reference: ValueReference, value: &CStr) -> Called {
        let text = value.as_ptr();
        // SAFETY: the instance is alive, both arrays have one element.
        self.component.call(self.functions.everywhere.set_string, |call, it| unsafe {
            call(it, &raw const reference, 1, &raw const text)
        })
    }

    fn directional_derivative(
        &self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        derivatives: &mut [f64],
    ) -> Result<Called, Missing> {
        let get = self.functions.directional_derivative?;
        let (of, by) = (unknowns.len(), knowns.len());
        assert!(of <= derivatives.len() && by <= seed.len(), "each reference has its number");
        let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
        // SAFETY: the instance is alive, and each reference has its number.
        Ok(self.component.call(get, |get, it| unsafe {
            get(it, unknowns, of, knowns, by, seed.as_ptr(), derivatives.as_mut_ptr())
        }))
    }

    fn dependencies(&self, _: ValueReference) -> Result<(Called, Vec<Dependency>), Missing> {
        Err(Missing("fmi3GetVariableDependencies"))
    }
}

impl Instance<Stepping> {
    /// Whether the FMU asks for the end, after a discarded step.
    fn terminates(&self) -> bool {
        let Ok(get) = self.functions.boolean_status else { return false };
        let mut terminates: Boolean = FALSE;
        // SAFETY: the instance is alive, the place to write to is ours.
        let called = self.component.call(get, |get, it| unsafe { get(it, TERMINATED, &raw mut terminates) });
        called.status.succeeded() && terminates != FALSE
    }
}

impl CoSimulation for Instance<Stepping> {
    fn do_step(&self, time: f64, size: f64) -> Step {
        let component = &self.component;
        // SAFETY: the instance is alive.
        let called = component.run(self.functions.of_interface.do_step, |call, it| unsafe {
            call(it, time, size, component.goes_on().into())
        });
        Step {
            called,
            terminates: called.status == Status::DISCARD && self.terminates(),
            has_event: false,
            early_return: None,
            last_successful_time: None,
        }
    }

    fn last_successful_time(&self, _: &Step) -> Option<f64> {
        let get = self.functions.real_status.ok()?;
        let mut time = f64::NAN;
        // SAFETY: the instance is alive, the place to write to is ours.
        let called =
            self.component.call(get, |get, it| unsafe { get(it, LAST_SUCCESSFUL_TIME, &raw mut time) });
        Some(time).filter(|time| called.status.succeeded() && time.is_finite())
    }
}

impl EventHandling for Instance<Exchange> {
    fn enter_event_mode(&self) -> Called {
        // SAFETY: the instance is alive.
        self.component.call(self.functions.of_interface.enter_event_mode, |call, it| unsafe { call(it) })
    }

    fn leave_event_mode(&self) -> Called {
        // SAFETY: the instance is alive.
        self.component
            .call(self.functions.of_interface.enter_continuous_time_mode, |call, it| unsafe { call(it) })
    }

    fn update_discrete_states(&self) -> (Called, Discrete) {
        let mut info = EventInfo::default();
        // SAFETY: the instance is alive, the place to write to is ours.
        let called =
            self.component.call(self.functions.of_interface.new_discrete_states, |call, it| unsafe {
                call(it, &raw mut info)
            });
        let has_next = info.next_event_time_defined != FALSE;
        let discrete = Discrete {
            needs_update: info.new_discrete_states_needed != FALSE,
            terminates: info.terminate_simulation != FALSE,
            next_event: has_next.then_some(info.next_event_time),
        };
        (called, discrete)
    }

    fn clocks(self: Rc<Self>) -> Option<Rc<dyn Clocks>> {
        None
    }
}

impl ModelExchange for Instance<Exchange> {
    fn set_time(&self, time: f64) -> Called {
        self.component.time.set(Some(time));
        // SAFETY: the instance is alive.
        self.component.call(self.functions.of_interface.set_time, |call, it| unsafe { call(it, time) })
    }

    fn set_states(&self, states: &[f64]) -> Called {
        // SAFETY: the instance is alive, and the pointer is to as many numbers.
        self.component.call(self.functions.of_interface.set_states, |call, it| unsafe {
            call(it, states.as_ptr(), states.len())
        })
    }

    fn get_vector(&self, vector: Vector, values: &mut [f64]) -> Called {
        let of = &self.functions.of_interface;
        let get = match vector {
            Vector::States => of.states,
            Vector::Nominals => of.nominals,
            Vector::Derivatives => of.derivatives,
            Vector::Indicators => of.indicators,
        };
        // SAFETY: the instance is alive, and the pointer is to as many numbers.
        self.component.call(get, |get, it| unsafe { get(it, values.as_mut_ptr(), values.len()) })
    }

    fn completed_integrator_step(&self) -> (Called, Completed) {
        let component = &self.component;
        let (mut event, mut terminates): (Boolean, Boolean) = (FALSE, FALSE);
        // SAFETY: the instance is alive, the places to write to are ours.
        let called = component
            .call(self.functions.of_interface.completed_integrator_step, |call, it| unsafe {
                call(it, component.goes_on().into(), &raw mut event, &raw mut terminates)
            });
        (called, Completed { has_event: event != FALSE, terminates: terminates != FALSE })
    }
}
