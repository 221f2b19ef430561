//! The exhaust manifold: a volume in which the gas loses heat to ambient.

use super::gas::Volume;
use super::scalar::Scalar;

/// An exhaust manifold.
#[derive(Clone, Copy, Debug)]
pub struct ExhaustManifold<D = f64> {
    /// Heat transfer to ambient in W/K.
    pub heat_transfer: D,
    /// Its volume.
    pub volume: Volume<D>,
    /// Specific heat of the gas in J/(kg K).
    pub specific_heat: D,
}

impl<D: Scalar> ExhaustManifold<D> {
    /// The temperature in K before the turbine, for the gas at the valves (flow in kg/s, temperature in
    /// K): a pipe in surroundings of constant temperature.
    ///
    /// A flow back into the cylinders counts as none.
    #[must_use]
    pub fn temperature(&self, gas: (D, D), ambient_temperature: D) -> D {
        // 1 mW/K keeps the exponent finite without flow.
        let heat_capacity_flow = gas.0.at_least(0.0) * self.specific_heat + 1e-3;
        ambient_temperature
            + (gas.1 - ambient_temperature) * (-self.heat_transfer / heat_capacity_flow).exponential()
    }
}
