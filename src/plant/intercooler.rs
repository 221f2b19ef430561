//! The intercooler: a flow resistance and a heat exchanger with constant effectiveness.

use super::flow_resistance::FlowResistance;

/// An intercooler.
#[derive(Clone, Copy, Debug)]
pub struct Intercooler {
    /// Its pressure loss.
    pub resistance: FlowResistance,
    /// Share of the temperature difference to the coolant that is removed.
    pub effectiveness: f64,
    /// Volume in m³ from here to the throttle.
    pub volume: f64,
}

impl Intercooler {
    /// The temperature in K behind the intercooler, for those of inlet and coolant.
    #[must_use]
    pub fn outlet_temperature(&self, inlet_temperature: f64, coolant_temperature: f64) -> f64 {
        inlet_temperature - self.effectiveness * (inlet_temperature - coolant_temperature)
    }
}
