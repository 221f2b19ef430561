//! Diffusion along an insulated rod of equal cells, from two waves.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct Rod);

impl Equations for Rod {
    type Variables = Variables;

    fn initialize<T: Number>(&self, variables: &mut fmu_export::VariablesOf<Self, T>) {
        let cells = variables.states.x.len() as f64;
        for (cell, state) in variables.states.x.iter_mut().enumerate() {
            let angle = std::f64::consts::PI * (cell as f64 + 0.5) / cells;
            *state = T::from(angle.cos() + 0.5 * (10.0 * angle).cos());
        }
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let cells = &variables.states.x;
        let last = cells.len() - 1;
        let rate = 0.01 * (cells.len() * cells.len()) as f64;
        let slopes = &mut variables.derivatives.x;
        slopes[0] = (cells[1] - cells[0]) * rate;
        for cell in 1..last {
            slopes[cell] = (cells[cell - 1] - cells[cell] * 2.0 + cells[cell + 1]) * rate;
        }
        slopes[last] = (cells[last - 1] - cells[last]) * rate;
    }
}
