//! A first-order lag: a model of equations.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: &mut Variables<T>) {
        let Variables { parameters, inputs, states, derivatives, .. } = variables;
        derivatives.lagged_voltage = (inputs.voltage - states.lagged_voltage) / parameters.time_constant;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{Integrated, Error, Simulation};

    #[test]
    fn the_voltage_follows_within_the_time_constant() -> Result<(), Error> {
        let mut simulation = Simulation::<Integrated<{Type}>>::default();
        simulation.initialize()?;
        for _ in 0..5 {
            simulation.step(0.1)?;
        }
        // 1 - 1/e of a step by 1 V, to the default tolerance of 1e-6 in each of five steps.
        let expected = 1.0 - (-1.0_f64).exp();
        assert!((simulation.variables.states.lagged_voltage - expected).abs() < 5e-6);
        Ok(())
    }
}
