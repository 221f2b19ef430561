//! A PI controller: a model that computes at its samples, and remembers from one to the next.

use fmu_export::{Context, Error, Persistent, Sample, Sampled};

fmu_export::fmu!(sampled {Type});

/// What the actuator takes, in V.
const LIMITS: [f64; 2] = [-10.0, 10.0];

/// What the controller remembers from sample to sample: the integral term in V.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
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
        inputs: &Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { parameters, outputs, .. } = variables;
        let proportional = parameters.gain * (inputs.reference - inputs.measurement);
        outputs.command = (self.integral + proportional).clamp(LIMITS[0], LIMITS[1]);
        // At a limit the integral term stays there.
        let integral = self.integral + proportional * parameters.sample_time / parameters.integral_time;
        self.integral = integral.clamp(LIMITS[0], LIMITS[1]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{SampledModel, Simulation};

    #[test]
    fn the_command_rises_at_samples_up_to_its_limit() -> Result<(), Error> {
        let mut simulation = Simulation::<SampledModel<{Type}>>::default();
        simulation.initialize()?;
        simulation.step(0.15)?;
        let two_samples = simulation.variables.outputs.command;
        assert!((two_samples - 0.55).abs() < 1e-12);
        simulation.step(0.05)?;
        assert_eq!(simulation.variables.outputs.command.to_bits(), two_samples.to_bits());
        simulation.inputs.reference = 100.0;
        simulation.step(0.1)?;
        assert!(simulation.variables.outputs.command >= LIMITS[1]);
        Ok(())
    }
}
