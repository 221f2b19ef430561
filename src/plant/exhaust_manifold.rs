//! The exhaust manifold: a volume in which the gas loses heat to ambient.

use super::gas::{Gas, Volume};
use super::scalar::Scalar;
use super::variables::{ExhaustManifoldLocals, ExhaustManifoldParameters};

/// An exhaust manifold.
#[derive(Clone, Copy, Debug)]
pub struct ExhaustManifold<D = f64> {
    /// Its parameters.
    pub parameters: ExhaustManifoldParameters<D>,
    /// Its volume.
    pub volume: Volume<D>,
    /// The gas.
    pub gas: Gas<D>,
}

impl<D: Scalar> ExhaustManifold<D> {
    /// The temperature in K before the turbine, for the gas at the valves (flow in kg/s, temperature in
    /// K): a pipe in surroundings of constant temperature.
    ///
    /// A flow back into the cylinders counts as none.
    #[must_use]
    pub fn evaluate(&self, gas: (D, D), ambient_temperature: D) -> ExhaustManifoldLocals<D> {
        // 1 mW/K keeps the exponent finite without flow.
        let heat_capacity_flow = gas.0.at_least(0.0) * self.gas.parameters.specific_heat + 1e-3;
        let remaining = (-self.parameters.heat_transfer / heat_capacity_flow).exponential();
        ExhaustManifoldLocals { temperature: ambient_temperature + (gas.1 - ambient_temperature) * remaining }
    }
}
