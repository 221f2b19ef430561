//! The closed loop over the steps of the paper's Fig. 13, as in `benches/python/masters.py`: 124 s at 80 Hz, in
//! each step the controller first.

use std::sync::OnceLock;

use boost_fmu::BoostController;
use boost_fmu::controller::variables::Inputs as ControllerInputs;
use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::Inputs as PlantInputs;
use fmu_export::description::Causality;
use fmu_export::fmi2::c_types::ValueReference;

use crate::boost_steps::BOOST_STEPS;
use crate::direct::Direct;
use crate::library::{Instance, Library};
use crate::plant;

/// The size of a step in s.
const STEP: f64 = 1.0 / 80.0;

/// How many steps there are.
pub const STEPS: u32 = 124 * 80;

fn boost_reference(step: u32) -> f64 {
    // Half a step later, where rounding does not matter.
    let time = (f64::from(step) + 0.5) * STEP;
    BOOST_STEPS[BOOST_STEPS.partition_point(|&(begin, _)| begin <= time) - 1].1
}

/// The exported library of the controller, loaded once.
pub fn controller_library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(Library::load::<BoostController>)
}

/// The value references of a connection at both ends, and a buffer for the values.
#[derive(Debug)]
struct Wires {
    sources: Vec<ValueReference>,
    targets: Vec<ValueReference>,
    values: Vec<f64>,
}

impl Wires {
    /// Connects outputs to inputs of equal names.
    fn between(source: &Library, target: &Library) -> Self {
        let inputs: Vec<_> = target.named(Causality::Input).collect();
        let names: Vec<_> = source.named(Causality::Output).filter(|name| inputs.contains(name)).collect();
        Self {
            sources: source.references(&names),
            targets: target.references(&names),
            values: vec![0.0; names.len()],
        }
    }

    fn transfer(&mut self, source: &mut Instance<'_>, target: &mut Instance<'_>) {
        source.get(&self.sources, &mut self.values);
        target.set(&self.targets, &self.values);
    }
}

/// Both FMUs under a master that exchanges values by their references.
#[derive(Debug)]
pub struct Fmus {
    controller: Instance<'static>,
    plant: Instance<'static>,
    measurements: Wires,
    commands: Wires,
    reference: Vec<ValueReference>,
    boost: Vec<ValueReference>,
    duty: Vec<ValueReference>,
}

impl Default for Fmus {
    /// The FMUs at rest where the controller begins.
    fn default() -> Self {
        let (controllers, plants) = (controller_library(), plant::library());
        let mut this = Self {
            controller: controllers.instantiate(),
            plant: plants.instantiate(),
            measurements: Wires::between(plants, controllers),
            commands: Wires::between(controllers, plants),
            reference: controllers.references(&["boost_reference"]),
            boost: plants.references(&["boost_pressure"]),
            duty: controllers.references(&["hp_wastegate_pwm"]),
        };
        this.controller.enter_initialization();
        this.plant.enter_initialization();
        this.commands.transfer(&mut this.controller, &mut this.plant);
        this.controller.exit_initialization();
        this.plant.exit_initialization();
        this
    }
}

impl Fmus {
    /// The whole experiment: boost pressure (Pa) and duty (%) after each step.
    pub fn run(&mut self) -> Vec<[f64; 2]> {
        let mut rows = Vec::with_capacity(STEPS as usize);
        for step in 0..STEPS {
            self.controller.set(&self.reference, &[boost_reference(step)]);
            self.measurements.transfer(&mut self.plant, &mut self.controller);
            self.controller.step(STEP);
            self.commands.transfer(&mut self.controller, &mut self.plant);
            self.plant.step(STEP);
            let mut row = [0.0; 2];
            self.plant.get(&self.boost, &mut row[..1]);
            self.controller.get(&self.duty, &mut row[1..]);
            rows.push(row);
        }
        rows
    }
}

/// Both models called directly.
#[derive(Clone)]
pub struct Models {
    controller: Direct<BoostController>,
    plant: Direct<BoostPlant>,
}

impl Default for Models {
    /// The models at rest where the controller begins.
    fn default() -> Self {
        let controller = Direct::<BoostController>::new(ControllerInputs::default(), |_| {});
        let plant = Direct::new(commands(&controller), |_| {});
        Self { controller, plant }
    }
}

impl Models {
    /// The whole experiment: boost pressure (Pa) and duty (%) after each step.
    pub fn run(&mut self) -> Vec<[f64; 2]> {
        let mut rows = Vec::with_capacity(STEPS as usize);
        for step in 0..STEPS {
            let measured = &self.plant.variables.outputs;
            self.controller.set(ControllerInputs {
                boost_reference: boost_reference(step),
                boost_pressure: measured.boost_pressure,
                tank_pressure: measured.tank_pressure,
                supply_voltage_measured: measured.supply_voltage_measured,
                ..self.controller.variables.inputs
            });
            self.controller.step(STEP);
            self.plant.set(commands(&self.controller));
            self.plant.step(STEP);
            let duty = self.controller.variables.outputs.hp_wastegate_pwm;
            rows.push([self.plant.variables.outputs.boost_pressure, duty]);
        }
        rows
    }
}

/// The plant's inputs that the controller puts out; the others keep their start values.
fn commands(controller: &Direct<BoostController>) -> PlantInputs {
    let outputs = &controller.variables.outputs;
    PlantInputs {
        hp_wastegate_pwm: outputs.hp_wastegate_pwm,
        vacuum_pump: outputs.vacuum_pump,
        lp_wastegate: outputs.lp_wastegate,
        hp_bypass: outputs.hp_bypass,
        ..PlantInputs::default()
    }
}
