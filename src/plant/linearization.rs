//! The plant linearized at an operating point, for tuning and analysis, exact up to rounding.

use fmu_export::Inputs as _;
use num_dual::Dual64;

use super::system::System;
use super::variables::{Inputs, Outputs, Parameters, States};

/// The number of inputs.
pub const INPUTS: usize = Inputs::REALS.len();

/// `dx/dt = f + A·Δx + B·Δu`, `y = g + C·Δx + D·Δu`. States, inputs and outputs are in declaration order and in their
/// variables' units.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpace {
    /// f: the states' derivatives at the point, 0 at a steady state.
    pub rates: States,
    /// g: the outputs at the point.
    pub outputs: Outputs,
    /// A: a row for each state's derivative, over the states.
    pub state_matrix: Vec<[f64; States::COUNT]>,
    /// B: the same over the inputs.
    pub input_matrix: Vec<[f64; INPUTS]>,
    /// C: a row for each output, over the states.
    pub output_matrix: Vec<[f64; States::COUNT]>,
    /// D: the same over the inputs.
    pub feedthrough_matrix: Vec<[f64; INPUTS]>,
}

/// Linearizes the plant with these parameters at inputs and states. The duty acts at once, as without the latch.
#[must_use]
pub fn linearize(parameters: &Parameters, inputs: &Inputs, states: &States) -> StateSpace {
    let system = System::new(&parameters.map(Dual64::from));
    // The derivatives of rates and outputs along a direction.
    let column = |input_seeds: &Inputs, state_seeds: &States| {
        let inputs = inputs.combine(input_seeds, &mut Dual64::new);
        let states = states.combine(state_seeds, &mut Dual64::new);
        let evaluation = system.evaluate(&inputs, &states);
        let outputs = system.quantities(&inputs, &states, &evaluation).0;
        (evaluation.derivatives(), outputs)
    };
    let (no_inputs, no_states) = (inputs.map(|_| 0.0), states.map(|_| 0.0));
    let by_states: [_; States::COUNT] = std::array::from_fn(|i| {
        column(&no_inputs, &States::from_array(std::array::from_fn(|k| f64::from(u8::from(k == i)))))
    });
    let by_inputs: [_; INPUTS] = std::array::from_fn(|i| {
        let mut seeds = no_inputs;
        seeds.set_real(i, 1.0);
        column(&seeds, &no_states)
    });
    let (rates, outputs) = by_states[0];
    StateSpace {
        rates: rates.map(|rate| rate.re),
        outputs: outputs.map(|output| output.re),
        state_matrix: rows(&by_states.map(|column| numbers_of_states(&column.0))),
        input_matrix: rows(&by_inputs.map(|column| numbers_of_states(&column.0))),
        output_matrix: rows(&by_states.map(|column| numbers_of_outputs(&column.1))),
        feedthrough_matrix: rows(&by_inputs.map(|column| numbers_of_outputs(&column.1))),
    }
}

fn numbers_of_states(states: &States<Dual64>) -> Vec<f64> {
    states.to_array().iter().map(|state| state.eps).collect()
}

fn numbers_of_outputs(outputs: &Outputs<Dual64>) -> Vec<f64> {
    let mut numbers = Vec::new();
    let _ = outputs.map(|output| numbers.push(output.eps));
    numbers
}

/// A matrix by rows, from its columns.
fn rows<const N: usize>(columns: &[Vec<f64>; N]) -> Vec<[f64; N]> {
    (0..columns[0].len()).map(|row| std::array::from_fn(|column| columns[column][row])).collect()
}
