//! A radial turbine: flow over pressure ratio, efficiency over blade speed ratio (Eriksson, Modeling and
//! control of turbocharged SI and DI engines, OGST 62(4), 2007).

use super::gas::{Gas, signed_root, smooth_max};
use super::scalar::Scalar;

/// A turbine.
#[derive(Clone, Copy, Debug)]
pub struct Turbine<D = f64> {
    /// Flow parameter W·√T/p at a large pressure ratio, in kg √K/(s Pa).
    pub flow_capacity: D,
    /// Radius of the wheel in m.
    pub radius: D,
    /// Best efficiency.
    pub peak_efficiency: D,
    /// Exponent of the pressure ratio in the flow characteristic.
    pub flow_exponent: D,
    /// Reciprocal of the blade speed ratio of the best efficiency.
    pub by_peak_efficiency_speed_ratio: D,
    /// Reciprocal of the specific heat, in kg K/J.
    pub by_specific_heat: D,
    /// Smallest efficiency.
    pub minimum_efficiency: D,
    /// Width of the transition between forward and backward flow.
    pub flow_smoothing: D,
    /// The gas.
    pub gas: Gas<D>,
}

/// What a turbine does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Expansion<D = f64> {
    /// Flow in kg/s; negative: backwards.
    pub mass_flow: D,
    /// Speed of the blade tips over that of an isentropic expansion.
    pub speed_ratio: D,
    /// Efficiency.
    pub efficiency: D,
    /// Temperature at the outlet in K.
    pub outlet_temperature: D,
    /// Power given in W.
    pub power: D,
}

impl<D: Scalar> Turbine<D> {
    /// The flow from the inlet (pressure in Pa, temperature in K) at a shaft speed (rad/s), where isentropic
    /// expansion to the outlet's pressure lowers the temperature by a ratio, and `drop` is the ratio of
    /// pressures to the power of [`Turbine::flow_exponent`].
    #[must_use]
    pub fn expand(&self, inlet: (D, D), temperature_ratio: D, drop: D, speed: D) -> Expansion<D> {
        let (pressure, temperature) = inlet;
        let drive = -drop + 1.0;
        let mass_flow =
            self.flow_capacity * pressure / temperature.sqrt() * signed_root(drive, self.flow_smoothing);

        let isentropic = self.gas.specific_heat * temperature * (-temperature_ratio + 1.0);
        // Enthalpy in J/kg; the width keeps the blade speed ratio finite without expansion.
        let enthalpy = smooth_max(isentropic, 0.0.into(), 100.0.into());
        let speed_ratio = self.radius * speed / (enthalpy * 2.0).sqrt();
        let off_peak = speed_ratio * self.by_peak_efficiency_speed_ratio - 1.0;
        let efficiency = smooth_max(
            self.peak_efficiency * (-off_peak * off_peak + 1.0),
            self.minimum_efficiency,
            0.02.into(),
        );
        Expansion {
            mass_flow,
            speed_ratio,
            efficiency,
            outlet_temperature: temperature - efficiency * enthalpy * self.by_specific_heat,
            power: smooth_max(mass_flow, 0.0.into(), 1e-5.into()) * enthalpy * efficiency,
        }
    }
}
