//! Dahlquist's test equation, der(x) = -k x: a model is its equations.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        variables.derivatives.x = -variables.parameters.k * variables.states.x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{Error, Simulation};

    #[test]
    fn the_state_decays_exponentially() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.variables.parameters.k = 2.0;
        simulation.initialize()?;
        for _ in 0..5 {
            simulation.step(0.1)?;
        }
        // To the default tolerance of 1e-6 in each of five steps.
        assert!((simulation.variables.states.x - (-1.0_f64).exp()).abs() < 5e-6);
        Ok(())
    }
}
