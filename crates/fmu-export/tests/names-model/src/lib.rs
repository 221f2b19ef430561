//! A model with the names that other tools write: reserved words, blanks, letters beyond ASCII, quotes, and elements
//! of arrays within a name. Components in components, too, whose names have dots.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct Names);

impl Equations for Names {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (p, inputs) = (variables.parameters, variables.inputs);
        variables.outputs.sum_of_some =
            [p.in_, p.type_, p.self_, p.größe, p.a_2__b, p.a_b_c].into_iter().sum();
        variables.derivatives._y__2___v = inputs.u - variables.states._y__2___v;
        variables.outputs.arr_in = [1.0, 2.0, 3.0].map(|factor| inputs.small_x * factor);
        variables.outputs.gear_out = inputs.gear;
        let (p, states) = (&p.plant, &variables.states.plant);
        let Evaluation { derivatives, locals, outputs, .. } = variables;
        for (source, p, states, derivatives, locals, outputs) in [
            (
                inputs.u,
                &p.first,
                &states.first,
                &mut derivatives.plant.first,
                &mut locals.plant.first,
                &mut outputs.plant.first,
            ),
            (
                states.first.wall.t,
                &p.second,
                &states.second,
                &mut derivatives.plant.second,
                &mut locals.plant.second,
                &mut outputs.plant.second,
            ),
        ] {
            locals.heat = p.gain * source;
            derivatives.wall.t = (locals.heat - states.wall.t) / p.wall.c;
            outputs.sensor.reading = states.wall.t + p.sensor.bias;
        }
    }
}
