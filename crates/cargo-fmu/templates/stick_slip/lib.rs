//! A block that a spring pulls over the ground: it sticks, slips, and sticks again.

use fmu_export::{Context, Equations, Error, Event, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// What the model remembers from event to event.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    mode: Mode,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Persistent)]
enum Mode {
    #[default]
    Sticks,
    Slips {
        /// 1 forwards, -1 backwards.
        direction: f64,
    },
}

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, time: T, variables: &mut Variables<T>) {
        let Variables {
            parameters,
            states,
            derivatives,
            outputs,
            ..
        } = variables;
        outputs.force = parameters.stiffness * (parameters.pull_speed * time - states.position);
        let friction = parameters.sliding_friction;
        derivatives.position = states.speed;
        derivatives.speed = match self.mode {
            Mode::Sticks => T::from(0.0),
            Mode::Slips { direction } => (outputs.force - friction * direction) / parameters.mass,
        };
    }

    /// Positive where the mode ends.
    fn event_indicators(&self, _time: f64, variables: &Variables, indicators: &mut [f64]) {
        let Variables {
            parameters,
            states,
            outputs,
            ..
        } = variables;
        indicators[0] = match self.mode {
            Mode::Sticks => outputs.force.abs() / parameters.static_friction - 1.0,
            Mode::Slips { direction } => -direction * states.speed / parameters.pull_speed,
        };
    }

    fn event(
        &mut self,
        _: &Event<'_>,
        variables: &mut Variables,
        _: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables {
            parameters,
            states,
            outputs,
            ..
        } = variables;
        let holds = outputs.force.abs() < parameters.static_friction;
        self.mode = match self.mode {
            Mode::Slips { direction } if direction * states.speed > 0.0 => self.mode,
            _ if holds => Mode::Sticks,
            _ => Mode::Slips {
                direction: outputs.force.signum(),
            },
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
    use fmu_export::{Integrated, Simulation};

    #[test]
    fn the_block_slips_once_the_spring_is_stronger_than_static_friction() -> Result<(), Error> {
        let mut simulation = Simulation::<Integrated<{Type}>>::default();
        simulation.initialize()?;
        // 2 N are reached at 2 N / (100 N/m · 0.1 m/s) = 0.2 s; it slips for 2 (π - π/4) / (10 1/s) = 0.471 s.
        simulation.step(0.19)?;
        assert_eq!(simulation.model.equations.mode, Mode::Sticks);
        simulation.step(0.02)?;
        assert_eq!(
            simulation.model.equations.mode,
            Mode::Slips { direction: 1.0 }
        );
        simulation.step(0.47)?;
        assert_eq!(simulation.model.equations.mode, Mode::Sticks);
        Ok(())
    }
}
