//! Outputs equal to inputs: variables of each type, continuous and discrete.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (inputs, outputs) = (variables.inputs, variables.outputs);
        outputs.float64_continuous_output = inputs.float64_continuous_input;
        outputs.float64_discrete_output = inputs.float64_discrete_input;
        outputs.int32_output = inputs.int32_input;
        outputs.boolean_output = inputs.boolean_input;
        outputs.string_output.clone_from(&inputs.string_input);
        outputs.enumeration_output = inputs.enumeration_input;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{Error, Simulation};

    #[test]
    fn outputs_are_the_inputs() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.variables.inputs.string_input = "FMI".to_owned();
        simulation.variables.inputs.enumeration_input = Option::Option2;
        simulation.initialize()?;
        assert_eq!(simulation.variables.outputs.string_output, "FMI");
        let option = simulation.variables.outputs.enumeration_output;
        assert_eq!(option, Option::Option2);
        Ok(())
    }
}
