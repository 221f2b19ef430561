//! Diffusion in an insulated cube of equal cells, from a wave along each edge.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct Cube);

/// The cells along an edge.
fn edge(cells: usize) -> usize {
    (cells as f64).cbrt().round() as usize
}

impl Equations for Cube {
    type Variables = Variables;

    fn initialize<T: Number>(&self, variables: &mut fmu_export::VariablesOf<Self, T>) {
        let edge = edge(variables.states.x.len());
        for (cell, state) in variables.states.x.iter_mut().enumerate() {
            let places = [cell % edge, cell / edge % edge, cell / (edge * edge)];
            let waves = places.map(|place| (std::f64::consts::PI * (place as f64 + 0.5) / edge as f64).cos());
            *state = T::from(waves.iter().sum());
        }
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let cells = &variables.states.x;
        let edge = edge(cells.len());
        let rate = 0.01 * (edge * edge) as f64;
        for (cell, slope) in variables.derivatives.x.iter_mut().enumerate() {
            let mut sum = T::from(0.0);
            for stride in [1, edge, edge * edge] {
                let place = cell / stride % edge;
                if place > 0 {
                    sum += cells[cell - stride] - cells[cell];
                }
                if place + 1 < edge {
                    sum += cells[cell + stride] - cells[cell];
                }
            }
            *slope = sum * rate;
        }
    }
}
