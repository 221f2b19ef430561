//! A number read from a file in the FMU when the model starts.

use fmu_export::{Context, Equations, Error, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn prepare(
        &mut self,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.outputs.y = first_character(&context.resource("y.txt")?)?;
        Ok(())
    }

    fn evaluate<T: Number>(&self, _time: T, _variables: Evaluation<'_>) {}
}

fn first_character(text: &[u8]) -> Result<i32, Error> {
    match text.first() {
        Some(first) => Ok(i32::from(*first)),
        None => Err(Error::new("the resource y.txt is empty")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_output_is_the_first_character() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        assert_eq!(simulation.variables.outputs.y, 97);
        assert!(first_character(b"").is_err());
        Ok(())
    }
}
