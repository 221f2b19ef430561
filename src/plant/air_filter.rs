//! The air filter: a flow resistance upstream of the low-pressure compressor.

use super::flow_resistance::mass_flow;
use super::gas::Volume;
use super::variables::{AirFilterLocals, AirFilterParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct AirFilter<D = f64> {
    pub parameters: AirFilterParameters<D>,
    /// The volume from here to the compressor.
    pub volume: Volume<D>,
}

impl<D: Number> AirFilter<D> {
    /// The flow from ambient (pressure in Pa, temperature in K) to a pressure (Pa) downstream of the filter.
    pub fn evaluate(&self, ambient: (D, D), pressure: D) -> AirFilterLocals<D> {
        let AirFilterParameters { flow_resistance, linear_pressure, .. } = self.parameters;
        AirFilterLocals {
            mass_flow: mass_flow(flow_resistance, linear_pressure, ambient, (pressure, ambient.1)),
        }
    }
}
