//! A block pulled over the ground by a spring: it sticks, slips, and sticks again.

use fmu_export::{Context, Equations, Error, Event, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// What the model remembers between events.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    mode: Mode,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
enum Mode {
    #[default]
    Sticks,
    Slips(f64), // 1 forwards, -1 backwards
}

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, time: T, variables: Evaluation<'_, T>) {
        let p = variables.parameters;
        let (states, outputs) = (variables.states, variables.outputs);
        outputs.force = p.stiffness * (p.pull_speed * time - states.position);
        variables.derivatives.position = states.speed;
        variables.derivatives.speed = match self.mode {
            Mode::Sticks => T::from(0.0),
            Mode::Slips(direction) => (outputs.force - p.sliding_friction * direction) / p.mass,
        };
    }

    /// Positive where the mode ends.
    fn event_indicators(&self, _time: f64, variables: &Variables, indicators: &mut [f64]) {
        let p = &variables.parameters;
        indicators[0] = match self.mode {
            Mode::Sticks => variables.outputs.force.abs() / p.static_friction - 1.0,
            Mode::Slips(direction) => -direction * variables.states.speed / p.pull_speed,
        };
    }

    fn event(
        &mut self,
        _event: &Event<'_>,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (states, force) = (&mut variables.states, variables.outputs.force);
        self.mode = match self.mode {
            Mode::Slips(direction) if direction * states.speed > 0.0 => self.mode,
            _ if force.abs() < variables.parameters.static_friction => Mode::Sticks,
            _ => Mode::Slips(force.signum()),
        };
        if self.mode == Mode::Sticks {
            states.speed = 0.0;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_block_slips_once_the_spring_is_stronger_than_static_friction() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        // 2 N are reached at 2 N / (100 N/m · 0.1 m/s) = 0.2 s; it slips for 2 (π - π/4) / (10 1/s) = 0.471 s.
        simulation.step(0.19)?;
        assert_eq!(simulation.model.equations.mode, Mode::Sticks);
        simulation.step(0.02)?;
        assert_eq!(simulation.model.equations.mode, Mode::Slips(1.0));
        simulation.step(0.47)?;
        assert_eq!(simulation.model.equations.mode, Mode::Sticks);
        Ok(())
    }
}
