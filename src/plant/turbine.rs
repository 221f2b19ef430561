//! A radial turbine: flow over pressure ratio, efficiency over blade speed ratio (Eriksson, Modeling and
//! control of turbocharged SI and DI engines, OGST 62(4), 2007).

use super::gas::{Gas, signed_root, smooth_max};
use super::variables::{TurbineLocals, TurbineParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Turbine<D = f64> {
    pub parameters: TurbineParameters<D>,
    /// Radius of the wheel in m.
    radius: D,
    /// Reciprocal of the blade speed ratio at peak efficiency.
    by_peak_efficiency_speed_ratio: D,
    /// Reciprocal of the specific heat, in kg K/J.
    by_specific_heat: D,
    pub gas: Gas<D>,
}

impl<D: Number> Turbine<D> {
    pub fn new(parameters: TurbineParameters<D>, gas: Gas<D>) -> Self {
        Self {
            radius: parameters.diameter * 0.5,
            by_peak_efficiency_speed_ratio: parameters.peak_efficiency_speed_ratio.recip(),
            by_specific_heat: gas.parameters.specific_heat.recip(),
            parameters,
            gas,
        }
    }

    /// The flow from the inlet (pressure in Pa, temperature in K) at a shaft speed (rad/s), for the temperature ratio
    /// of isentropic expansion to outlet pressure; `drop` is the pressure ratio to the power of
    /// [`TurbineParameters::flow_exponent`].
    pub fn expand(&self, inlet: (D, D), temperature_ratio: D, drop: D, speed: D) -> TurbineLocals<D> {
        let (pressure, temperature) = inlet;
        let drive = -drop + 1.0;
        let mass_flow = self.parameters.flow_capacity * pressure / temperature.sqrt()
            * signed_root(drive, self.parameters.flow_smoothing);

        let isentropic = self.gas.parameters.specific_heat * temperature * (-temperature_ratio + 1.0);
        // Enthalpy in J/kg; the width keeps the blade speed ratio finite without expansion.
        let enthalpy = smooth_max(isentropic, 0.0.into(), 100.0.into());
        let speed_ratio = self.radius * speed / (enthalpy * 2.0).sqrt();
        let off_peak = speed_ratio * self.by_peak_efficiency_speed_ratio - 1.0;
        let efficiency = smooth_max(
            self.parameters.peak_efficiency * (-off_peak * off_peak + 1.0),
            self.parameters.minimum_efficiency,
            0.02.into(),
        );
        TurbineLocals {
            mass_flow,
            speed_ratio,
            efficiency,
            outlet_temperature: temperature - efficiency * enthalpy * self.by_specific_heat,
            power: smooth_max(mass_flow, 0.0.into(), 1e-5.into()) * enthalpy * efficiency,
        }
    }
}
