//! Van der Pol's oscillator, whose damping depends on its state.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (&States { x0, x1 }, mu) = (variables.states, variables.parameters.mu);
        variables.derivatives.x0 = x1;
        variables.derivatives.x1 = mu * (-x0 * x0 + 1.0) * x1 - x0;
    }
}
