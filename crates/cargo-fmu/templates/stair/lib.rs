//! A stair: an event every second; after ten steps the model ends the simulation.

use fmu_export::{Context, Equations, Error, Event, Number};

fmu_export::fmu!(equations struct {Type});

/// Where the stair ends.
const TOP: i32 = 10;

impl Equations for {Type} {
    type Variables = Variables;

    /// The counter changes only at events.
    fn evaluate<T: Number>(&self, _time: T, _variables: Evaluation<'_>) {}

    fn next_event(&self, time: f64, _variables: &Variables) -> Option<f64> {
        Some(time.floor() + 1.0)
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let counter = &mut variables.outputs.counter;
        if event.is_due {
            *counter += 1;
        }
        if *counter >= TOP {
            context.terminate(event.time);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_model_asks_for_the_end_at_the_top() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(8.5)?;
        assert_eq!(simulation.variables.outputs.counter, 9);
        assert!(simulation.step(1.0).is_err());
        assert_eq!(simulation.variables.outputs.counter, TOP);
        assert!((8.999..9.001).contains(&simulation.time));
        Ok(())
    }
}
