//! A vehicle that follows a drive cycle: a table of the speed over time, whose points are time events.

use fmu_export::table::{Curve, Table};
use fmu_export::{Context, Equations, Error, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// The drive cycle: speeds (m/s) at times (s).
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    times: Vec<f64>,
    speeds: Vec<f64>,
}

impl {Type} {
    fn cycle(&self) -> Curve<'_> {
        Curve::new(&self.times, &self.speeds)
    }
}

impl Equations for {Type} {
    type Variables = Variables;

    fn prepare(&mut self, _: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        [self.times, self.speeds] = Table::resource(context, "cycle.csv")?.columns()?;
        self.cycle().check("cycle.csv")
    }

    fn evaluate<T: Number>(&self, time: T, variables: Evaluation<'_, T>) {
        let (p, states) = (variables.parameters, variables.states);
        variables.outputs.target = self.cycle().at(time);
        let acceleration = (variables.outputs.target - states.speed) / p.time_constant;
        variables.derivatives.speed = acceleration;
        variables.derivatives.distance = states.speed;
        variables.outputs.force = p.mass * acceleration;
    }

    /// No step goes past a point of the cycle, however long it is.
    fn next_event(&self, time: f64, _variables: &Variables) -> Option<f64> {
        self.cycle().next_point(time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_vehicle_drives_the_distance_of_the_cycle() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(200.0)?;
        // Two trapezoids, after which the vehicle rests.
        let expected = 8.0 * (16.0 + 4.0) + 14.0 * (60.0 + 10.0);
        let distance = simulation.variables.states.distance;
        assert!((distance - expected).abs() < 1e-4 * expected, "{distance}");
        Ok(())
    }
}
