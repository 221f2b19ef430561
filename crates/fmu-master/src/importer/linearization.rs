//! Linear equations about an operating point, from the FMU's directional derivatives, else from finite differences.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use fmu_package::{FmuDescription, FmuVariable};
use fmu_terms::Version;

use super::Interface;
use super::c_boundary::Vector;
use super::differences::{Place, nominal};
use super::event_mode::EventMode;
use super::exchange::Exchange;
use super::fmu::{Fmu, reference};
use super::instance::Instance;
use super::selection::Selection;

/// dx/dt = A·x + B·u and y = C·x + D·u, for small deviations of the states x, the inputs u and the outputs y from an
/// operating point.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearization {
    /// The continuous states, with their values.
    pub states: Vec<(String, f64)>,
    /// The states' derivatives at the operating point, each per second: 0 at rest.
    pub derivatives: Vec<f64>,
    /// The inputs, with their values.
    pub inputs: Vec<(String, f64)>,
    /// The outputs, with their values.
    pub outputs: Vec<(String, f64)>,
    /// The rows of A.
    pub a: Vec<Vec<f64>>,
    /// The rows of B.
    pub b: Vec<Vec<f64>>,
    /// The rows of C.
    pub c: Vec<Vec<f64>>,
    /// The rows of D.
    pub d: Vec<Vec<f64>>,
    /// Whether the numbers are the FMU's directional derivatives, rather than differences.
    pub is_exact: bool,
}

impl Instance {
    /// The linear equations of the FMU about its present time, states and inputs, for real inputs and outputs of these
    /// names. In co-simulation it needs directional derivatives.
    ///
    /// # Errors
    /// When a map gives the FMU other units, there is no variable of a name, its ModelStructure names no states, it has no
    /// directional derivatives in co-simulation, a call fails, or a number is not finite.
    pub fn linearize(&mut self, inputs: &[&str], outputs: &[&str]) -> Result<Linearization> {
        let fmu = Arc::clone(self.fmu());
        if !fmu.conversions.is_empty() {
            bail!("{}: a map changes its units, so it cannot be linearized", self.calls.name);
        }
        let time = self.calls.time().context("the instance is not initialized")?;
        let exchange = self.exchange().cloned();
        if exchange.is_some() && self.events().is_some_and(EventMode::is_entered) {
            self.step(time, 0.0)?;
        }
        let pairs = states(fmu.description())?;
        if pairs.is_empty() {
            bail!("{}: the FMU has no continuous states", self.calls.name);
        }
        let of_names =
            |names: &[&str]| names.iter().map(|name| fmu.variable(name)).collect::<Result<Vec<_>>>();
        let (input_variables, output_variables) = (of_names(inputs)?, of_names(outputs)?);
        let known: Vec<_> = pairs.iter().map(|[state, _]| *state).chain(input_variables).collect();
        let unknown: Vec<_> =
            pairs.iter().map(|[_, derivative]| *derivative).chain(output_variables).collect();

        let count = pairs.len();
        let [mut by_states, mut by_inputs, mut of] = [
            fmu.select(names(&known[..count]))?,
            fmu.select(names(&known[count..]))?,
            fmu.select(names(&unknown))?,
        ];
        let [mut by_values, mut of_values] = [vec![0.0; known.len()], vec![0.0; unknown.len()]];
        self.read(&mut by_states, &mut by_values[..count])?;
        self.read(&mut by_inputs, &mut by_values[count..])?;
        self.observe(exchange.as_ref(), &mut of, &mut of_values, count)?;
        let is_exact = self.calls.has_directional_derivatives;
        let columns = if is_exact {
            self.directional_derivatives(&known, &of)?
        } else if let Some(exchange) = &exchange {
            self.differences(exchange, &known, (by_values.clone(), &of_values), &mut by_inputs, &mut of)?
        } else {
            bail!(
                "{} has no directional derivatives, and no Model Exchange in which finite differences could replace them",
                self.calls.name
            )
        };
        for (column, known) in columns.iter().zip(&known) {
            if let Some(row) = column.iter().position(|number| !number.is_finite()) {
                bail!("the derivative of {} by {} is {}", unknown[row].name, known.name, column[row]);
            }
        }
        let part = |rows: std::ops::Range<usize>, parts: std::ops::Range<usize>| -> Vec<Vec<f64>> {
            rows.map(|row| parts.clone().map(|column| columns[column][row]).collect()).collect()
        };
        let of_state = 0..count;
        let named = |variables: &[&FmuVariable], values: &[f64]| {
            variables.iter().map(|variable| variable.name.clone()).zip(values.iter().copied()).collect()
        };
        Ok(Linearization {
            states: named(&known[..count], &by_values[..count]),
            derivatives: of_values[..count].to_vec(),
            inputs: named(&known[count..], &by_values[count..]),
            outputs: named(&unknown[count..], &of_values[count..]),
            a: part(of_state.clone(), of_state.clone()),
            b: part(of_state.clone(), count..known.len()),
            c: part(count..unknown.len(), of_state),
            d: part(count..unknown.len(), count..known.len()),
            is_exact,
        })
    }

    /// Reads derivatives of states and outputs. In Model Exchange, derivatives need not be computed as variables.
    fn observe(
        &mut self,
        exchange: Option<&Exchange>,
        of: &mut Selection,
        values: &mut [f64],
        states: usize,
    ) -> Result<()> {
        self.read(of, values)?;
        exchange.map_or(Ok(()), |exchange| {
            exchange.get_vector(&mut self.calls, Vector::Derivatives, &mut values[..states])
        })
    }

    /// The derivatives of the unknowns by each of the knowns.
    fn directional_derivatives(&mut self, known: &[&FmuVariable], of: &Selection) -> Result<Vec<Vec<f64>>> {
        let mut columns = vec![];
        for by in known {
            // The reference of an array is for all its elements.
            let mut seed = vec![0.0; by.element.map_or(1, |element| element.size)];
            seed[by.element.map_or(0, |element| element.position)] = 1.0;
            let mut column = vec![0.0; of.names().len()];
            for group in &of.groups {
                let mut changes = vec![0.0; group.values.len()];
                let called = self.calls.handle.directional_derivative(
                    &group.references,
                    &[reference(by)?],
                    &seed,
                    &mut changes,
                )?;
                let names = std::slice::from_ref(&by.name);
                self.calls.check(names, called)?;
                group.scatter_derivatives(&changes, &mut column);
            }
            columns.push(column);
        }
        Ok(columns)
    }

    /// The unknowns' derivatives by parabolas, in Model Exchange, at `values` of the knowns, states first; the unknowns are
    /// `here` there.
    fn differences(
        &mut self,
        exchange: &Exchange,
        known: &[&FmuVariable],
        (mut values, here): (Vec<f64>, &[f64]),
        inputs: &mut Selection,
        of: &mut Selection,
    ) -> Result<Vec<Vec<f64>>> {
        let (time, states) = (self.calls.time().unwrap_or_default(), values.len() - inputs.names().len());
        let mut nominals = vec![1.0; states];
        exchange.get_nominals(&mut self.calls, &mut nominals)?;
        for input in &known[states..] {
            nominals.push(nominal(input.nominal()?));
        }
        let mut columns = vec![];
        for (index, (variable, nominal)) in known.iter().zip(nominals).enumerate() {
            let place = Place::new(values[index], nominal, variable.range()?);
            let (value, moved) = (values[index], place.around());
            let mut there = [vec![0.0; here.len()], vec![0.0; here.len()]];
            for (moved, there) in moved.iter().zip(&mut there) {
                values[index] = *moved;
                exchange.go_to(&mut self.calls, time, &values[..states])?;
                self.calls.write(inputs, &values[states..])?;
                self.observe(Some(exchange), of, there, states)?;
            }
            values[index] = value;
            let slope = |row: usize| place.slope(moved, here[row], [there[0][row], there[1][row]]);
            columns.push((0..here.len()).map(slope).collect());
        }
        exchange.go_to(&mut self.calls, time, &values[..states])?;
        self.calls.write(inputs, &values[states..])?;
        Ok(columns)
    }
}

impl Fmu {
    /// Whether [`Instance::linearize`] can linearize it: it has continuous states, directional derivatives or Model
    /// Exchange, and the units that it declares.
    #[must_use]
    pub fn can_be_linearized(&self) -> bool {
        let has_states = states(self.description()).is_ok_and(|states| !states.is_empty());
        let has_own_units = self.conversions.is_empty();
        has_states
            && has_own_units
            && (self.has_directional_derivatives() || self.interface() == Interface::ModelExchange)
    }

    /// Whether the FMU has directional derivatives.
    #[must_use]
    pub fn has_directional_derivatives(&self) -> bool {
        let flag = match self.description().version() {
            Version::Two => "providesDirectionalDerivative",
            Version::Three => "providesDirectionalDerivatives",
        };
        self.has_capability(flag)
    }
}

/// The continuous states with their derivatives.
fn states(description: &FmuDescription) -> Result<Vec<[&FmuVariable; 2]>> {
    description.continuous_states().context("its modelDescription.xml is broken")
}

fn names<'a>(variables: &[&'a FmuVariable]) -> impl Iterator<Item = &'a str> {
    variables.iter().map(|variable| variable.name.as_str())
}
