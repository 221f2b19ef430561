//! A PI controller: a model that samples its inputs and remembers.

use fmu_export::{Context, Error, Model, Persistent, Step};

fmu_export::fmu!({Type});

/// What the actuator takes, in V.
const LIMITS: [f64; 2] = [-10.0, 10.0];

/// What the controller remembers from sample to sample: the integral term in V.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    integral: f64,
}

impl Model for {Type} {
    type Variables = Variables;

    fn initialize(
        &mut self,
        _variables: &mut Variables,
        _inputs: &Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        *self = Self::default();
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { parameters, outputs, .. } = variables;
        let inputs = step.inputs.initial();
        let proportional = parameters.gain * (inputs.reference - inputs.measurement);
        outputs.command = (self.integral + proportional).clamp(LIMITS[0], LIMITS[1]);
        // At a limit the integral term stays there.
        let integral = self.integral + proportional * step.size / parameters.integral_time;
        self.integral = integral.clamp(LIMITS[0], LIMITS[1]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_command_rises_with_the_error_up_to_its_limit() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(0.1)?;
        let first = simulation.variables.outputs.command;
        simulation.step(0.1)?;
        assert!(first > 0.0 && simulation.variables.outputs.command > first);
        simulation.inputs.reference = 100.0;
        simulation.step(0.1)?;
        assert!(simulation.variables.outputs.command >= LIMITS[1]);
        Ok(())
    }
}
