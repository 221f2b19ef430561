//! The intercooler: a flow resistance and a heat exchanger with constant effectiveness.

use super::flow_resistance::FlowResistance;
use super::gas::Volume;
use super::scalar::Scalar;

/// An intercooler.
#[derive(Clone, Copy, Debug)]
pub struct Intercooler<D = f64> {
    /// Its pressure loss.
    pub resistance: FlowResistance<D>,
    /// Share of the temperature difference to the coolant that is removed.
    pub effectiveness: D,
    /// The volume from here to the throttle.
    pub volume: Volume<D>,
}

impl<D: Scalar> Intercooler<D> {
    /// The temperature in K behind the intercooler, for those of inlet and coolant.
    #[must_use]
    pub fn outlet_temperature(&self, inlet_temperature: D, coolant_temperature: D) -> D {
        inlet_temperature - self.effectiveness * (inlet_temperature - coolant_temperature)
    }
}
