//! The exhaust downstream of the turbines: a pipe with a catalyst, and its flow resistance to ambient.

use super::flow_resistance::mass_flow;
use super::gas::Volume;
use super::variables::{ExhaustLocals, ExhaustParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Exhaust<D = f64> {
    pub parameters: ExhaustParameters<D>,
    /// The volume from the turbine to here.
    pub volume: Volume<D>,
}

impl<D: Number> Exhaust<D> {
    /// The flow from upstream of the catalyst to ambient, each given by pressure (Pa) and temperature (K).
    pub fn evaluate(&self, inlet: (D, D), ambient: (D, D)) -> ExhaustLocals<D> {
        let ExhaustParameters { flow_resistance, linear_pressure, .. } = self.parameters;
        ExhaustLocals {
            temperature: inlet.1,
            mass_flow: mass_flow(flow_resistance, linear_pressure, inlet, ambient),
        }
    }
}
