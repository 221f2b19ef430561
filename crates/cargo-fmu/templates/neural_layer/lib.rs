//! A layer of a neural network, y = tanh(W u + b), with weights from a file.

use fmu_export::table::Table;
use fmu_export::{Context, Equations, Error, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// The bias and the weights of each output, as in the rows of `resources/weights.csv`.
#[derive(Clone, Debug, Default, Persistent)]
pub struct {Type} {
    rows: Vec<Vec<f64>>,
}

impl Equations for {Type} {
    type Variables = Variables;

    fn prepare(
        &mut self,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.rows = Table::resource(context, "weights.csv")?.rows();
        let (count, length) = (variables.outputs.y.len(), 1 + variables.inputs.u.len());
        if self.rows.len() == count && self.rows.iter().all(|row| row.len() == length) {
            Ok(())
        } else {
            let message = format!("weights.csv must have {count} rows of {length} numbers");
            Err(Error::new(message))
        }
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        for (y, row) in variables.outputs.y.iter_mut().zip(&self.rows) {
            let mut sum = T::from(row[0]);
            for (&weight, &u) in row[1..].iter().zip(variables.inputs.u.iter()) {
                sum += u * weight;
            }
            *y = sum.tanh();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_export::{Simulation, check_dependencies};

    #[test]
    fn the_first_output_is_that_of_the_first_row() -> Result<(), Error> {
        check_dependencies::<{Type}>(&Variables::default())?;
        let mut simulation = Simulation::<{Type}>::default();
        simulation.variables.inputs.u = [1.0, -2.0, 3.0];
        simulation.initialize()?;
        let y = simulation.variables.outputs.y;
        // 0.1 + 0.5 * 1 - 0.25 * -2 + 0.75 * 3, up to rounding.
        assert!((y[0] - 3.35_f64.tanh()).abs() < 1e-15);
        Ok(())
    }
}
