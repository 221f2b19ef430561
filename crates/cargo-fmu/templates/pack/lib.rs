//! A pack of cells in series: an array of components, each connected with those before and after it.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

impl Equations for {Type} {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (parameters, states) = (variables.parameters, variables.states);
        let current = variables.inputs.current;
        // Nothing flows beyond the first and the last cell.
        let flow = |from: usize, to: usize| match (states.cell.get(from), states.cell.get(to)) {
            (Some(from), Some(to)) => (from.t - to.t) * parameters.conductance,
            _ => T::from(0.0),
        };
        for (i, p) in parameters.cell.iter().enumerate() {
            let heat = current * current * p.resistance;
            let from_others = flow(i.wrapping_sub(1), i) + flow(i + 1, i);
            variables.derivatives.cell[i].charge = -current / p.capacity;
            variables.derivatives.cell[i].t = (heat + from_others) / parameters.heat_capacity;
            variables.locals.cell[i].voltage = states.cell[i].charge + 3.2 - current * p.resistance;
        }
        variables.outputs.voltage = variables.locals.cell.iter().map(|cell| cell.voltage).sum();
        let temperatures = states.cell.iter().map(|cell| cell.t);
        variables.outputs.t_max = temperatures.fold(T::from(0.0), Number::max);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{Error, Simulation};

    /// No heat leaves the pack, and the cell with the largest resistance is the hottest.
    #[test]
    fn the_heat_stays_in_the_pack() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        simulation.step(600.0)?;
        let variables = &simulation.variables;
        let (parameters, states) = (&variables.parameters.cell, &variables.states.cell);
        let heat: f64 = parameters.iter().map(|p| 4.0 * p.resistance * 600.0).sum();
        let stored: f64 = states.iter().map(|cell| (cell.t - 298.15) * 40.0).sum();
        assert!((stored / heat - 1.0).abs() < 1e-6, "{stored} J of {heat} J");
        assert!(states.iter().all(|cell| cell.t <= variables.outputs.t_max));
        assert!(variables.outputs.t_max <= states[11].t);
        Ok(())
    }
}
