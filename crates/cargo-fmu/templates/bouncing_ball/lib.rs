//! A bouncing ball: its velocity jumps at an event, where its height crosses 0.

use fmu_export::{Context, Equations, Error, Event, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// What the model remembers between events.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    rests: bool,
}

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let g = variables.parameters.g;
        variables.derivatives.h = variables.states.v;
        variables.derivatives.v = if self.rests { T::from(0.0) } else { g };
    }

    /// The depth, not the height: after a bounce it is 0, then negative, so that leaving the ground
    /// is not an event.
    fn event_indicators(&self, _time: f64, variables: &Variables, indicators: &mut [f64]) {
        indicators[0] = -variables.states.h;
    }

    fn event(
        &mut self,
        _event: &Event<'_>,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let states = &mut variables.states;
        if states.h <= 0.0 {
            // Even while rising: a ball left below the ground by rounding would keep falling.
            states.h = 0.0;
            let v = states.v.max(-variables.parameters.e * states.v);
            self.rests = v < variables.locals.v_min;
            states.v = if self.rests { 0.0 } else { v };
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_ball_comes_to_rest_after_eleven_bounces() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        // The fall takes sqrt(2 h/g) = 0.4515 s, flight n twice as long times e^n: together 2.499 s.
        simulation.step(2.49)?;
        assert!(simulation.variables.states.h > 0.0);
        simulation.step(0.01)?;
        assert!(simulation.model.equations.rests);
        Ok(())
    }
}
