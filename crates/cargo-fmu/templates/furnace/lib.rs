//! A furnace: a fast fuel valve drives a slow thermal mass, each integrated in its own steps.

use fmu_export::{Equations, Multirate, Number, Part, TwoRates};

// The valve's two states come first in the JSON.
fmu_export::fmu!(equations struct {Type}, TwoRates<2, 1>);

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, mut variables: Evaluation<'_, T>) {
        valve(&mut variables);
        mass(&mut variables);
    }
}

impl Multirate for {Type} {
    fn evaluate_part(&self, part: Part, _time: f64, mut variables: Evaluation<'_>) {
        match part {
            Part::Fast => valve(&mut variables),
            Part::Slow => mass(&mut variables),
        }
    }
}

/// A damped oscillator at 200 1/s.
fn valve<T: Number>(variables: &mut Evaluation<'_, T>) {
    let states = variables.states;
    variables.derivatives.opening = states.speed;
    variables.derivatives.speed =
        (variables.inputs.command - states.opening) * 4e4 - states.speed * 100.0;
}

fn mass<T: Number>(variables: &mut Evaluation<'_, T>) {
    let (p, states) = (variables.parameters, variables.states);
    let loss = p.conductance * (states.temperature - p.ambient_temperature);
    variables.derivatives.temperature = (p.power * states.opening - loss) / p.heat_capacity;
}
