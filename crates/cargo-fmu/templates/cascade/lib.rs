//! Cascade control of a motor: two clocks, for a slow speed loop around a fast current loop.

use fmu_export::{Context, Error, Persistent, Sample, Sampled};

fmu_export::fmu!(sampled {Type});

/// The controllers' memory between samples: their integral terms, in A and V.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    of_speed: f64,
    of_current: f64,
}

impl Sampled for {Type} {
    type Variables = Variables;

    fn initialize(
        &mut self,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (parameters, clocks) = (&variables.parameters, &mut variables.clocks);
        clocks.speed_loop.set_interval(parameters.speed_period);
        clocks.current_loop.set_interval(parameters.current_period);
        Ok(())
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (parameters, inputs) = (&variables.parameters, &variables.inputs);
        let (clocks, outputs) = (&variables.clocks, &mut variables.outputs);
        if clocks.speed_loop.ticks() {
            let proportional = parameters.speed_gain * (inputs.speed_reference - inputs.speed);
            outputs.current_reference = self.of_speed + proportional;
            self.of_speed += proportional * parameters.speed_period / parameters.speed_time;
        }
        if clocks.current_loop.ticks() {
            let error = outputs.current_reference - inputs.current;
            let proportional = parameters.current_gain * error;
            outputs.voltage = self.of_current + proportional;
            self.of_current += proportional * parameters.current_period / parameters.current_time;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_speed_loop_commands_the_current_loop() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        // Both tick at the start; then the current loop alone, until 10 ms.
        simulation.step(0.0005)?;
        let first = simulation.variables.outputs;
        assert!((first.voltage - 1.0).abs() < 1e-12);
        simulation.step(0.009)?;
        let tenth = simulation.variables.outputs;
        assert!(tenth.current_reference <= first.current_reference);
        assert!(tenth.voltage > first.voltage);
        simulation.step(0.001)?;
        assert!(simulation.variables.outputs.current_reference > first.current_reference);
        Ok(())
    }
}
