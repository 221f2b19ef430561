//! Heat conduction in a rod, in cells of equal length: an array of states, each of which reads its neighbors.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (p, ends, cells) = (variables.parameters, variables.inputs, &variables.states.t);
        let n = cells.len();
        #[allow(clippy::cast_precision_loss)] // A rod has fewer cells than 2 to the power of 53.
        let width = p.length / n as f64;
        let rate = p.diffusivity / (width * width);
        // From 1. An end is half a cell from the center of its cell; beyond it the profile is a straight line.
        let at = |cell: usize| match cell {
            0 => ends.left * 2.0 - cells[0],
            cell if cell <= n => cells[cell - 1],
            _ => ends.right * 2.0 - cells[n - 1],
        };
        for (cell, slope) in (1..).zip(variables.derivatives.t.iter_mut()) {
            *slope = rate * (at(cell - 1) - at(cell) * 2.0 + at(cell + 1));
        }
    }
}
