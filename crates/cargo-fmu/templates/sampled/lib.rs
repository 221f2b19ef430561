//! A PI controller: a model that computes at its samples, and remembers values between them.

use fmu_export::{Context, Error, Persistent, Sample, Sampled};

fmu_export::fmu!(sampled {Type});

/// The actuator's limits, in V.
const LIMITS: [f64; 2] = [-10.0, 10.0];

/// The controller's memory between samples: the integral term in V.
#[derive(Clone, Debug, Default, Persistent)]
pub struct {Type} {
    integral: f64,
}

impl Sampled for {Type} {
    type Variables = Variables;

    fn period(variables: &Variables) -> f64 {
        variables.parameters.sample_time
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (parameters, inputs) = (&variables.parameters, &variables.inputs);
        let proportional = parameters.gain * (inputs.reference - inputs.measurement);
        let command = self.integral + proportional;
        variables.outputs.command = command.clamp(LIMITS[0], LIMITS[1]);
        let rise = proportional * parameters.sample_time / parameters.integral_time;
        // Anti-windup: the integral term stays within the limits.
        self.integral = (self.integral + rise).clamp(LIMITS[0], LIMITS[1]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_command_rises_at_samples_up_to_its_limit() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(0.15)?;
        // Two samples: proportional 0.5 V, and 0.05 V of the integral term.
        let two_samples = simulation.variables.outputs;
        assert!((two_samples.command - 0.55).abs() < 1e-12);
        simulation.step(0.05)?;
        assert_eq!(simulation.variables.outputs, two_samples);
        simulation.variables.inputs.reference = 100.0;
        simulation.step(0.1)?;
        assert!(simulation.variables.outputs.command >= LIMITS[1]);
        Ok(())
    }
}
