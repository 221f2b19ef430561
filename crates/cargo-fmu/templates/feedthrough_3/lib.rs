//! Outputs equal to inputs: variables of each FMI 3.0 type, continuous and discrete.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (inputs, outputs) = (variables.inputs, variables.outputs);
        outputs.float32_continuous_output = inputs.float32_continuous_input;
        outputs.float32_discrete_output = inputs.float32_discrete_input;
        outputs.float64_continuous_output = inputs.float64_continuous_input;
        outputs.float64_discrete_output = inputs.float64_discrete_input;
        outputs.int8_output = inputs.int8_input;
        outputs.uint8_output = inputs.uint8_input;
        outputs.int16_output = inputs.int16_input;
        outputs.uint16_output = inputs.uint16_input;
        outputs.int32_output = inputs.int32_input;
        outputs.uint32_output = inputs.uint32_input;
        outputs.int64_output = inputs.int64_input;
        outputs.uint64_output = inputs.uint64_input;
        outputs.boolean_output = inputs.boolean_input;
        outputs.string_output.clone_from(&inputs.string_input);
        outputs.binary_output.clone_from(&inputs.binary_input);
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
        simulation.variables.inputs.binary_input = vec![0, 255];
        simulation.variables.inputs.int8_input = i8::MIN;
        simulation.variables.inputs.enumeration_input = Option::Option2;
        simulation.initialize()?;
        assert_eq!(simulation.variables.outputs.string_output, "FMI");
        assert_eq!(simulation.variables.outputs.binary_output, [0, 255]);
        assert_eq!(simulation.variables.outputs.int8_output, -128);
        let option = simulation.variables.outputs.enumeration_output;
        assert_eq!(option, Option::Option2);
        Ok(())
    }
}
