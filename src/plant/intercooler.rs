//! The intercooler: a flow resistance and a heat exchanger with constant effectiveness.

use super::flow_resistance::mass_flow;
use super::gas::Volume;
use super::variables::{IntercoolerLocals, IntercoolerParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Intercooler<D = f64> {
    pub parameters: IntercoolerParameters<D>,
    /// The volume from here to the throttle.
    pub volume: Volume<D>,
}

impl<D: Number> Intercooler<D> {
    /// Flow and cooling from the inlet (pressure in Pa, temperature in K) to a pressure (Pa) downstream of the
    /// intercooler, for a coolant temperature (K).
    pub fn evaluate(
        &self,
        inlet: (D, D),
        outlet_pressure: D,
        coolant_temperature: D,
    ) -> IntercoolerLocals<D> {
        let IntercoolerParameters { flow_resistance, linear_pressure, effectiveness, .. } = self.parameters;
        let inlet_temperature = inlet.1;
        IntercoolerLocals {
            inlet_temperature,
            mass_flow: mass_flow(
                flow_resistance,
                linear_pressure,
                inlet,
                (outlet_pressure, inlet_temperature),
            ),
            outlet_temperature: inlet_temperature - effectiveness * (inlet_temperature - coolant_temperature),
        }
    }
}
