//! Heat conduction in a rod, in cells of equal length: an array of states, each of which reads its neighbors.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let Evaluation {
            parameters: p,
            inputs,
            states,
            derivatives,
            ..
        } = variables;
        let (cells, last) = (&states.t, states.t.len() - 1);
        let width = p.length / cells.len() as f64;
        let rate = p.diffusivity / (width * width);
        for (i, slope) in derivatives.t.iter_mut().enumerate() {
            // An end is half a cell from its cell's center: beyond it the profile goes on straight.
            let left = if i == 0 { inputs.left * 2.0 - cells[0] } else { cells[i - 1] };
            let right = if i == last { inputs.right * 2.0 - cells[last] } else { cells[i + 1] };
            *slope = rate * (left - cells[i] * 2.0 + right);
        }
    }
}
