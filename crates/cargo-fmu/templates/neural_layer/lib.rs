//! A layer of a neural network, y = tanh(W u + b): `resources/weights.csv` has a line of b and W for each output.

use fmu_export::{Context, Equations, Error, Number, Persistent};

fmu_export::fmu!(equations {Type});

/// A line of `weights.csv` for each output: its bias, then its weights.
#[derive(Clone, Debug, Default, Persistent)]
pub struct {Type} {
    weights: Vec<Vec<f64>>,
}

impl Equations for {Type} {
    type Variables = Variables;

    fn prepare(
        &mut self,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let text = String::from_utf8_lossy(&context.resource("weights.csv")?).into_owned();
        self.weights = weights(&text)?;
        let sizes = (variables.outputs.y.len(), 1 + variables.inputs.u.len());
        if self.weights.len() != sizes.0 || self.weights.iter().any(|row| row.len() != sizes.1) {
            let (rows, columns) = sizes;
            return Err(Error::new(format!("weights.csv must have {rows} lines of {columns} numbers")));
        }
        Ok(())
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (u, y) = (&variables.inputs.u, &mut variables.outputs.y);
        for (y, row) in y.iter_mut().zip(&self.weights) {
            let mut sum = T::from(row[0]);
            row[1..].iter().zip(u).for_each(|(&weight, &u)| sum += u * weight);
            *y = sum.tanh();
        }
    }
}

/// The numbers of a CSV file.
fn weights(text: &str) -> Result<Vec<Vec<f64>>, Error> {
    let number = |text: &str| {
        let refused = |error| Error::new(format!("weights.csv: '{text}': {error}"));
        text.trim().parse().map_err(refused)
    };
    text.lines().map(|line| line.split(',').map(number).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_has_a_line_of_numbers_for_each_output() {
        let rows = weights(include_str!("../resources/weights.csv")).unwrap();
        assert!(rows.len() == 4 && rows.iter().all(|row| row.len() == 4));
        assert!(weights("0.5,one").is_err());
    }
}
