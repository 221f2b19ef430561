//! The power of a resistor: a model whose outputs follow from its inputs alone.

use fmu_export::{Context, Error, Model, Step};

fmu_export::fmu!(struct {Type});

impl Model for {Type} {
    type Variables = Variables;

    fn refresh(&mut self, _time: f64, variables: &mut Variables, inputs: &Inputs) {
        variables.outputs.power = inputs.voltage * inputs.voltage / variables.parameters.resistance;
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.refresh(step.end(), variables, &step.inputs.at(step.size));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn twice_the_voltage_is_four_times_the_power() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        let power = simulation.variables.outputs.power;
        simulation.inputs.voltage = 2.0;
        simulation.step(0.1)?;
        assert_eq!(simulation.variables.outputs.power.to_bits(), (4.0 * power).to_bits());
        Ok(())
    }
}
