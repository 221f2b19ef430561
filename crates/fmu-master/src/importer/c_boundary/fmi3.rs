//! The functions of FMI 3.0, and the calls to them.

use std::ffi::{CStr, c_int};
use std::ptr;
use std::rc::Rc;
use std::sync::Arc;

use fmu_abi::ValueReference;
use fmu_abi::fmi3::c_types::{Boolean, FALSE, TRUE};
use fmu_terms::{DataType, Interface, Version};

use super::super::messages::{Called, Missing};
use super::super::numbers::{Memory, NumberType, Numbers};
use super::component::{Component, Instantiation, NotMade, Shared, UseOfEvents};
use super::interfaces::{
    self, Clocks, CoSimulation, Common, Completed, Dependency, Discrete, EventCoSimulation, EventHandling,
    Experiment, Handle, ModelExchange, Step, Vector,
};
use super::library::{Function, Get3, Numbered, Set3, Symbols, functions};
use super::logger::{log_message, told};
use super::types;

/// The most dependencies of a variable that are read, of some 24 bytes each.
const MOST_DEPENDENCIES: usize = 10_000_000;

functions! { fmi3:
    /// Functions that every FMU has.
    Everywhere {
        enter_initialization_mode: fmi3EnterInitializationMode,
        set_string: fmi3SetString,
    }

    /// Functions that tell dependencies by element.
    Dependencies { count: fmi3GetNumberOfVariableDependencies, get: fmi3GetVariableDependencies }

    /// Functions of co-simulation.
    Stepping { instantiate: fmi3InstantiateCoSimulation, do_step: fmi3DoStep }

    /// Functions of Event Mode.
    Events {
        enter_event_mode: fmi3EnterEventMode,
        update_discrete_states: fmi3UpdateDiscreteStates,
        set_clock: fmi3SetClock,
        get_interval: fmi3GetIntervalDecimal,
        get_shift: fmi3GetShiftDecimal,
    }

    /// The function that ends Event Mode in co-simulation.
    StepMode { enter: fmi3EnterStepMode }

    /// Functions of Model Exchange.
    Solving {
        instantiate: fmi3InstantiateModelExchange,
        enter_continuous_time_mode: fmi3EnterContinuousTimeMode,
        set_time: fmi3SetTime,
        set_states: fmi3SetContinuousStates,
        states: fmi3GetContinuousStates,
        nominals: fmi3GetNominalsOfContinuousStates,
        derivatives: fmi3GetContinuousStateDerivatives,
        indicators: fmi3GetEventIndicators,
        completed_integrator_step: fmi3CompletedIntegratorStep,
    }
}

/// The functions of co-simulation with Event Mode.
struct EventStepping {
    stepping: Stepping,
    events: Events,
    step_mode: StepMode,
}

/// The functions of Model Exchange with those of Event Mode.
struct Exchange {
    solving: Solving,
    events: Events,
}

/// The types of numbers; a Boolean is a C `bool`, to which a careless FMU may give any value.
static NUMBERS: [Numbered; 11] = [
    Numbered::new(DataType::Real, Memory::F64, "fmi3GetFloat64", "fmi3SetFloat64"),
    Numbered::new(DataType::Float32, Memory::F32, "fmi3GetFloat32", "fmi3SetFloat32"),
    Numbered::new(DataType::Int8, Memory::I8, "fmi3GetInt8", "fmi3SetInt8"),
    Numbered::new(DataType::UInt8, Memory::U8, "fmi3GetUInt8", "fmi3SetUInt8"),
    Numbered::new(DataType::Int16, Memory::I16, "fmi3GetInt16", "fmi3SetInt16"),
    Numbered::new(DataType::UInt16, Memory::U16, "fmi3GetUInt16", "fmi3SetUInt16"),
    Numbered::new(DataType::Integer, Memory::I32, "fmi3GetInt32", "fmi3SetInt32"),
    Numbered::new(DataType::UInt32, Memory::U32, "fmi3GetUInt32", "fmi3SetUInt32"),
    Numbered::new(DataType::Int64, Memory::I64, "fmi3GetInt64", "fmi3SetInt64"),
    Numbered::new(DataType::UInt64, Memory::U64, "fmi3GetUInt64", "fmi3SetUInt64"),
    Numbered::new(DataType::Boolean, Memory::U8, "fmi3GetBoolean", "fmi3SetBoolean"),
];

/// The functions of a library, with those of one interface.
struct Functions<Of> {
    shared: Shared,
    everywhere: Everywhere,
    numbers: Vec<(Function<Get3>, Function<Set3>)>,
    get_string: Result<Function<types::fmi3::fmi3GetString>, Missing>,
    directional_derivative: Result<Function<types::fmi3::fmi3GetDirectionalDerivative>, Missing>,
    dependencies: Result<Dependencies, Missing>,
    of_interface: Of,
}

/// Looks the functions up that an interface needs.
///
/// # Errors
/// If the library lacks one.
///
/// # Safety
/// The library is one of FMI 3.0.
pub unsafe fn load(
    symbols: &Symbols,
    interface: Interface,
) -> Result<Arc<dyn interfaces::Functions>, Missing> {
    // SAFETY: the caller's promise.
    unsafe {
        let events = Events::load(symbols);
        if interface == Interface::ModelExchange {
            let exchange = Exchange { solving: Solving::load(symbols)?, events: events? };
            return Ok(Arc::new(Functions::load(symbols, exchange)?));
        }
        let stepping = Stepping::load(symbols)?;
        Ok(match (events, StepMode::load(symbols)) {
            (Ok(events), Ok(step_mode)) => {
                Arc::new(Functions::load(symbols, EventStepping { stepping, events, step_mode })?)
            }
            _ => Arc::new(Functions::load(symbols, stepping)?),
        })
    }
}

impl<Of> Functions<Of> {
    /// # Safety
    /// The library is one of FMI 3.0.
    unsafe fn load(symbols: &Symbols, of_interface: Of) -> Result<Self, Missing> {
        // SAFETY: the standard declares these types for these names.
        unsafe {
            Ok(Self {
                shared: Shared::load(symbols, Version::Three)?,
                everywhere: Everywhere::load(symbols)?,
                numbers: NUMBERS.iter().map(|number| number.load(symbols)).collect::<Result<_, _>>()?,
                get_string: symbols.get("fmi3GetString"),
                directional_derivative: symbols.get("fmi3GetDirectionalDerivative"),
                dependencies: Dependencies::load(symbols),
                of_interface,
            })
        }
    }
}

/// An interface, by its functions.
trait OfInterface: Send + Sync + Sized + 'static {
    /// Makes an instance, for which the library has the functions of both versions.
    ///
    /// # Safety
    /// The functions are of the library.
    unsafe fn instantiate(&self, instantiation: Instantiation, shared: Shared) -> Result<Component, NotMade>;

    /// What an instance is asked for.
    fn handle(instance: Rc<Instance<Self>>, events: UseOfEvents) -> Handle;

    /// Refuses to be without Event Mode in co-simulation.
    fn refuse_no_event_mode() -> Result<(), Missing>;
}

impl OfInterface for Stepping {
    unsafe fn instantiate(&self, instantiation: Instantiation, shared: Shared) -> Result<Component, NotMade> {
        let UseOfEvents { in_event_mode, by_early_return } = instantiation.events;
        // SAFETY: the caller's promise. The texts live as long as the instance, the callback for ever. The instance is not
        // visible, sends messages, and calls in no step.
        unsafe {
            Component::new(
                instantiation,
                shared,
                self.instantiate,
                |instantiate, [name, token, resources], _, environment| {
                    instantiate(
                        name,
                        token,
                        resources,
                        FALSE,
                        TRUE,
                        in_event_mode.into(),
                        by_early_return.into(),
                        ptr::null(),
                        0,
                        environment,
                        Some(log_message),
                        None,
                    )
                },
            )
        }
    }

    fn handle(instance: Rc<Instance<Self>>, _: UseOfEvents) -> Handle {
        Handle::CoSimulation(instance)
    }

    fn refuse_no_event_mode() -> Result<(), Missing> {
        Err(Missing("functions of Event Mode"))
    }
}

impl OfInterface for EventStepping {
    unsafe fn instantiate(&self, instantiation: Instantiation, shared: Shared) -> Result<Component, NotMade> {
        // SAFETY: the caller's promise.
        unsafe { OfInterface::instantiate(&self.stepping, instantiation, shared) }
    }

    fn handle(instance: Rc<Instance<Self>>, events: UseOfEvents) -> Handle {
        if events.in_event_mode {
            Handle::EventCoSimulation(instance)
        } else {
            Handle::CoSimulation(instance)
        }
    }

    fn refuse_no_event_mode() -> Result<(), Missing> {
        Ok(())
    }
}

impl OfInterface for Exchange {
    unsafe fn instantiate(&self, instantiation: Instantiation, shared: Shared) -> Result<Component, NotMade> {
        // SAFETY: as for co-simulation.
        unsafe {
            Component::new(
                instantiation,
                shared,
                self.solving.instantiate,
                |instantiate, [name, token, resources], _, environment| {
                    instantiate(name, token, resources, FALSE, TRUE, environment, Some(log_message))
                },
            )
        }
    }

    fn handle(instance: Rc<Instance<Self>>, _: UseOfEvents) -> Handle {
        Handle::ModelExchange(instance)
    }

    fn refuse_no_event_mode() -> Result<(), Missing> {
        Ok(())
    }
}

impl<Of: OfInterface> interfaces::Functions for Functions<Of> {
    unsafe fn instantiate(self: Arc<Self>, instantiation: Instantiation) -> Result<Handle, NotMade> {
        let events = instantiation.events;
        // SAFETY: the caller's promise.
        let component = unsafe { self.of_interface.instantiate(instantiation, self.shared)? };
        Ok(Of::handle(Rc::new(Instance { component, functions: self }), events))
    }

    fn numbers(&self) -> &'static [Numbered] {
        &NUMBERS
    }

    fn refuse_no_texts(&self) -> Result<(), Missing> {
        self.get_string.map(|_| ())
    }

    fn refuse_no_event_mode(&self) -> Result<(), Missing> {
        Of::refuse_no_event_mode()
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

    fn set_up_experiment(&self, _: &Experiment) -> Option<Called> {
        None
    }

    fn enter_initialization_mode(&self, experiment: &Experiment) -> Called {
        let Experiment { tolerance, start_time, stop_time } = *experiment;
        // SAFETY: the instance is alive.
        self.component.call(self.functions.everywhere.enter_initialization_mode, |call, it| unsafe {
            call(
                it,
                tolerance.is_some().into(),
                tolerance.unwrap_or(0.0),
                start_time,
                stop_time.is_some().into(),
                stop_time.unwrap_or(0.0),
            )
        })
    }

    fn get(&self, number_type: NumberType, references: &[ValueReference], values: &mut Numbers) -> Called {
        let (get, _) = self.functions.numbers[number_type.place];
        values.refuse_other(NUMBERS[number_type.place].memory, references.len());
        let (count, size, address) = (references.len(), values.len(), values.address_to_write());
        // SAFETY: the instance is alive, and the values have the type's memory. An array's reference has all its elements,
        // and the FMU checks the total count.
        self.component.call(get, |get, it| unsafe { get(it, references.as_ptr(), count, address, size) })
    }

    fn set(&self, number_type: NumberType, references: &[ValueReference], values: &Numbers) -> Called {
        let (_, set) = self.functions.numbers[number_type.place];
        values.refuse_other(NUMBERS[number_type.place].memory, references.len());
        let (count, size, address) = (references.len(), values.len(), values.address());
        // SAFETY: as in `get`.
        self.component.call(set, |set, it| unsafe { set(it, references.as_ptr(), count, address, size) })
    }

    fn get_strings(&self, reference: ValueReference, count: usize) -> Result<(Called, Vec<String>), Missing> {
        let get = self.functions.get_string?;
        let mut texts = vec![ptr::null(); count];
        // SAFETY: the instance is alive, and the pointers are as many as the variable's texts, which the FMU checks.
        let called = self
            .component
            .call(get, |get, it| unsafe { get(it, &raw const reference, 1, texts.as_mut_ptr(), count) });
        // SAFETY: the FMU has just told these texts, if the call succeeded.
        Ok((called, unsafe { told(called, &texts) }))
    }

    fn set_string(&self, reference: ValueReference, value: &CStr) -> Called {
        let text = value.as_ptr();
        // SAFETY: the instance is alive, both arrays have one element.
        self.component.call(self.functions.everywhere.set_string, |call, it| unsafe {
            call(it, &raw const reference, 1, &raw const text, 1)
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
        let (of, by, seeds, count) = (unknowns.len(), knowns.len(), seed.len(), derivatives.len());
        assert!(of <= count && by <= seeds, "each reference has its number");
        let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
        // SAFETY: the instance is alive. An array's reference has all its elements, and the FMU checks the total count.
        Ok(self.component.call(get, |get, it| unsafe {
            get(it, unknowns, of, knowns, by, seed.as_ptr(), seeds, derivatives.as_mut_ptr(), count)
        }))
    }

    fn dependencies(&self, of: ValueReference) -> Result<(Called, Vec<Dependency>), Missing> {
        let Dependencies { count: get_count, get } = self.functions.dependencies?;
        let mut count = 0;
        // SAFETY: the instance is alive, the place to write to is ours.
        let called = self.component.call(get_count, |call, it| unsafe { call(it, of, &raw mut count) });
        // More than all pairs of elements of the largest arrays are none.
        if !called.status.succeeded() || count > MOST_DEPENDENCIES {
            return Ok((called, vec![]));
        }
        let (mut elements, mut independents) = (vec![0; count], vec![0; count]);
        let (mut elements_of_independents, mut kinds) = (vec![0; count], vec![0; count]);
        // SAFETY: the instance is alive, and each place to write to is ours and has as many elements as is said.
        let called = self.component.call(get, |get, it| unsafe {
            let (elements, independents) = (elements.as_mut_ptr(), independents.as_mut_ptr());
            let (others, kinds) = (elements_of_independents.as_mut_ptr(), kinds.as_mut_ptr());
            get(it, of, elements, independents, others, kinds, count)
        });
        let pairs = elements.into_iter().zip(independents.into_iter().zip(elements_of_independents));
        let dependency = |(element, (on, element_of_it))| Dependency { element, on, element_of_it };
        Ok((called, pairs.map(dependency).collect()))
    }
}

/// The interfaces in which an instance steps.
trait Steps: OfInterface {
    fn stepping(&self) -> &Stepping;
}

impl Steps for Stepping {
    fn stepping(&self) -> &Stepping {
        self
    }
}

impl Steps for EventStepping {
    fn stepping(&self) -> &Stepping {
        &self.stepping
    }
}

impl<Of: Steps> CoSimulation for Instance<Of> {
    fn do_step(&self, time: f64, size: f64) -> Step {
        let component = &self.component;
        let (mut event, mut terminates, mut early): (Boolean, Boolean, Boolean) = (FALSE, FALSE, FALSE);
        let mut reached = f64::NAN;
        // SAFETY: the instance is alive, the places to write to are ours.
        let called = component.run(self.functions.of_interface.stepping().do_step, |call, it| unsafe {
            call(
                it,
                time,
                size,
                component.goes_on().into(),
                &raw mut event,
                &raw mut terminates,
                &raw mut early,
                &raw mut reached,
            )
        });
        Step {
            called,
            terminates: called.status.succeeded() && terminates != FALSE,
            has_event: event != FALSE,
            early_return: (early != FALSE).then_some(reached),
            last_successful_time: Some(reached).filter(|reached| reached.is_finite()),
        }
    }

    fn last_successful_time(&self, step: &Step) -> Option<f64> {
        step.last_successful_time
    }
}

/// The interfaces with Event Mode.
trait WithEvents: OfInterface {
    fn events(&self) -> &Events;

    /// The function that ends Event Mode.
    fn leave(&self) -> Function<types::fmi3::fmi3EnterStepMode>;
}

impl WithEvents for EventStepping {
    fn events(&self) -> &Events {
        &self.events
    }

    fn leave(&self) -> Function<types::fmi3::fmi3EnterStepMode> {
        self.step_mode.enter
    }
}

impl WithEvents for Exchange {
    fn events(&self) -> &Events {
        &self.events
    }

    fn leave(&self) -> Function<types::fmi3::fmi3EnterStepMode> {
        self.solving.enter_continuous_time_mode
    }
}

impl<Of: WithEvents> EventHandling for Instance<Of> {
    fn enter_event_mode(&self) -> Called {
        // SAFETY: the instance is alive.
        self.component
            .call(self.functions.of_interface.events().enter_event_mode, |call, it| unsafe { call(it) })
    }

    fn leave_event_mode(&self) -> Called {
        let leave = self.functions.of_interface.leave();
        // SAFETY: the instance is alive.
        self.component.call(leave, |leave, it| unsafe { leave(it) })
    }

    fn update_discrete_states(&self) -> (Called, Discrete) {
        let (mut flags, mut next): ([Boolean; 5], f64) = ([FALSE; 5], 0.0);
        let [again, terminates, nominals, values, has_next] = &mut flags;
        // SAFETY: the instance is alive, the places to write to are ours.
        let called = self
            .component
            .call(self.functions.of_interface.events().update_discrete_states, |call, it| unsafe {
                call(it, again, terminates, nominals, values, has_next, &raw mut next)
            });
        let [needs_update, terminates, _, _, has_next] = flags.map(|flag| flag != FALSE);
        (called, Discrete { needs_update, terminates, next_event: has_next.then_some(next) })
    }

    fn clocks(self: Rc<Self>) -> Option<Rc<dyn Clocks>> {
        Some(self)
    }
}

impl<Of: WithEvents> Clocks for Instance<Of> {
    fn tick(&self, clock: ValueReference) -> Called {
        let ticks: Boolean = TRUE;
        // SAFETY: the instance is alive, both arrays have one element.
        self.component.call(self.functions.of_interface.events().set_clock, |call, it| unsafe {
            call(it, &raw const clock, 1, &raw const ticks)
        })
    }

    fn interval(&self, clock: ValueReference) -> (Called, f64, c_int) {
        let (mut interval, mut qualifier) = (0.0, 0);
        // SAFETY: the instance is alive, the arrays have one element.
        let called =
            self.component.call(self.functions.of_interface.events().get_interval, |call, it| unsafe {
                call(it, &raw const clock, 1, &raw mut interval, &raw mut qualifier)
            });
        (called, interval, qualifier)
    }

    fn shift(&self, clock: ValueReference) -> (Called, f64) {
        let mut shift = 0.0;
        // SAFETY: the instance is alive, both arrays have one element.
        let called = self.component.call(self.functions.of_interface.events().get_shift, |call, it| unsafe {
            call(it, &raw const clock, 1, &raw mut shift)
        });
        (called, shift)
    }
}

impl EventCoSimulation for Instance<EventStepping> {}

impl ModelExchange for Instance<Exchange> {
    fn set_time(&self, time: f64) -> Called {
        self.component.time.set(Some(time));
        // SAFETY: the instance is alive.
        self.component
            .call(self.functions.of_interface.solving.set_time, |call, it| unsafe { call(it, time) })
    }

    fn set_states(&self, states: &[f64]) -> Called {
        // SAFETY: the instance is alive, and the pointer is to as many numbers.
        self.component.call(self.functions.of_interface.solving.set_states, |call, it| unsafe {
            call(it, states.as_ptr(), states.len())
        })
    }

    fn get_vector(&self, vector: Vector, values: &mut [f64]) -> Called {
        let of = &self.functions.of_interface.solving;
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
            .call(self.functions.of_interface.solving.completed_integrator_step, |call, it| unsafe {
                call(it, component.goes_on().into(), &raw mut event, &raw mut terminates)
            });
        (called, Completed { has_event: event != FALSE, terminates: terminates != FALSE })
    }
}
