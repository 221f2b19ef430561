//! The exhaust manifold: a volume in which the gas loses heat to ambient.

use super::gas::{Gas, Volume};
use super::variables::{ExhaustManifoldLocals, ExhaustManifoldParameters};
use crate::elementary::Elementary;

#[derive(Clone, Copy, Debug)]
pub struct ExhaustManifold<D = f64> {
    pub parameters: ExhaustManifoldParameters<D>,
    pub volume: Volume<D>,
    pub gas: Gas<D>,
}

impl<D: Elementary> ExhaustManifold<D> {
    /// The temperature in K upstream of the turbine, for the gas at the valves (flow in kg/s, temperature in K): a pipe
    /// in surroundings of constant temperature.
    ///
    /// Reverse flow into the cylinders counts as zero.
    pub fn evaluate(&self, gas: (D, D), ambient_temperature: D) -> ExhaustManifoldLocals<D> {
        // 1 mW/K keeps the exponent finite without flow.
        let heat_capacity_flow = gas.0.max(0.0) * self.gas.parameters.specific_heat + 1e-3;
        let remaining = (-self.parameters.heat_transfer / heat_capacity_flow).exponential();
        ExhaustManifoldLocals { temperature: ambient_temperature + (gas.1 - ambient_temperature) * remaining }
    }
}
