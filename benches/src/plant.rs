//! The plant's three implementations behind one trait.

use std::sync::OnceLock;

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{InitializationMode, Inputs, Parameters, States, Variables};
use fmu_export::Inputs as _;
use fmu_export::description::Causality;
use fmu_export::fmi2::c_types::ValueReference;

use crate::direct::Direct;
use crate::library::{Instance, Library, State};
use crate::reference::Reference;

/// A plant that can save and restore its state.
pub trait Plant {
    /// A saved state.
    type Saved;
    /// A plant that starts from states. The exhaust acts on an area in m² of its wastegate, by default 0.
    fn given(states: &States, inputs: &Inputs, exhaust_area: f64) -> Self;
    /// Sets the inputs.
    fn set(&mut self, inputs: &Inputs);
    /// A communication step with its size in s.
    fn step(&mut self, size: f64);
    /// Saves the state.
    fn save(&mut self) -> Self::Saved;
    /// Restores a saved state.
    fn restore(&mut self, saved: &Self::Saved);
}

/// The exported library of the plant, loaded once.
pub fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(Library::load::<BoostPlant>)
}

#[derive(Debug)]
/// The FMU.
pub struct Fmu {
    /// The instance.
    pub instance: Instance<'static>,
    references: [ValueReference; Inputs::REALS.len()],
}

impl Fmu {
    fn set_inputs(&mut self, inputs: &Inputs) {
        let values: [f64; Inputs::REALS.len()] = std::array::from_fn(|position| inputs.real(position));
        self.instance.set(&self.references, &values);
    }
}

impl Plant for Fmu {
    type Saved = State;

    fn given(states: &States, inputs: &Inputs, exhaust_area: f64) -> Self {
        let library = library();
        let mut instance = library.instantiate();
        let mode = library.references(&["initialization.mode"])[0];
        instance.set_integer(mode, InitializationMode::Given.value());
        instance.set(&library.references(&States::NAMES), &states.to_array());
        instance.set(&library.references(&["actuator.exhaust_area"]), &[exhaust_area]);
        let names: Vec<_> = library.named(Causality::Input).collect();
        let references = library.references(&names).try_into().expect("all inputs are Real");
        let mut fmu = Self { instance, references };
        fmu.set_inputs(inputs);
        fmu.instance.enter_initialization();
        fmu.instance.exit_initialization();
        fmu
    }

    fn set(&mut self, inputs: &Inputs) {
        self.set_inputs(inputs);
    }

    fn step(&mut self, size: f64) {
        self.instance.step(size);
    }

    fn save(&mut self) -> State {
        self.instance.save()
    }

    fn restore(&mut self, saved: &State) {
        self.instance.restore(saved);
    }
}

impl Plant for Direct<BoostPlant> {
    type Saved = Self;

    fn given(states: &States, inputs: &Inputs, exhaust_area: f64) -> Self {
        Self::new(*inputs, |variables: &mut Variables| {
            variables.parameters.actuator.exhaust_area = exhaust_area;
            variables.parameters.initialization.mode = InitializationMode::Given;
            variables.start = *states;
        })
    }

    fn set(&mut self, inputs: &Inputs) {
        Self::set(self, *inputs);
    }

    fn step(&mut self, size: f64) {
        Self::step(self, size);
    }

    fn save(&mut self) -> Self {
        self.clone()
    }

    fn restore(&mut self, saved: &Self) {
        self.clone_from(saved);
    }
}

/// The straightforward right-hand side with the Runge-Kutta method.
#[derive(Clone)]
pub struct RungeKutta {
    reference: Reference,
    states: States,
    inputs: Inputs,
}

impl Plant for RungeKutta {
    type Saved = States;

    fn given(states: &States, inputs: &Inputs, exhaust_area: f64) -> Self {
        let mut parameters = Parameters::default();
        parameters.actuator.exhaust_area = exhaust_area;
        Self { reference: Reference::new(&parameters), states: *states, inputs: *inputs }
    }

    fn set(&mut self, inputs: &Inputs) {
        self.inputs = *inputs;
    }

    fn step(&mut self, size: f64) {
        self.reference.advance(&mut self.states, &self.inputs, size);
    }

    fn save(&mut self) -> States {
        self.states
    }

    fn restore(&mut self, saved: &States) {
        self.states = *saved;
    }
}
