//! A first-order lag: a model with a continuous state.

use fmu_export::{Context, Error, Model, Step};

fmu_export::fmu!(struct {Type});

impl Model for {Type} {
    type Variables = Variables;

    fn refresh(&mut self, variables: &mut Variables, inputs: &Inputs) {
        let Variables { parameters, states, derivatives, .. } = variables;
        derivatives.lagged_voltage = (inputs.voltage - states.lagged_voltage) / parameters.time_constant;
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        // Exact for a voltage that holds its value during the step; of a ramp, this is the mean.
        let voltage = step.inputs.at(step.size / 2.0).voltage;
        let decay = (-step.size / variables.parameters.time_constant).exp();
        let lagged = &mut variables.states.lagged_voltage;
        *lagged = voltage + (*lagged - voltage) * decay;
        self.refresh(variables, &step.inputs.at(step.size));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_voltage_follows_within_the_time_constant() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        for _ in 0..5 {
            simulation.step(0.1)?;
        }
        // 1 - 1/e of a step by 1 V; the tolerance is that of rounding.
        let expected = 1.0 - (-1.0_f64).exp();
        assert!((simulation.variables.states.lagged_voltage - expected).abs() < 1e-12);
        Ok(())
    }
}
