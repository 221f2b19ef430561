//! Van der Pol's oscillator, whose damping depends on its state.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: &mut Variables<T>) {
        let Variables { parameters, states, derivatives, .. } = variables;
        derivatives.x0 = states.x1;
        derivatives.x1 = parameters.mu * (-states.x0 * states.x0 + 1.0) * states.x1 - states.x0;
    }
}
