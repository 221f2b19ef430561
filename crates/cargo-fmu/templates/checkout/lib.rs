//! A checkout around a simulation that steps itself, as of another crate.

mod queue;

use fmu_export::{Context, Error, Persistent, Step, Stepper};
use queue::Queue;

fmu_export::fmu!(stepper {Type});

const HOUR: f64 = 3600.0; // s

/// The queue, once it is initialized; one of another crate's type is saved by `#[persistent(serde)]`.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    queue: Option<Queue>,
}

impl Stepper for {Type} {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, _: &mut Context<'_>) -> Result<(), Error> {
        let (parameters, inputs) = (&variables.parameters, &variables.inputs);
        let rates = [inputs.arrivals * HOUR, parameters.service * HOUR];
        let queue = Queue::new(parameters.seed, rates);
        variables.outputs.waiting = queue.waiting();
        self.queue = Some(queue);
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let queue = self.queue.as_mut();
        let queue = queue.ok_or_else(|| Error::new("there is no queue"))?;
        queue.arrivals_per_hour = variables.inputs.arrivals * HOUR;
        queue.run_until((step.end() - context.experiment.start_time) / HOUR);
        variables.outputs.waiting = queue.waiting();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn arrivals_stop_when_the_input_says_so() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(HOUR)?;
        simulation.variables.inputs.arrivals = 1e-9;
        simulation.step(10.0 * HOUR)?;
        assert_eq!(simulation.variables.outputs.waiting, 0);
        Ok(())
    }
}
