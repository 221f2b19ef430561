//! Prints what derivatives of the plant's charge temperature with respect to all inputs and states take: one adjoint
//! derivative, or a directional one for each. Under valgrind, which counts the instructions of each:
//!
//! ```text
//! cargo build --profile fmu-library -p benches --bin derivatives
//! valgrind --tool=callgrind --toggle-collect='derivatives::adjoint' target/fmu-library/derivatives
//! valgrind --tool=callgrind --toggle-collect='derivatives::directional' target/fmu-library/derivatives
//! ```

use std::hint::black_box;

use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables::{Inputs, States, Variables};
use fmu_export::{Accessed as _, Dual, Inputs as _, Model as _, Numbered as _, Simulation, Tape};

#[inline(never)]
fn adjoint(plant: &Simulation<BoostPlant>, weights: &Variables, tape: &mut Tape) -> Variables {
    let Simulation { model, variables, .. } = plant;
    model.differentiate_backwards(0.0, variables, weights, false, tape).expect("there are derivatives")
}

#[inline(never)]
fn directional(plant: &Simulation<BoostPlant>) -> (Inputs, States) {
    let Simulation { model, variables, .. } = plant;
    let along = |direction: &Variables| {
        model
            .differentiate(Dual::default(), variables, direction)
            .expect("there are derivatives")
            .outputs
            .charge_temperature
    };
    let mut by_inputs = *variables.inputs();
    for input in 0..Inputs::REALS.len() {
        let mut direction = Variables::zero();
        direction.inputs.set_real(input, 1.0);
        by_inputs.set_real(input, along(&direction));
    }
    let by_states = States::from_array(std::array::from_fn(|state| {
        let mut direction = Variables::zero();
        direction.start =
            States::from_array(std::array::from_fn(|other| f64::from(u8::from(other == state))));
        along(&direction)
    }));
    (by_inputs, by_states)
}

fn main() {
    let mut plant = Simulation::<BoostPlant>::default();
    plant.initialize().expect("there are values");
    let mut weights = Variables::zero();
    weights.outputs.charge_temperature = 1.0;
    let mut tape = Tape::new();
    let backward = black_box(adjoint(&plant, &weights, &mut tape));
    let (by_inputs, by_states) = black_box(directional(&plant));
    println!("{:?} {:?}", backward.inputs, by_inputs);
    println!("{:?} {:?}", backward.states, by_states);
}
