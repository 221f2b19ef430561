//! Outputs that are the inputs: variables of each type, continuous and discrete.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: &mut Variables<T>) {
        let Variables { inputs, outputs, .. } = variables;
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
    use fmu_export::{Error, Integrated, Simulation};

    #[test]
    fn outputs_are_the_inputs() -> Result<(), Error> {
        let mut simulation = Simulation::<Integrated<{Type}>>::default();
        simulation.inputs.string_input = "FMI".to_owned();
        simulation.inputs.enumeration_input = Option::Option2;
        simulation.initialize()?;
        let Outputs { string_output, enumeration_output, .. } = &simulation.variables.outputs;
        assert_eq!((string_output.as_str(), *enumeration_output), ("FMI", Option::Option2));
        Ok(())
    }
}
