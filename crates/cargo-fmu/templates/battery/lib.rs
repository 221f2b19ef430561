//! A battery of cells in series, with a measured voltage over their charge, whose contactor opens at undervoltage.

use fmu_export::table::{Curve, Table};
use fmu_export::{Context, Equations, Error, Event, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// The open-circuit voltage (V) over the state of charge, and what the model remembers.
#[derive(Clone, Debug, Default, Persistent)]
struct {Type} {
    charges: Vec<f64>,
    voltages: Vec<f64>,
    is_tripped: bool,
}

impl {Type} {
    fn open_circuit_voltage(&self) -> Curve<'_> {
        Curve::new(&self.charges, &self.voltages).cubic()
    }

    /// The contactor: 1 while it is closed, otherwise 0.
    fn contact(&self) -> f64 {
        f64::from(!self.is_tripped)
    }

    /// How far the voltage of the weakest cell is above the least one (V).
    fn reserve(&self, variables: &Variables) -> f64 {
        let p = &variables.parameters;
        let charges = variables.states.charge.iter();
        let least = charges.fold(f64::INFINITY, |least, charge| least.min(*charge));
        let drop = variables.inputs.current * self.contact() * p.resistance;
        self.open_circuit_voltage().at(least) - drop - p.least_voltage
    }
}

impl Equations for {Type} {
    type Variables = Variables;

    fn prepare(
        &mut self,
        _variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        [self.charges, self.voltages] = Table::resource(context, "voltage.csv")?.columns()?;
        self.open_circuit_voltage().check("voltage.csv")
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let p = variables.parameters;
        let current = variables.inputs.current * self.contact();
        let curve = self.open_circuit_voltage();
        variables.derivatives.charge = [-current / p.capacity; 12];
        let voltage = |charge| curve.at(charge) - current * p.resistance;
        variables.outputs.cell_voltage = variables.states.charge.map(voltage);
        let sum: T = variables.outputs.cell_voltage.iter().sum();
        variables.outputs.voltage = sum * self.contact();
    }

    fn event_indicators(&self, _time: f64, variables: &Variables, indicators: &mut [f64]) {
        indicators[0] = self.reserve(variables);
    }

    fn event(
        &mut self,
        _event: &Event<'_>,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if !self.is_tripped && self.reserve(variables) <= 0.0 {
            self.is_tripped = true;
            variables.outputs.is_tripped = true;
            context.event(format_args!("undervoltage: the contactor opens"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::Simulation;

    #[test]
    fn the_weakest_cell_trips_the_battery() -> Result<(), Error> {
        let mut simulation = Simulation::<{Type}>::default();
        simulation.initialize()?;
        // At 2 A, 2900 s take 81 of the weakest cell's 88 %; it trips at 5 %, about.
        simulation.step(2900.0)?;
        assert!(!simulation.variables.outputs.is_tripped);
        simulation.step(200.0)?;
        assert!(simulation.variables.outputs.is_tripped);
        Ok(())
    }
}
