//! A radial turbine: flow over pressure ratio, efficiency over blade speed ratio (Eriksson, Modeling and
//! control of turbocharged SI and DI engines, OGST 62(4), 2007).

use super::gas::{Gas, signed_root, smooth_max};

/// A turbine.
#[derive(Clone, Copy, Debug)]
pub struct Turbine {
    /// Flow parameter W·√T/p at a large pressure ratio, in kg √K/(s Pa).
    pub flow_capacity: f64,
    /// Diameter of the wheel in m.
    pub diameter: f64,
    /// Best efficiency.
    pub peak_efficiency: f64,
    /// Exponent of the pressure ratio in the flow characteristic.
    pub flow_exponent: f64,
    /// Blade speed ratio of the best efficiency.
    pub peak_efficiency_speed_ratio: f64,
    /// Smallest efficiency.
    pub minimum_efficiency: f64,
    /// Width of the transition between forward and backward flow.
    pub flow_smoothing: f64,
    /// The gas.
    pub gas: Gas,
}

/// What a turbine does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Expansion {
    /// Flow in kg/s; negative: backwards.
    pub mass_flow: f64,
    /// Speed of the blade tips over that of an isentropic expansion.
    pub speed_ratio: f64,
    /// Efficiency.
    pub efficiency: f64,
    /// Temperature at the outlet in K.
    pub outlet_temperature: f64,
    /// Power given in W.
    pub power: f64,
}

impl Turbine {
    /// The flow from the inlet (pressure in Pa, temperature in K) to the outlet pressure (Pa) at a shaft
    /// speed (rad/s).
    #[must_use]
    pub fn expand(&self, inlet: (f64, f64), outlet_pressure: f64, speed: f64) -> Expansion {
        let (pressure, temperature) = inlet;
        let pressure_ratio = outlet_pressure / pressure;
        let drive = 1.0 - pressure_ratio.powf(self.flow_exponent);
        let mass_flow =
            self.flow_capacity * pressure / temperature.sqrt() * signed_root(drive, self.flow_smoothing);

        let isentropic =
            self.gas.specific_heat * temperature * (1.0 - pressure_ratio.powf(self.gas.isentropic_exponent));
        // Enthalpy in J/kg; the width keeps the blade speed ratio finite without expansion.
        let enthalpy = smooth_max(isentropic, 0.0, 100.0);
        let speed_ratio = 0.5 * self.diameter * speed / (2.0 * enthalpy).sqrt();
        let off_peak = speed_ratio / self.peak_efficiency_speed_ratio - 1.0;
        let efficiency =
            smooth_max(self.peak_efficiency * (1.0 - off_peak * off_peak), self.minimum_efficiency, 0.02);
        Expansion {
            mass_flow,
            speed_ratio,
            efficiency,
            outlet_temperature: temperature - efficiency * enthalpy / self.gas.specific_heat,
            power: smooth_max(mass_flow, 0.0, 1e-5) * enthalpy * efficiency,
        }
    }
}
